"""From compiled functions to time histories: initial values, integrators, events, results."""
