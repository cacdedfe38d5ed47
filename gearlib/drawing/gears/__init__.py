"""Gears seen along their axes: what is shown, and how it is drawn and moved."""
