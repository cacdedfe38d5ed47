"""Symbolic analysis, once per class: templates, kernels, class records. Downstream packages do not use sympy."""
