"""Fitting: parameters of a system from measured histories, responses, modes and margins."""
