"""Sample efficiency of a training: strokes and seconds until the policy rounds the pentagon in 170 s."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path

from agents.training.options import faults_of
from seastar_gym.evaluation.report.page import ResultsTable
from seastar_gym.evaluation.swim import Swim
from seastar_gym.files import read_json, write_json
from seastar_gym.scene.checks import require_number

TARGET = 170.0
"""Simulated time round the pentagon [s]; the greedy agent takes 199 to 201 s, trained policies 152 to 155 s."""
FILE = "efficiency.json"


@dataclass(frozen=True)
class Efficiency:
    """What a training took until now, and what it took to reach the target; None where it has not.

    seconds: Time in the simulator, the policy and the updates [s], of all sessions; saving and measuring do not count.
    """

    strokes: int = 0
    seconds: float = 0.0
    strokes_to_target: int | None = None
    seconds_to_target: float | None = None

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if value is not None or not name.endswith("_to_target"):
                require_number(name, value, "1", zero_allowed=True)

    def after(self, strokes: int, seconds: float, pentagon: Swim) -> "Efficiency":
        """Efficiency after so many strokes and seconds, with a policy that swims the pentagon so."""
        now = replace(self, strokes=strokes, seconds=seconds)
        if self.strokes_to_target is not None or not pentagon.finished or pentagon.time[-1] > TARGET:
            return now
        return replace(now, strokes_to_target=strokes, seconds_to_target=seconds)

    @property
    def progress(self) -> str:
        """How long the training was until now."""
        return f"{self.strokes} decisions, {self.seconds:.0f} s of training"

    def __str__(self) -> str:
        if self.strokes_to_target is None:
            return f"The pentagon was not rounded in {TARGET:g} s yet."
        return (
            f"The pentagon took {TARGET:g} s or less after {self.strokes_to_target} strokes and "
            f"{self.seconds_to_target:.1f} s of training."
        )

    def table(self) -> ResultsTable:
        """Figures as a table of the report."""
        columns = {
            "strokes": "strokes trained",
            "seconds": "training [s]",
            "strokes_to_target": f"strokes until the pentagon takes {TARGET:g} s",
            "seconds_to_target": f"training until the pentagon takes {TARGET:g} s [s]",
        }
        return ResultsTable("Sample efficiency", columns, [asdict(self)])


def write(found: Efficiency, folder: Path) -> None:
    """Write the figures into the folder of a run."""
    write_json(folder / FILE, asdict(found))


def read(folder: Path) -> Efficiency:
    """Figures in the folder of a run; those of a beginning where there are none."""
    file = folder / FILE
    if not file.exists():
        return Efficiency()
    with faults_of(file):
        return Efficiency(**read_json(file))
