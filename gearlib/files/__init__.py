"""File formats for histories, parameter sets and numeric columns, shared with other programs."""
