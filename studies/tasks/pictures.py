"""Pictures of the tasks: a held-out episode of each in strokes, as far as a controller swims it in some time.

python -m studies.tasks.pictures
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from seastar_gym.evaluation.tasks import make_batch
from studies.frame import Results, Study
from studies.tasks.controllers import make_controller
from studies.tasks.episodes import rollout_of

SHOWN: dict[str, tuple[str, str, int] | tuple[str, str, int, int]] = {
    "miswired": ("SeastarMiswired-v0", "adaptive", 120),
    "fail-blind": ("SeastarFailBlind-v0", "adaptive", 150),
    "obst-trap": ("SeastarObstTrap-v0", "adaptive", 150, 7),
    "prey": ("SeastarPrey-v0", "adaptive", 60),
    "station": ("SeastarStation-v0", "adaptive", 60),
    "prizes": ("SeastarPrizes-v0", "informed", 110),
    "sim-to-real": ("SeastarSwimSimToReal-v0", "informed", 200),
}
"""Id, controller, number of strokes and, if not the first, of the episode, by name of the challenge."""


def picture(id: str, controller: str, strokes: int, instance: int = 0) -> NDArray[np.uint8]:
    """Picture of a held-out episode of a task after so many strokes, or before its end."""
    batch: Any = make_batch(id, 1, 1, split="test", fidelity="fast", render_mode="rgb_array")
    rollout_of(batch, make_controller(controller, batch), seeds=0, options={"instance": instance}, until=strokes)
    (drawn,) = batch.render()
    batch.close()
    return np.asarray(drawn)


def run(results: Results) -> None:
    """Draw the pictures."""
    for name, shown in SHOWN.items():
        Image.fromarray(picture(*shown)).save(results.folder / f"{name}.png", optimize=True)
        print(name, flush=True)


STUDY = Study("tasks.pictures", run, out=Path("docs/tasks"))
