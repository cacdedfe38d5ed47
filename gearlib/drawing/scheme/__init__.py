"""Stick diagrams of gear trains: shafts as lines, gears as bars; what is drawn, where it stands, how its shafts run."""
