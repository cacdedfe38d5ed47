"""Refusals of runs: differentiated input jumps, variables below their minimum, and diagnosis of the equation to blame."""
