"""Taylor methods: Taylor coefficients of the motion at each step, with order and step size from their decay."""
