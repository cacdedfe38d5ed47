"""Computations after a run, from its stored motion: states that it did not integrate, branches of nonlinear equations."""
