"""Compiler of the small language, a subset of Python, to machine code through LLVM; knows nothing of gears."""
