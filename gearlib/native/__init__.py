"""Code generation: a program as source in the small language (right-hand side, derivatives, event functions, Taylor series)."""
