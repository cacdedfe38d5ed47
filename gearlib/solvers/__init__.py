"""Integrators for a `Problem` of numbers and native functions."""
