"""Runs that are advanced from outside."""
