"""Scenes beyond the chapter's: gallery, damping, the thermal actuator."""
