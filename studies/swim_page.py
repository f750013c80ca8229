"""A page that swims: one HTML file that works from disk, the first thing that the guide shows.

Records two swims of the bundled policies round the pentagon, and 22 strokes of the simulator for a planner in the
page, which follows paths that its reader draws: from each of the two straight gaits, and from rest, two strokes in
each of ten directions. Symmetry turns them to all headings.
"""

import base64
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.learned import bundled_file, load
from seastar_gym.envs.headings import wrapped
from seastar_gym.envs.paths import WAYPOINT_RADIUS
from seastar_gym.envs.rendering import limb_nodes
from seastar_gym.envs.stations import heading_of
from seastar_gym.evaluation.playback import UNIT, RecordingEnv
from seastar_gym.evaluation.swim import swim
from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import Scene
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.simulator import Simulator
from studies.frame import Floats, Results, Study

TEMPLATE = Path(__file__).with_suffix(".html")
FRAMES_PER_SECOND = 10
SEEN = 6
"""Nodes of a limb that the page draws, without the hub."""
N_LIMBS = 5
CYCLE = 2
"""Strokes of a straight gait, which alternates between two pairs."""
SETTLING = 8
"""Strokes after which a gait is steady."""
SWIMS = ((0.2, "learned, five decisions a second"), (None, "learned, a stroke of the chapter each second"))
"""Time between decisions [s] of a bundled policy, and what the page calls its swim."""


def packed(values: Floats) -> str:
    """Numbers of a few thousand units as base64 of 16-bit integers, little end first."""
    return base64.b64encode(np.rint(values).astype("<i2").tobytes()).decode("ascii")


def seen_nodes(nodes_per_limb: int) -> NDArray[np.int_]:
    """Numbers of the nodes that the page draws: the hub, then SEEN of each limb, from hub to tip."""
    chosen = np.rint(np.linspace(0, nodes_per_limb - 1, SEEN + 1)).astype(int)[1:]
    return np.concatenate([[0], limb_nodes(N_LIMBS, nodes_per_limb)[:, chosen].ravel()])


def straight_gaits() -> Floats:
    """Gaits in ten directions, 36 degrees apart from that of limb 1 on, shape (10, CYCLE, n_limbs).

    {3+,4-} and {2+,5-} in turn swim along limb 1, {2-,5+} and {3-,4+} in turn against it.
    """
    wide = np.array([0.0, 0.0, 1.0, -1.0, 0.0])
    along, against = np.stack([wide, STRAIGHT]), np.stack([-STRAIGHT, -wide])
    gaits = np.empty((2 * N_LIMBS, CYCLE, N_LIMBS))
    for turn in range(N_LIMBS):
        gaits[2 * turn] = np.roll(along, turn, axis=1)
        gaits[(2 * turn + N_LIMBS) % (2 * N_LIMBS)] = np.roll(against, turn, axis=1)
    return gaits


def transitions(fidelity: Fidelity) -> dict[str, Any]:
    """Shapes of the robot in the first cycle of every gait after each of three pasts: rest, along limb 1, against it.

    `nodes`: shape (3, 10, frames, n_seen, 2) [UNIT], packed, in the body frame of the cycle's begin, its hub at the
    origin; frames are FRAMES_PER_SECOND from the begin to the end. `hub` [m] and `turn` [rad] are where it ends.
    """
    gaits = straight_gaits()
    pasts = np.stack([np.zeros_like(gaits[0]), gaits[0], gaits[N_LIMBS]])
    n_past, n_next = len(pasts), len(gaits)
    simulator = Simulator(Scene.preset(fidelity), n_past * n_next)
    robot = simulator.scene.robot
    for stroke in range(SETTLING):
        simulator.stroke(np.repeat(pasts[:, stroke % CYCLE], n_next, axis=0))
    heading, hub = heading_of(simulator), simulator.hub_position()
    frames = [simulator.positions]
    for stroke in range(CYCLE):
        for _ in simulator.stroke_in_parts(np.tile(gaits[:, stroke], (n_past, 1)), FRAMES_PER_SECOND):
            frames.append(simulator.positions)
    turn = heading_of(simulator) - heading
    moved = in_frame(np.stack(frames, axis=1)[:, :, seen_nodes(robot.nodes_per_limb)], hub, heading)
    shape = n_past, n_next
    return {
        "nodes": packed(moved / UNIT),
        "frames": moved.shape[1],
        "hub": np.round(moved[:, -1, 0].reshape(*shape, 2), 6).tolist(),
        "turn": np.round(wrapped(turn).reshape(shape), 5).tolist(),
        "commands": gaits.astype(int).tolist(),
    }


def in_frame(positions: Floats, origin: Floats, heading: Floats) -> Floats:
    """Positions, shape (n, frames, nodes, 2), relative to a place, shape (n, 2), and a direction, shape (n,)."""
    c, s = np.cos(heading), np.sin(heading)
    turn = np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)
    return np.einsum("nftx,nxy->nfty", positions - origin[:, None, None], turn)


def recorded(decision_period: float | None, name: str, most: int | None = None) -> dict[str, Any]:
    """A swim of a bundled policy round the pentagon; `most` limits its decisions."""
    policy = load(bundled_file(decision_period))
    env = RecordingEnv(
        frames_per_stroke=round(FRAMES_PER_SECOND * policy.decision_period),
        actions=policy.actions, scene=policy.scene, decision_period=decision_period, waypoint_radius=WAYPOINT_RADIUS,
    )  # fmt: skip
    swim(name, policy, env, max_strokes=10_000 if most is None else most, seed=0)
    frames = env.playback(name).frames
    seen = seen_nodes(env.scene.robot.nodes_per_limb)
    return {
        "name": name,
        "nodes": packed(np.stack([frame.positions[seen] for frame in frames]) / UNIT),
        "waypoint": [frame.waypoint_index for frame in frames],
        "commands": runs([np.sign(frame.command).astype(int).tolist() for frame in frames]),
        "path": np.round(env.waypoints, 6).tolist(),
    }


def runs(values: Sequence[Any]) -> list[Any]:
    """Every value that differs from the one before, with the number of its place."""
    return [[place, value] for place, value in enumerate(values) if place == 0 or value != values[place - 1]]


def page(data: dict[str, Any]) -> str:
    """The page with its data."""
    text = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    return TEMPLATE.read_text(encoding="utf-8").replace("{{data}}", text)


def record(fidelity: Fidelity = "balanced", most: int | None = None) -> dict[str, Any]:
    """All that the page needs."""
    return {
        "unit": UNIT,
        "radius": WAYPOINT_RADIUS,
        "seen": SEEN,
        "limbs": N_LIMBS,
        "rate": FRAMES_PER_SECOND,
        "swims": [recorded(decision_period, name, most) for decision_period, name in SWIMS],
        "map": transitions(fidelity),
    }


def run(results: Results) -> None:
    """Record the swims and write the page."""
    results.out.write_text(page(record()), encoding="utf-8")
    print(f"Written: {results.out}, {results.out.stat().st_size / 1e3:.0f} kB.")


STUDY = Study("swim_page", run, out=Path("docs/swim.html"))
