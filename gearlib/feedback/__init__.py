"""Feedback loops closed around a train: Nyquist's criterion, margins, stable gains, and stability in words."""
