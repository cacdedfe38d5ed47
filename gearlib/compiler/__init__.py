"""The small language (a part of Python) to machine code by LLVM; knows nothing of gears."""
