"""Symbolic analysis, once per class: templates, kernels, class records. No package above this one uses sympy."""
