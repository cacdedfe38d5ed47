"""Mobility, speed ratios, power flow: what holds without a simulation."""
