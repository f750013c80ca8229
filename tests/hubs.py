"""The hubs that a robot may have."""

from typing import Any

from seastar_gym import Seastar

HUBS = ("rigid", "opening", "turning")
"""The continuum's hub, and the measures of the chapter's hub hinges."""

TEN = Seastar(nodes_per_limb=10)
"""The chapter's robot with its ten nodes, on the continuum's rigid hub."""


def robot_with(hub: str, **numbers: Any) -> Seastar:
    """Robot with a hub, of ten nodes per limb unless others are named."""
    numbers = {"nodes_per_limb": 10} | numbers
    if hub == "rigid":
        return Seastar(**numbers)
    return Seastar(**numbers, hub_hinge=hub, discretisation="chapter")
