"""`Water`: the fluid around the robot.

Currents: velocity fields of the fluid. Some numbers may differ from robot to robot, see number.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.checks import as_floats, is_finite_number, require_number, shown
from seastar_gym.scene.number import Numbers, batch_size, check_numbers, finite, not_negative, positive
from seastar_gym.scene.serial import register_part

Floats = NDArray[np.float64]

LARGEST_GRID = 4_000_000
"""Largest number of grid points."""
TOO_MANY_POINTS = f"The grid has more than {LARGEST_GRID:,} points: use a larger spacing."


@register_part
@dataclass(frozen=True)
class UniformCurrent:
    """Uniform current: the fluid moves as a whole with the velocity (u_x, u_y) [m/s].

    Numbers that differ from robot to robot must be numpy arrays of shape (n_robots,), since a tuple could be a vector.
    """

    u_x: Annotated[Numbers, finite("m/s")] = 0.0
    u_y: Annotated[Numbers, finite("m/s")] = 0.0

    def __post_init__(self) -> None:
        if type(self.u_x) in (tuple, list):
            raise ValueError(
                "UniformCurrent takes u_x and u_y [m/s], or a numpy array of each with a number for every robot, not "
                f"the vector {shown(self.u_x)}."
            )
        check_numbers(self)


@register_part
@dataclass(frozen=True)
class ShearCurrent:
    """Simple shear flow: u = rate y' along x', where the axes x', y' are x, y rotated by `direction`.

    The fluid is at rest on the line through the origin along x'.

    rate: Shear rate [1/s].
    direction: Direction of the flow [rad], anti-clockwise from x.
    """

    rate: Annotated[Numbers, finite("1/s")]
    direction: Annotated[Numbers, finite("rad")] = 0.0

    def __post_init__(self) -> None:
        check_numbers(self)


@register_part
@dataclass(frozen=True)
class Vortex:
    """Steady vortex with a smooth core after Kaufmann and Scully, with azimuthal velocity Gamma/(2 pi) r/(r_c^2 + r^2).

    circulation: Gamma [m^2/s], positive anti-clockwise.
    x, y: Centre of the vortex [m].
    core_radius: r_c [m], the radius at which the velocity is largest.
    """

    circulation: Annotated[Numbers, finite("m^2/s")]
    x: Annotated[Numbers, finite("m")] = 0.0
    y: Annotated[Numbers, finite("m")] = 0.0
    core_radius: Annotated[Numbers, positive("m")] = 0.05

    def __post_init__(self) -> None:
        check_numbers(self)


@register_part
@dataclass(frozen=True)
class GridCurrent:
    """Current sampled on a square grid, with bilinear interpolation.

    Outside the grid, the velocity is that of the nearest point on the grid's edge.

    corner: First point of the grid (x, y) [m].
    spacing: Distance between neighbouring points, along both axes [m].
    velocities: Velocities at the points [m/s], an array of shape (n_x, n_y, 2), kept as tuples.
    """

    corner: tuple[float, float]
    spacing: Annotated[float, positive("m")]
    velocities: tuple[tuple[tuple[float, float], ...], ...]

    def __post_init__(self) -> None:
        if not isinstance(self.corner, tuple | list) or list(map(is_finite_number, self.corner)) != [True, True]:
            raise ValueError(f"corner must be two finite numbers [m], not {shown(self.corner)}.")
        object.__setattr__(self, "corner", tuple(float(x) for x in self.corner))
        check_numbers(self)
        rows: Any = _checked_velocities(self.velocities).tolist()
        object.__setattr__(self, "velocities", tuple(tuple(map(tuple, row)) for row in rows))

    @classmethod
    def from_function(
        cls,
        function: Callable[[Floats, Floats], tuple[Floats, Floats]],
        x: tuple[float, float],
        y: tuple[float, float],
        spacing: float,
    ) -> GridCurrent:
        """Sample a function on the rectangle from x[0] to x[1] and from y[0] to y[1] [m].

        function: Velocity (u_x, u_y) [m/s] at arrays x, y [m] of one shape. It may return numbers where the velocity
            does not depend on the position.
        spacing: Distance between neighbouring points [m].
        """
        require_number("spacing", spacing, "m")
        if not callable(function):
            raise ValueError(f"function must be a function of x and y [m], not {shown(function)}.")
        axes = [_axis("x", x, spacing), _axis("y", y, spacing)]
        if len(axes[0]) * len(axes[1]) > LARGEST_GRID:
            raise ValueError(TOO_MANY_POINTS)
        xs, ys = np.meshgrid(*axes, indexing="ij")
        velocities = np.zeros((*xs.shape, 2))
        try:
            velocities[..., 0], velocities[..., 1] = function(xs, ys)
        except (TypeError, ValueError, OverflowError) as wrong:
            raise ValueError(f"function must make (u_x, u_y) [m/s] of arrays x and y: {shown(str(wrong))}.") from wrong
        return cls((float(x[0]), float(y[0])), float(spacing), velocities)  # type: ignore[arg-type]


def _checked_velocities(velocities: object) -> Floats:
    """Velocities of a grid [m/s] as an array of shape (n_x, n_y, 2). ValueError for anything else."""
    array = as_floats("velocities", velocities)
    if array.ndim != 3 or array.shape[2] != 2 or min(array.shape) < 2 or array.size > 2 * LARGEST_GRID:
        raise ValueError(
            f"velocities must have shape (n_x, n_y, 2), with two points or more each way and at most "
            f"{LARGEST_GRID:,} points, not {array.shape}."
        )
    if not np.isfinite(array).all():
        raise ValueError("velocities must be finite [m/s].")
    return array


def _axis(name: str, ends: Any, spacing: float) -> Floats:
    """Coordinates of grid points [m], from the first end to the second or just beyond."""
    two = isinstance(ends, tuple | list | np.ndarray) and len(np.atleast_1d(np.asarray(ends, dtype=object))) == 2
    if not two or not all(map(is_finite_number, ends)) or not ends[1] - ends[0] >= spacing:
        raise ValueError(f"{name} must be two ends at least a spacing apart [m], not {shown(ends)}.")
    n_spacings = (ends[1] - ends[0]) / spacing
    if n_spacings > LARGEST_GRID:
        raise ValueError(TOO_MANY_POINTS)
    return np.asarray(ends[0] + spacing * np.arange(int(np.ceil(n_spacings - 1e-9)) + 1))


AnyCurrent = UniformCurrent | ShearCurrent | Vortex | GridCurrent


@register_part
@dataclass(frozen=True)
class Water:
    """Fluid with the quadratic drag of (13.8).

    density: rho_f [kg/m^3].
    drag_coefficient: C_d [1], drag coefficient of flow across a limb.
    tangential_drag_coefficient: C_t [1], drag coefficient of flow along a limb, at most C_d. None means C_d. With the
        velocity w relative to the fluid and its part w_n normal to the limb, the friction C_t |w| w and the pressure
        (C_d - C_t) |w_n| w_n add up (after G. I. Taylor, 1952).
    current: Velocity field of the fluid. None means that the fluid is at rest.
    added_mass_coefficient: C_a [1], mass of the fluid that a limb accelerates when it moves sideways, over the mass of
        the fluid that it displaces; 1 for a round limb. None means no added mass, as in the chapter.
    """

    density: Annotated[Numbers, not_negative("kg/m^3")] = 1000.0
    drag_coefficient: Annotated[Numbers, not_negative("1")] = 1.0
    tangential_drag_coefficient: Annotated[Numbers | None, not_negative("1")] = None
    current: AnyCurrent | None = None
    added_mass_coefficient: Annotated[Numbers | None, not_negative("1")] = None

    def __post_init__(self) -> None:
        check_numbers(self)
        if self.tangential_drag_coefficient is not None:
            batch_size(self)
            if np.any(np.greater(self.tangential_drag_coefficient, self.drag_coefficient)):
                raise ValueError(
                    "tangential_drag_coefficient must not exceed drag_coefficient, that of flow across a limb: "
                    f"{shown(self.tangential_drag_coefficient)} is more than {shown(self.drag_coefficient)}."
                )
        if not isinstance(self.current, AnyCurrent | None):
            raise ValueError(f"current must be a current such as UniformCurrent(u_x=0.001), not {shown(self.current)}.")
