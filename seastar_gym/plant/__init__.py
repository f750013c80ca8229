"""Robots in a tank, and simulated ones in their place.

In come commands of a policy and places that a camera sees; out go pulses of wires and logs. A `Plant` is sighted,
heated and stopped: `LinePlant` talks to one by lines of text, `SimulatedPlant` is one, a `Guard` stands before one, and
`PlantSwim` is the environment in which policies drive it. The guard trusts neither side, because wires that stay hot
burn.
"""
