"""A compiled model at work: scene, start values, linear form, request, segments, result."""
