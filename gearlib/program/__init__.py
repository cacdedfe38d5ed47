"""What is computed, in which order: batches of kernels, linear blocks, Newton blocks; carried out with numpy."""
