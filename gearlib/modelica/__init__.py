"""Modelica text, read and written: `gearlib.read_modelica`, `gearlib.to_modelica`."""
