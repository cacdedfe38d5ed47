"""Drawings from plain data: block diagrams, stick diagrams, plots; independent of what produced the data."""
