"""Actuators: how far every limb is turned at the hub, and when."""
