"""Gears: rigid and lossy gears, elastic meshes and their constitutive parts, gear geometry."""
