"""Recording a swim, so that a page can play it back: `RecordingEnv` keeps every frame that a video would show."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.rendering import Frame
from seastar_gym.envs.seastar_swim import SeastarSwimEnv

UNIT = 1e-4
"""[m]: positions are kept as whole numbers of tenths of a millimetre, less than a pixel in a picture of a path."""


@dataclass(frozen=True, eq=False)
class Playback:
    """A recorded swim. frames: At the start and at equal times of every decision. stroke_time: Of a decision [s]."""

    agent: str
    waypoints: NDArray[np.float64]
    """[m], shape (n, 2)."""
    stroke_time: float
    frames: tuple[Frame, ...]

    def packed(self) -> dict[str, Any]:
        """Swim as plain lists of few digits, to be written as JSON: a swim has hundreds of frames.

        `unit`: "stroke", or "decision" if strokes do not take a second.
        For every frame: `nodes`, x, y, x, y, ... [UNIT] from the hub on; `stroke`, 0 at the start; `waypoint`, how many
        are reached; `time` [s]. For every stroke: `commands`, a number per limb, zeros for stroke 0.
        """
        strokes = [int(np.ceil(frame.time / self.stroke_time - 1e-6)) for frame in self.frames]
        last_frames = dict(zip(strokes, self.frames, strict=True))
        return {
            "agent": self.agent,
            "nodes": [np.rint(frame.positions.ravel() / UNIT).astype(int).tolist() for frame in self.frames],
            "unit": "stroke" if np.isclose(self.stroke_time, 1.0) else "decision",
            "stroke": strokes,
            "waypoint": [frame.waypoint_index for frame in self.frames],
            "time": [round(frame.time, 3) for frame in self.frames],
            "commands": [np.sign(frame.command).astype(int).tolist() for frame in last_frames.values()],
        }


class RecordingEnv(SeastarSwimEnv):
    """`SeastarSwimEnv` that keeps the frames of the episode, and draws them only if asked to film."""

    def __init__(self, film: bool = False, **arguments: Any):
        self._recorded: list[Frame] = []
        self._film = film
        super().__init__(render_mode="rgb_array_list", **arguments)

    def reset(self, **arguments: Any) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode, and its recording."""
        self._recorded = []
        return super().reset(**arguments)

    def draw_frame(self) -> None:
        """Keep what a picture would show, and draw it if this is a film."""
        self._recorded.append(self.frame())
        if self._film:
            super().draw_frame()

    def playback(self, agent: str) -> Playback:
        """Playback of the frames since the last reset."""
        return Playback(agent, self.waypoints, self.decision_period, tuple(self._recorded))
