"""A flat model with its index reduced: what is differentiated, what is a state, what is solved from what."""
