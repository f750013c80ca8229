"""The hubs that a robot may have."""

from typing import Any

from seastar_gym import Seastar

HUBS = ("rigid", "opening", "turning")
"""The continuum's hub, and the measures of the chapter's hub hinges."""


def robot_with(hub: str, **numbers: Any) -> Seastar:
    if hub == "rigid":
        return Seastar(**numbers)
    return Seastar(**numbers, hub_hinge=hub, discretisation="chapter")
