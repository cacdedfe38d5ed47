"""Exponential integrators for linear time-invariant problems."""
