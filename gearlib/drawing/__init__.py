"""Pictures from plain data: block diagrams, schemes, plots. Nothing here knows what made the data."""
