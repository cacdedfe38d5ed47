"""Energy balance of a run: an audit of its equations and its accuracy."""
