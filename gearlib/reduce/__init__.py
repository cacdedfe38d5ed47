"""Index reduction: applies the structural algorithms to a flat model (differentiation, states, matching)."""
