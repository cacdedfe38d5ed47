"""Modal analysis: natural frequencies, mode shapes, modal energies, Campbell diagrams."""
