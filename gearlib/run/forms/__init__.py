"""Forms of the equations for IDA: ODE, torn, index-reduced DAE."""
