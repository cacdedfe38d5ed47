"""An equation of a class, analysed once: template, kernels, class record. Nothing above this package sees sympy."""
