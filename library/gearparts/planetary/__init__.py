"""Planetary sets: kinematics, levels of detail, losses, planes, phases of the planets' meshes."""
