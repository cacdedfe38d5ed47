"""Tangents of a run: how its states, and what is computed from them, change with parameters and start values."""
