"""Flattening: component tree to flat equations (instances, connection sets, alias elimination, parameter values)."""
