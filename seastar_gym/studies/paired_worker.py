"""One build of the package at work, for `seastar_gym.studies.paired`: whichever build Python finds swims.

Prints what the build is, then takes a setting's number per line and answers with the processor time [s] of a stroke.
It uses nothing but the simulator, so that it runs in older builds, too.
"""

import hashlib
import itertools
import json
import re
import sys
import time
import warnings
from collections import Counter
from typing import Any

import numpy as np

import seastar_gym
from seastar_gym.command import run_command
from seastar_gym.der.stroke import advance
from seastar_gym.scene import Numerics, Scene
from seastar_gym.simulator import Simulator

ROBOTS = 64
PLACES = 4
"""Copies of everything at other addresses, taken in turn: where numbers lie in memory alone makes some per cent."""
ARITHMETIC = re.compile(r"v(add|sub|mul|div|fm|fnm|sqrt|cmp|min|max|rndscale)|f(add|sub|mul|div|sqrt|cm|ml|nm)")
"""Instructions that compute with floating-point numbers, of x86 and of ARM."""


def swimmers(numerics: Numerics) -> list[tuple[Simulator, Any]]:
    """Robots in the middle of random swims."""
    commands = np.random.default_rng(0).integers(-1, 2, (4, ROBOTS, 5)).astype(float)
    made = []
    for _ in range(PLACES):
        simulator = Simulator(Scene(numerics=numerics), ROBOTS, threads=1)
        for command in commands:
            simulator.stroke(command)
        made.append((simulator, simulator.get_state()))
    return made


def stroke(simulator: Simulator, state: Any, command: Any) -> float:
    """Processor time of a stroke from a state [s]."""
    simulator.set_state(state)
    start = time.thread_time()
    simulator.stroke(command)
    return time.thread_time() - start


def arithmetic() -> dict[str, dict[str, int]]:
    """Instructions that compute with floating-point numbers, by kernel; nothing of code that was not compiled here."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assembly = next(iter(advance.overloads.values())).library.get_asm_str()
    counts: dict[str, Counter[str]] = {}
    kernel = ""
    for line in assembly.splitlines():
        label, word = re.match(r"(_Z\w+):", line), line.split()[:1]
        if label is not None:
            found = re.match(r".*?seastar_gym3der\d+([a-z_]+?)\d+([a-z_]+)B", label[1])
            kernel = ".".join(found.groups()) if found is not None else label[1]
        elif line.startswith("\t") and word and ARITHMETIC.match(word[0]):
            counts.setdefault(kernel, Counter())[re.sub(r"\d+", "", word[0])] += 1
    return {kernel: dict(counted) for kernel, counted in counts.items()}


def main() -> None:
    settings = [Numerics(**keywords) for keywords in json.loads(sys.argv[1])]
    command = np.random.default_rng(1).integers(-1, 2, (ROBOTS, 5)).astype(float)
    batches, bits = [swimmers(numerics) for numerics in settings], []
    for batch in batches:
        stroke(*batch[0], command)
        simulator = batch[0][0]
        bits.append(hashlib.sha256(simulator.q.tobytes() + simulator.v.tobytes()).hexdigest())
    print(json.dumps({"package": seastar_gym.__file__, "bits": bits, "arithmetic": arithmetic()}), flush=True)
    turns = [itertools.cycle(batch) for batch in batches]
    for line in sys.stdin:
        print(stroke(*next(turns[int(line)]), command), flush=True)


if __name__ == "__main__":
    run_command(main)
