"""Measurements of real robots, and what the simulator's parts make of them."""
