"""What is asked of a system besides time histories: linear models, modes, stability, power flow."""
