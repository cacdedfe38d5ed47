"""Periodic motions: harmonic balance, describing functions, order analysis."""
