"""Integration methods, one class per file; `method_table` lists them."""
