"""Sampled controllers, Python functions that a run calls at exact instants; delays of signals."""
