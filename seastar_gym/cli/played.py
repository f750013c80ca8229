"""The environment of `seastar play`: its pictures say what the keys do, and number the limbs."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.canvas import INK, WATER, Colour, import_pygame
from seastar_gym.envs.rendering import FAINT_INK, limb_nodes
from seastar_gym.envs.seastar_swim import SeastarSwimEnv

TEXT, LINE = 17, 22
"""Heights of letters and of lines [px]."""
COLUMN = 132
"""Width of the column of keys [px]."""
CORNER = (16, 44)
"""Place of the help in the picture [px]."""


class PlayedEnv(SeastarSwimEnv):
    """`SeastarSwimEnv` whose pictures have the numbers of the limbs and, while `help` is True, lines of keys.

    keys: Keys and what they do, line by line.
    """

    def __init__(self, keys: Sequence[tuple[str, str]], **arguments: Any):
        self.keys, self.help = keys, True
        super().__init__(render_mode="rgb_array_list", **arguments)

    def limb_directions(self) -> NDArray[np.float64]:
        """Directions of the limbs in the world, from the hub to the tip [rad], shape (n_limbs,)."""
        x, y = (self._tips() - self.simulator.hub_position()[0]).T
        return np.arctan2(y, x)

    def _tips(self) -> NDArray[np.float64]:
        robot = self.scene.robot
        return self.simulator.positions[0, limb_nodes(robot.n_limbs, robot.nodes_per_limb)[:, -1]]

    def picture(self) -> NDArray[np.uint8]:
        """Picture of now, with the numbers and the help."""
        self.last_picture = self._annotated(super().picture())
        return self.last_picture

    def _annotated(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        pygame = import_pygame()
        pygame.font.init()
        font = pygame.font.Font(pygame.font.get_default_font(), TEXT)
        height, width, _ = picture.shape
        surface = pygame.image.frombuffer(picture.tobytes(), (width, height), "RGB").copy()

        def write(text: str, x: float, y: float, colour: Colour = INK) -> None:
            surface.blit(font.render(text, True, colour, WATER), (round(x), round(y)))

        for limb, (x, y) in self._numbers():
            write(str(limb + 1), x - 5, y - TEXT / 2, FAINT_INK)
        for number, (keys, meaning) in enumerate(self.keys if self.help else ()):
            write(keys, CORNER[0], CORNER[1] + LINE * number)
            write(meaning, CORNER[0] + COLUMN, CORNER[1] + LINE * number, FAINT_INK)
        return np.frombuffer(pygame.image.tobytes(surface, "RGB"), np.uint8).reshape(picture.shape)

    def _numbers(self) -> list[tuple[int, NDArray[np.float64]]]:
        """Limbs that are not heated, whose names the picture lacks, and the places of their numbers [px]."""
        tips, angles = self.pictures.renderer_of(0).camera.to_pixels(self._tips()), self.limb_directions()
        outward = 18.0 * np.stack([np.cos(angles), -np.sin(angles)], axis=1)
        return [(limb, tips[limb] + outward[limb]) for limb in np.flatnonzero(self.frame().command == 0.0).tolist()]
