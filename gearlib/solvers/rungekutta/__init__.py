"""Explicit Runge-Kutta methods with event location."""
