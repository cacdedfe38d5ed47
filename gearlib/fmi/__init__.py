"""Functional Mock-up Units: models for other tools, as machine code behind the interfaces of FMI 2.0 and 3.0."""
