"""Parts that turn about a fixed axis: bodies, shafts, friction, sources of torque, prescribed motions, sensors."""
