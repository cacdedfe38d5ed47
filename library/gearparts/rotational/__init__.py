"""Parts that rotate about a fixed axis: bodies, shafts, friction, torque sources, prescribed motions, sensors."""
