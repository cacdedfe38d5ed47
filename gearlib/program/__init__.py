"""The evaluation program: batches of kernels, linear blocks and Newton blocks in order; its NumPy backend and its derivatives."""
