"""Planetary sets: rigid, lossy, torsional and planar models; mesh phasing and assembly."""
