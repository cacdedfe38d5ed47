"""Stick diagrams of gear trains, with shafts as lines and gears as bars: contents, layout and routing."""
