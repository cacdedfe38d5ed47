"""Runs of a compiled model: translation, scene, start values, request, integration, segments, result."""
