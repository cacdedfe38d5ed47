"""SUNDIALS IDA, driven natively or through scikit-sundae."""
