"""What drives of drawn faults have in common: lines that lie, and what wires were heated for and how hot they got."""

import math
from collections import defaultdict
from itertools import pairwise

import numpy as np

from seastar_gym import ThermalSma
from seastar_gym.plant.guard import Limits
from seastar_gym.plant.lines import sealed
from seastar_gym.plant.plant import Sighting

COLD_WITHIN = 0.2
"""Time after whatever goes wrong by which wires are cold [s]."""
LIES = [
    *map(sealed, ["heat 121 +0000", "heat 9999 ++++++", "heat -5 +0000", "heat +5 +0000", "heat 1_0 +0000",
                  "heat nan +0000", "heat 1e1 +0000", "heat 0x10 +0000", "heat 80.0 +0000", "heat  80 +0000",
                  "heat 80 +0000 ", "heat 80 +000", "heat 80 +000x", "heat 80", "heat", "", "*", "hello 2", "hello 1 5",
                  f"heat {'9' * 30} +0000", f"heat {'0' * 30}80 +0000", "fly", "sight 1 0 0 0"]),
    sealed("heat " + "9" * 400 + " +0000"), "heat ٣ +0000*00\n".encode(), b"\xff\n", b"\n", b"\r\n", b"*\n",
    b"beat*-1\n", b"heat 80 +0000\n", b"heat 80 +0000* 4\n", b"heat 80 +0000*0x\n", sealed("heat 80 +0000").lower(),
    sealed("heat 80 +0000").replace(b"\n", b"\0\n"), b"x" * 63 + sealed("heat 80 +0000"),
    b"x" * 5000 + sealed("heat 80 +0000"),
]  # fmt: skip
"""Lines that a plant does not follow, and stops for."""


class Heated:
    """Times for which wires were heated [s], by wire; what `Heat` says is not asked."""

    def __init__(self):
        self.intervals = defaultdict(list)

    def on(self, wire, time, until=math.inf):
        self.off(wire, time)
        self.intervals[wire].append([time, until])

    def off(self, wire, time):
        for interval in self.intervals[wire][-1:]:
            interval[1] = min(interval[1], time)

    def last(self):
        """When the last wire was turned off."""
        return max((each[-1][1] for each in self.intervals.values() if each), default=-math.inf)

    def hottest(self):
        """Highest temperature of all wires, which are cold at first [deg C]."""
        sma, highest = ThermalSma(), 0.0
        for intervals in self.intervals.values():
            rise, cools_since = 0.0, 0.0
            for begin, end in intervals:
                rise *= math.exp((cools_since - begin) / sma.time_constant)
                rise = sma.steady_rise + (rise - sma.steady_rise) * math.exp((begin - end) / sma.time_constant)
                highest, cools_since = max(highest, rise), end
        return sma.water_temperature + highest

    def together(self):
        """Time for which two wires of a limb were heated at once [s]."""
        found = 0.0
        for limb in {limb for limb, _ in self.intervals}:
            both = sorted(self.intervals.get((limb, 0), []) + self.intervals.get((limb, 1), []))
            found += sum(max(before[1] - after[0], 0.0) for before, after in pairwise(both))
        return found

    def broken(self, ended):
        """What of a plant's promises was not kept, in a drive that ended at a time [s]."""
        late, together, hottest = self.last() - ended, self.together(), self.hottest()
        kept = {
            f"hot for {late:.3f} s": late <= COLD_WITHIN,
            f"{hottest:.1f} deg C": hottest <= Limits().hottest,
            f"both for {together:.3f} s": together == 0.0,
        }
        return [words for words, is_so in kept.items() if not is_so]


class Tank:
    """Wires that are heated as told, and a tracker; the clock may be shifted, and the times of pictures lag behind."""

    n_limbs = 5

    def __init__(self):
        self.time, self.shift, self.lag, self.seen_until, self.fails = 0.0, 0.0, 0.0, np.inf, None
        self.heated = Heated()

    def now(self):
        return self.time + self.shift

    def wait(self, seconds):
        self.time += seconds

    def sight(self):
        if self.fails is not None:
            raise self.fails
        taken_at = np.floor(min(self.time, self.seen_until) * 50.0) / 50.0
        return Sighting(float(taken_at) - self.lag, self.now(), (1e-9 * float(taken_at), 0.0, 0.0))

    def heat(self, limbs, seconds):
        for limb, sign in enumerate(limbs):
            if sign:
                self.heated.on((limb, int(sign < 0)), self.time, self.time + seconds)

    def stop(self):
        for wire in self.heated.intervals:
            self.heated.off(wire, self.time)


def greedy(rng):
    """Lines of a driver that holds the heat as hard as it can, and the time after each [ms]."""
    lines = [("".join(rng.choice(list("+-0"), 5, p=[0.6, 0.2, 0.2])), int(rng.integers(1, 260))) for _ in range(8)]
    (signs, _), kind, found = lines[0], rng.integers(3), []
    if kind == 0:  # the same wires whenever they have rested
        lines = [(signs, 120 + int(rng.integers(2, 100)))] * 8
    elif kind == 1:  # both wires of a limb
        lines = [(signs, int(rng.integers(20, 130))), (signs.translate({43: 45, 45: 43}), 150)] * 4
    for signs, gap in lines:
        beats = [(sealed("beat"), 40)] * (gap // 40)
        found += [(sealed(f"heat {rng.choice([120, 100, 120, 60])} {signs}"), gap % 40), *beats]
    return found


def garbage(rng):
    """Bytes at random, and what is no line."""
    return bytes([rng.integers(0, 256, 200), np.zeros(200, int), np.full(200, 10)][rng.integers(3)].tolist())
