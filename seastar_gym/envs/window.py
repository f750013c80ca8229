"""Window in which finished pictures are shown; without a display they are drawn off screen."""

from __future__ import annotations

import os
import warnings
from typing import TYPE_CHECKING

from seastar_gym.envs.canvas import import_pygame

if TYPE_CHECKING:
    import pygame


class Window:
    """Window of pygame that opens with the first picture and stays closed once the user closed it.

    Where there is no display, pictures go nowhere, and a warning says so.
    """

    def __init__(self) -> None:
        self._pygame = import_pygame()
        self._surface: pygame.Surface | None = None
        self._clock = self._pygame.time.Clock()
        self._closed_by_user = False
        self.is_seen = True
        """Whether there is a display. It is not known before the first picture."""

    def is_wanted(self, size: tuple[int, int]) -> bool:
        """Whether there is a window to show a picture of this width and height [px] in; opens it where needed."""
        if self._closed_by_user:
            return False
        if not self.is_seen:
            return True
        if self._surface is None or self._surface is not self._pygame.display.get_surface():
            self._surface = self._open(size)
        if self.is_seen and any(event.type == self._pygame.QUIT for event in self._pygame.event.get()):
            self.close()
            self._closed_by_user = True
        return not self._closed_by_user

    def show(self, picture: pygame.Surface, fps: float | None) -> None:
        """Show a picture, and wait until 1/fps seconds have passed since the one before, where fps is given."""
        if self._surface is None:
            return
        self._surface.blit(picture, (0, 0))
        self._pygame.display.flip()
        if fps is not None:
            self._clock.tick(fps)

    def close(self) -> None:
        """Close the window, if one is open; may be called again."""
        if self._surface is not None:
            self._surface = None
            self._pygame.display.quit()

    def _open(self, size: tuple[int, int]) -> pygame.Surface | None:
        try:
            self._pygame.display.init()
            self._pygame.display.set_caption("SeastarSwim")
            self._require_display()
            surface: pygame.Surface = self._pygame.display.set_mode(size)
        except self._pygame.error as no_display:
            self.is_seen = False
            warnings.warn(
                f"No window can be opened here ({no_display}), so nobody sees the pictures: render with "
                'render_mode="rgb_array" instead, or write a film, seastar swim --film swim.mp4.',
                stacklevel=2,
            )
            return None
        return surface

    def _require_display(self) -> None:
        """Without a display, SDL draws where nobody looks; a pygame.error says so, unless that was asked for."""
        if self._pygame.display.get_driver() == "offscreen" and not os.environ.get("SDL_VIDEODRIVER"):
            self._pygame.display.quit()
            raise self._pygame.error("there is no display")
