"""The modelling language: components, declarations, expressions, connections, units."""
