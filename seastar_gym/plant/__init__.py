"""Robots in a tank, and simulated ones in their place: sight, heat, a guard, and an environment around them.

A `Plant` is sighted, heated and stopped. `LinePlant` talks to one by lines of text, `SimulatedPlant` is one, a `Guard`
stands before one, and `PlantSwim` is the environment in which policies drive it.
"""
