"""From sorted blocks to functions: kernels (one per class and purpose), a program of numbers, numpy and native code."""
