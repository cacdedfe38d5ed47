"""Structural algorithms on graphs and integers: Pantelides, state selection, matching, sorting, tearing; no symbols."""
