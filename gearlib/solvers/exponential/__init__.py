"""Linear time-invariant problems by the matrix exponential."""
