"""Tangents of a run: sensitivities of its states, and of variables computed from them, to parameters and start values."""
