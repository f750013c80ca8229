"""Gaits in time: what limbs that need not be heated together swim, and what speed costs in heat.

Measures named gaits, every gait of a second from rest (40,890 classes), and gaits that evolve where wires may be heated
before they are cold. Writes `gaits.json`, three pictures and the tables in Markdown.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from seastar_gym.envs.commands import command_table
from seastar_gym.scene import Numerics, Scene, SmaPulse, Water
from seastar_gym.scene.actuators.thermal import ThermalSma
from seastar_gym.scene.actuators.wires import SmaWires
from studies.frame import Study
from studies.gaits import pictures
from studies.gaits.crossing import crossings
from studies.gaits.enumeration import SLOTS, distinct_codes, gaits_of
from studies.gaits.evolution import evolve
from studies.gaits.named import BEHIND, FORWARD, GAITS, SLOT, lagged
from studies.gaits.pages import TABLES, parts
from studies.gaits.periodic import Swimming, events_of, joined, measure, timed
from studies.learning.bound import all_directions, distinct_gaits, mixed_speed
from studies.speed.terms import SILICONE

Floats = NDArray[np.float64]
Table = dict[str, Any]

MM = 1000.0
WIRES = SmaWires()
THERMAL = ThermalSma(largest_temperature=75.0)
"""Wires that a heated one does not pass: about where all of it is austenite."""
COARSE = 1.0 / SLOTS
"""Slot of the searched gaits [s]."""
LAGS = np.arange(0.0, 1.0, SLOT)
"""Lags of the scan [s]."""
DIRECTIONS = np.radians(np.arange(0.0, 37.0, 6.0))
FINE, FINE_PRICES = 0.05, (0.0, 0.5)
"""Slot of finer evolved gaits [s], and their prices of heat [mm/J]."""
PRICES = (0.0, 0.5, 1.0, 1.5, 2.0)
"""Prices of heat of the evolved gaits [mm/J]."""
CLOUD = 4000
"""Enumerated gaits that the picture of the front shows."""


@dataclass(frozen=True)
class Plan:
    """Size of the study.

    codes: Every how manyth class of gaits is simulated. generations, population: Those of the evolution.
    finest: Preset that ranks the gaits once more.
    """

    codes: int = 1
    generations: int = 60
    population: int = 96
    finest: str = "reference"


QUICK = Plan(codes=400, generations=2, population=8, finest="balanced")


def scene_with(actuator: Any = WIRES, fidelity: str = "fast") -> Scene:
    """The chapter's robot with this actuator at a preset."""
    return replace(Scene.preset(fidelity), actuator=actuator)  # type: ignore[arg-type]


def row(swimming: Swimming, k: int = 0) -> Table:
    """Numbers of one gait, in the units of the tables."""
    return {
        "mm_per_s": round(MM * float(swimming.speed[k]), 3),
        "direction_deg": round(float(np.degrees(np.arctan2(*swimming.velocity[k, ::-1]))), 1),
        "turn_deg_per_s": round(float(np.degrees(swimming.turn[k])), 3),
        "pulses_per_s": round(float(swimming.pulses[k]), 2),
        "joules_per_m": round(float(swimming.energy_per_metre[k]), 1),
    }


def measured(scene: Scene, gait: Floats, slot: float) -> Table:
    """Numbers of one gait in a scene."""
    return row(measure(scene, gait[None], slot))


def named_gaits(plan: Plan) -> dict[str, Table]:
    """Every named gait at two presets."""
    return {
        name: {
            "what": each.what,
            "fast": measured(scene_with(), each.gait, SLOT),
            plan.finest: measured(scene_with(fidelity=plan.finest), each.gait, SLOT),
        }
        for name, each in GAITS.items()
    }


def lag_scan() -> Table:
    """Speed of the lagged pairs [mm/s] over the lag [s]."""
    speeds = {
        "full pulses": measure(scene_with(), np.array([lagged(lag) for lag in LAGS]), SLOT),
        "pulses of 0.06 s": measure(scene_with(), np.array([lagged(lag, level=0.6) for lag in LAGS]), SLOT),
        "thermal wires": measure(scene_with(THERMAL), np.array([lagged(lag) for lag in LAGS]), SLOT),
    }
    return {"lag_s": LAGS.tolist(), **{name: (MM * each.velocity[:, 0]).tolist() for name, each in speeds.items()}}


def from_rest(plan: Plan, progress: Callable[[int], Any]) -> tuple[Table, Swimming]:
    """The best of all gaits of a second from rest, and how all of them swim."""
    gaits, scene = gaits_of(distinct_codes()[:: plan.codes]), scene_with()
    parts = []
    for part in np.array_split(gaits, max(1, len(gaits) // 1024)):
        parts.append(measure(scene, part, COARSE))
        progress(len(part))
    swimming = joined(parts)
    straight = np.flatnonzero(swimming.is_straight)
    fastest = straight[np.argsort(-swimming.speed[straight])][:5]
    turning = np.argsort(-np.abs(swimming.turn))[:3]

    def best(chosen: NDArray[np.intp]) -> list[Table]:
        again = measure(scene_with(fidelity=plan.finest), gaits[chosen], COARSE)
        return [
            {"gait": events_of(gaits[k], COARSE), "fast": row(swimming, k), plan.finest: row(again, place)}
            for place, k in enumerate(chosen)
        ]

    return {"classes": len(gaits), "fastest": best(fastest), "turning": best(turning)}, swimming


def synchronous(plan: Plan) -> Swimming:
    """How the gaits of two of the chapter's strokes swim."""
    gaits = command_table("joint", 5)[distinct_gaits(2, "joint")[:: max(1, plan.codes // 20)]]
    return measure(scene_with(SmaPulse()), gaits, 1.0)


def by_direction(velocities: dict[str, Floats]) -> Table:
    """Speeds [mm/s] along DIRECTIONS by straight gaits swum in turn, from velocities [m/s] by kind of gait."""
    return {name: (MM * mixed_speed(all_directions(each), DIRECTIONS)).tolist() for name, each in velocities.items()}


def velocity_of(each: Table) -> Floats:
    """Velocity [m/s] of a row of numbers, shape (1, 2)."""
    angle = np.radians(each["direction_deg"])
    return each["mm_per_s"] / MM * np.array([[np.cos(angle), np.sin(angle)]])


class Wanted(NamedTuple):
    """A gait that is to evolve.

    towards: 1 along limb 1, -1 away from it. price: Of heat [mm/J]. slot: [s]. strokes: Slots of the chapter's strokes,
    one a second, that evolve instead; 0 for a second of slots.
    """

    actuator: Any
    name: str
    towards: float = 1.0
    price: float = 0.0
    slot: float = COARSE
    strokes: int = 0

    @property
    def start(self) -> Floats:
        """Lagged pairs, or the pairs of the fastest strokes in turn, shape (n_slots, 5)."""
        if self.strokes:
            return timed({float(k): (BEHIND, FORWARD)[k % 2] for k in range(self.strokes)}, float(self.strokes), 1.0)
        events = {0.0: "2+,5-", 0.6: "3+,4-"} if self.towards > 0.0 else {0.0: "2-,5+", 0.4: "3-,4+"}
        return timed(events, 1.0, self.slot)

    def generations(self, plan: Plan) -> int:
        """Generations of its evolution: twice as many where it has twice as many slots."""
        return plan.generations if self.strokes else round(plan.generations * COARSE / self.slot)


WANTED = [
    *(Wanted(WIRES, "wires", price=price) for price in PRICES),
    *(Wanted(WIRES, "wires", price=price, slot=FINE) for price in FINE_PRICES),
    Wanted(WIRES, "wires", -1.0), Wanted(THERMAL, "thermal"), Wanted(THERMAL, "thermal", -1.0),
    *(Wanted(SmaPulse(), "the chapter's strokes", slot=1.0, strokes=strokes) for strokes in (2, 4)),
]  # fmt: skip


def evolved(wanted: Wanted, plan: Plan, progress: Callable[[int], Any] | None = None) -> Table:
    """A gait that evolves, and how it swims."""
    actuator, name, towards, price, slot, strokes = wanted
    gait, tried = evolve(
        scene_with(actuator), wanted.start, slot, towards, price, wanted.generations(plan), plan.population,
        progress=progress,
    )  # fmt: skip
    return {
        "actuator": name, "towards": "along limb 1" if towards > 0.0 else "away from limb 1", "slot_s": slot,
        "strokes": strokes, "price_mm_per_joule": price, "tried": tried, "gait": events_of(gait, slot),
        "pulses": gait.tolist(),
        "fast": measured(scene_with(actuator), gait, slot),
        plan.finest: measured(scene_with(actuator, plan.finest), gait, slot),
    }  # fmt: skip


def main_gaits(reheated: Floats) -> dict[str, tuple[Floats, float]]:
    """The gaits whose robustness is looked at, with their slots [s]."""
    return {**{name: (GAITS[name].gait, SLOT) for name in ("synchronous", "lag 0.6", "thrifty")},
            "re-heated": (reheated, COARSE)}  # fmt: skip


def by_numerics(gaits: dict[str, tuple[Floats, float]]) -> dict[str, Table]:
    """Speeds [mm/s] of the main gaits at other resolutions, schemes and steps."""
    plain = scene_with()
    fine = replace(plain, robot=replace(plain.robot, nodes_per_limb=37))
    changed = {
        "7 nodes, midpoint 5 ms: `fast`": plain,
        "7 nodes, midpoint 1 ms": replace(plain, numerics=Numerics("implicit-midpoint", 1e-3, 1e-6)),
        "7 nodes, SDIRK3 10 ms": replace(plain, numerics=Numerics("sdirk3", 1e-2, 1e-6)),
        "7 nodes, Euler 1 ms": replace(plain, numerics=Numerics("implicit-euler", 1e-3, 1e-6)),
        "37 nodes, midpoint 5 ms": fine,
        "37 nodes, midpoint 1 ms": replace(fine, numerics=Numerics("implicit-midpoint", 1e-3, 1e-7)),
        "37 nodes, SDIRK3 10 ms": replace(fine, numerics=Numerics("sdirk3", 1e-2, 1e-7)),
        "`chapter`: 10 nodes, Euler 3 ms": scene_with(fidelity="chapter"),
    }
    return {what: {name: measured(scene, *gait) for name, gait in gaits.items()} for what, scene in changed.items()}


def by_crossing(gaits: dict[str, tuple[Floats, float]]) -> dict[str, int]:
    """Percent of snapshots, with 37 nodes per limb, in which limbs cross, of the main gaits."""
    plain = scene_with()
    fine = replace(plain, robot=replace(plain.robot, nodes_per_limb=37))
    return {name: crossings(fine, *gait) for name, gait in gaits.items()}


def robustness(gaits: dict[str, tuple[Floats, float]]) -> dict[str, Table]:
    """Speeds [mm/s] of the main gaits by robots and waters other than the chapter's, at `fast`."""
    plain = scene_with()
    changed = {
        "plain": plain,
        "silicone": replace(plain, robot=replace(plain.robot, relaxation_time=SILICONE)),
        "drag x 0.7": replace(plain, fluid=Water(drag_coefficient=0.7)),
        "drag x 1.4": replace(plain, fluid=Water(drag_coefficient=1.4)),
        "E x 0.5": replace(plain, robot=replace(plain.robot, youngs_modulus=0.5e6)),
        "E x 2": replace(plain, robot=replace(plain.robot, youngs_modulus=2e6)),
        "limb 2 at half": replace(plain, limb_strengths=(1.0, 0.5, 1.0, 1.0, 1.0)),
        "cooling in 1.3 s": replace(plain, actuator=SmaWires(cooling_time=1.3, period=1.0)),
        "cooling in 0.7 s": replace(plain, actuator=SmaWires(cooling_time=0.7, period=1.0)),
        "heating in 0.15 s": replace(plain, actuator=SmaWires(heating_time=0.15, period=1.0)),
    }
    return {what: {name: measured(scene, *gait) for name, gait in gaits.items()} for what, scene in changed.items()}


def front(swimming: Swimming, more: list[Table]) -> Table:
    """Speed over heat: a sample of the straight gaits, and those that no other beats in both."""
    straight = swimming.of(swimming.is_straight & (swimming.speed > 1e-4))
    points = np.stack([straight.energy_per_metre, MM * straight.speed], axis=1)
    extra = np.array([[each["joules_per_m"], each["mm_per_s"]] for each in more]).reshape(-1, 2)
    everything = np.concatenate([points, extra])
    kept = np.random.default_rng(0).permutation(len(points))[:CLOUD]
    return {"cloud": np.round(points[kept], 2).tolist(), "front": np.round(pareto(everything), 2).tolist()}


def pareto(points: Floats) -> Floats:
    """Points (cost, gain), shape (n, 2), that no other beats in both, by rising cost."""
    in_order = points[np.lexsort((-points[:, 1], points[:, 0]))]
    before = np.maximum.accumulate(np.append(-np.inf, in_order[:-1, 1]))
    return in_order[in_order[:, 1] > before]


def study(plan: Plan) -> Table:
    """Run the study; returns its results as plain data."""
    n_gaits = len(range(0, 40890, plan.codes)) + sum(each.generations(plan) for each in WANTED) * plan.population
    with tqdm(total=n_gaits, unit="gait", unit_scale=True) as bar:
        rest, swimming = from_rest(plan, bar.update)
        evolution = [evolved(each, plan, bar.update) for each in WANTED]
    named = named_gaits(plan)
    pair = measure(scene_with(SmaPulse()), np.array([[[0, 1, 0, 0, -1.0]]]), 1.0)
    strokes = synchronous(plan)
    main = main_gaits(np.array(evolution[0]["pulses"]))
    wires = [each["fast"] for each in evolution if each["actuator"] == "wires"]
    return {
        "robot": "the chapter's, continuum's discretisation",
        "finest": plan.finest,
        "named": named,
        "one pair, synchronous": row(pair),
        "thermal wires": {
            name: {each: measured(scene_with(THERMAL, each), GAITS[name].gait, SLOT) for each in ("fast", plan.finest)}
            for name in ("synchronous", "lag 0.6", "thrifty")
        },
        "two strokes, synchronous, turning most": row(strokes, int(np.argmax(np.abs(strokes.turn)))),
        "lag": lag_scan(),
        "from rest": rest,
        "evolved": evolution,
        "directions_deg": np.degrees(DIRECTIONS).tolist(),
        "mm_per_s_by_direction": by_direction(
            {
                "synchronous": strokes.velocity[strokes.is_straight],
                "from rest": swimming.velocity[swimming.is_straight],
                "re-heated": np.concatenate([velocity_of(each) for each in wires]),
            }
        ),
        "robustness": robustness(main),
        "numerics": by_numerics(main),
        "percent of snapshots with crossing limbs": by_crossing(main),
        "front": front(swimming, wires + [each["fast"] for each in named.values()]),
    }


@dataclass(frozen=True)
class Options:
    """Gaits in time."""

    quick: bool = False
    """Simulate fewer gaits."""
    out: Path = Path("runs/gaits")
    """Folder of the files, or the file of the numbers."""


STUDY = Study(
    "gaits",
    lambda options, results: results.update(study(QUICK if options.quick else Plan())),
    Options,
    "gaits.json",
    pictures={f"gaits_{name}.png": getattr(pictures, f"draw_{name}") for name in ("directions", "front", "lag")},
    tables={f"gaits {name}": lambda results, name=name: parts(results)[name] for name in TABLES},  # type: ignore[misc]
    packages=("cma",),
)
