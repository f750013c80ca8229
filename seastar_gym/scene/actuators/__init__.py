"""Actuators: rotation of every limb at the hub as a function of time and command."""
