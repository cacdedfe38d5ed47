"""Interactive runs, advanced from outside."""
