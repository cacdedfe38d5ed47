"""Statics and steady motion: mobility, speed ratios, power flow, load sharing."""
