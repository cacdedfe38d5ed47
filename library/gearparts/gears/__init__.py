"""Gears: rigid and lossy ones, elastic meshes and what they are made of, gear geometry."""
