"""Time-dependent inputs of native code: tables and Python callbacks."""
