"""Methods of integration: one class in one file each; `table` lists them."""
