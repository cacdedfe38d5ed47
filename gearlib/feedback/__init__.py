"""Feedback loops around a train: Nyquist criterion, stability margins, stable gains, and stability in words."""
