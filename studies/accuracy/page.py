"""Tables of the presets' errors for README.md and docs/, from the tables that come with the package.

Every error is one that `info` has: `path_error` or `gait_error` is the bound, `typical_error` or `typical_gait_error`
the median beside it.
"""

from dataclasses import replace
from typing import get_args

from seastar_gym.accuracy import Setting, chapters_certificate, timed_certificate
from seastar_gym.scene import Scene, SmaWires
from seastar_gym.scene.numerics import Fidelity
from studies.frame import rounded
from studies.pages import markdown

IN_README: tuple[Fidelity, ...] = ("fast", "balanced", "reference")
PERIODS = (0.5, 0.2, 0.1)
"""Times between decisions [s] that were measured."""
PERIOD = 0.2
"""Time between decisions [s] of the column of commands in time."""
PURPOSES: dict[Fidelity, str] = {
    "fast": "searching, training", "balanced": "doing anything else; it is the default",
    "accurate": "measuring a difference of a few per cent", "reference": "checking one of the above",
    "chapter": "repeating the chapter's figures",
}  # fmt: skip


def percent(error: float) -> str:
    """Error in per cent, of two digits."""
    return f"{rounded(100 * error, 2):g} %"


def pair(bound: float, typical: float) -> str:
    """A bound and the median below it."""
    return f"{percent(bound)} ({percent(typical)})"


def preset(name: Fidelity) -> Setting:
    """Errors of a preset in strokes."""
    known = chapters_certificate().of(Scene.preset(name))
    assert known is not None
    return known


def in_time(name: Fidelity, period: float = PERIOD) -> Setting:
    """Errors of a preset where commands come in time. period: Time between decisions [s]."""
    certificate = timed_certificate(period)
    assert certificate is not None
    known = certificate.of(replace(Scene.preset(name), actuator=SmaWires()))
    assert known is not None
    return known


def cells(known: Setting) -> list[str]:
    """Errors of random and of repeated commands."""
    return [pair(known.errors[name], known.typical[name]) for name in ("random", "repeated")]


ERRORS = ["random, every 1 s", "repeated, every 1 s", f"random, every {PERIOD:g} s", f"repeated, every {PERIOD:g} s"]


def errors() -> str:
    """Largest and, in brackets, typical errors and speeds of some presets."""
    rows = [
        [f"`{name}`", *cells(preset(name)), *cells(in_time(name)), f"{preset(name).speed:,.0f}"] for name in IN_README
    ]
    return markdown(["fidelity", *ERRORS, "× real time"], rows)


def choosing() -> str:
    """Largest and, in brackets, typical errors and speeds of all presets, by what they are for."""
    rows = [
        [why, f'`fidelity="{name}"`', *cells(preset(name)), *cells(in_time(name)), f"{preset(name).speed:,.0f}"]
        for name, why in PURPOSES.items()
    ]
    return markdown(["you are", "take", *ERRORS, "× real time"], rows, (0, 1))


def presets() -> str:
    """Numerics of all presets, and their errors by part and by commands."""
    rows = []
    for name in get_args(Fidelity):
        row = preset(name)
        nodes = f"{row.nodes_per_limb}{'' if row.discretisation == 'continuum' else ', chapter' + chr(39) + 's'}"
        scheme = row.scheme.replace("implicit-midpoint", "midpoint").replace("implicit-euler", "implicit Euler")
        numbers = [
            percent(row.space_error), percent(row.time_error),
            f"**{percent(row.errors['random'])}** ({percent(row.typical['random'])})",
            pair(row.errors["repeated"], row.typical["repeated"]),
        ]  # fmt: skip
        rows.append([
            f"`{name}`", nodes, f"{scheme}, {1e3 * row.step:g} ms", f"{row.newton_tolerance:.0e}",
            *(each.replace(" %", "") for each in numbers),
        ])  # fmt: skip
    head = ["fidelity", "N", "scheme and step", "tolerance", "space [%]", "time [%]", "path error [%]", "gaits [%]"]
    return markdown(head, rows)


def timed(periods: tuple[float, ...] = PERIODS) -> str:
    """Errors of all presets for times between decisions [s], of random commands and then of repeated seconds."""
    rows = []
    for name in get_args(Fidelity):
        found = [cells(in_time(name, period)) for period in periods]
        rows.append([f"`{name}`", *(each[k].replace(" %", "") for k in (0, 1) for each in found)])
    columns = [f"{what}, {period:g} s [%]" for what in ("random", "repeated") for period in periods]
    return markdown(["fidelity", *columns], rows)
