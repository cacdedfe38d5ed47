"""Natural frequencies, mode shapes and energies, Campbell diagrams."""
