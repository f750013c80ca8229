"""Tables of the study of gaits, in Markdown."""

from typing import Any

Table = dict[str, Any]


def lines_of(head: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown; all columns but the first are numbers."""
    rule = ["---", *["---:"] * (len(head) - 1)]
    return "\n".join(f"| {' | '.join(line)} |" for line in [head, rule, *rows]) + "\n"


def numbers(fast: Table, finest: Table) -> list[str]:
    """Speeds at both presets, turn, pulses and heat of a gait."""
    return [
        f"{fast['mm_per_s']:.2f}", f"{finest['mm_per_s']:.2f}", f"{round(fast['turn_deg_per_s'], 1) + 0.0:.1f}",
        f"{fast['pulses_per_s']:.1f}", f"{fast['joules_per_m']:.0f}",
    ]  # fmt: skip


def what_evolved(each: Table) -> str:
    """Name of an evolved gait: its actuator, direction, price of heat and slots."""
    if each["strokes"]:
        return f"{each['actuator']}, amplitudes of {each['strokes']} in turn"
    slots = "" if each["slot_s"] == 0.1 else f", slots of {each['slot_s']:g} s"
    return f"{each['actuator']}, {each['towards']}, {each['price_mm_per_joule']:g} mm/J{slots}"


TABLES = ("named", "thermal", "fastest", "turning", "evolved", "directions", "robustness", "numerics")
"""Names of the tables."""


def parts(results: Table) -> dict[str, str]:
    """All tables of the study, by name."""
    finest = results["finest"]
    head = ["speed [mm/s], `fast`", f"speed, `{finest}`", "turn [deg/s]", "pulses per second", "energy [J/m]"]
    named = [[each["what"], *numbers(each["fast"], each[finest])] for each in results["named"].values()]
    rest = [[each["gait"], *numbers(each["fast"], each[finest])] for each in results["from rest"]["fastest"]]
    turning = [[each["gait"], *numbers(each["fast"], each[finest])] for each in results["from rest"]["turning"]]
    evolved = [
        [
            what_evolved(each),
            *numbers(each["fast"], each[finest]),
        ]
        for each in results["evolved"]
    ]
    robust = results["robustness"]
    columns = list(next(iter(robust.values())))
    robust_rows = [[what, *(f"{each[name]['mm_per_s']:.2f}" for name in columns)] for what, each in robust.items()]
    of_numerics = [
        [what, *(f"{each[name]['mm_per_s']:.2f}" for name in columns)] for what, each in results["numerics"].items()
    ]
    crossed = results["percent of snapshots with crossing limbs"]
    of_numerics.append(["crossing limbs in 100 snapshots, 37 nodes", *(str(crossed[name]) for name in columns)])
    directions = [
        [name, *(f"{speed:.2f}" for speed in speeds)] for name, speeds in results["mm_per_s_by_direction"].items()
    ]
    thermal = [
        [results["named"][name]["what"], *numbers(each["fast"], each[finest])]
        for name, each in results["thermal wires"].items()
    ]
    return {
        "named": lines_of(["gait", *head], named),
        "thermal": lines_of(["gait", *head], thermal),
        "fastest": lines_of(["gait", *head], rest),
        "turning": lines_of(["gait", *head], turning),
        "evolved": lines_of(["actuator, direction, price of heat", *head], evolved),
        "directions": lines_of(["gaits", *(f"{angle:.0f}" for angle in results["directions_deg"])], directions),
        "robustness": lines_of(["", *columns], robust_rows),
        "numerics": lines_of(["", *columns], of_numerics),
    }
