"""Code generation: a program as source in the small language (right-hand side, Jacobian, event functions)."""
