"""Files: histories, parameter sets and columns of numbers, in the formats that other programs read and write."""
