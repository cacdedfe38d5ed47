"""Integrators: each solves a `Problem` of numbers and native functions."""
