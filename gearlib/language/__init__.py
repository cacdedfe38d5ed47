"""What a modeller writes: components, their declarations, equations and connections."""
