"""Scenes beyond the chapter's: the gallery, material damping, and the thermal actuator."""
