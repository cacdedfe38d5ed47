"""Gear trains: single-loop trains, the train of Zhou and Cui (2022), their graphs and diagrams."""
