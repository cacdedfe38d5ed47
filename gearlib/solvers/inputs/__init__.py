"""Inputs of time as native code sees them: tables and Python callbacks."""
