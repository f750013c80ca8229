"""Processes of a tank: who heats the wires, who tracks, who drives. Their files are given as numbers of descriptors."""

import os
import sys
import time
from io import FileIO

import numpy as np

from seastar_gym import Scene, Sight, Simulator, SmaWires
from seastar_gym.plant.guard import Limits
from seastar_gym.plant.lines import LinePlant, Server, serve
from seastar_gym.plant.plant import SimulatedPlant
from seastar_gym.plant.swim import PlantSwim

PULSE = 2.0
"""Length of pulses that go on for long unless somebody stops them [s]."""
LIMITS = Limits(PULSE, 0.0, hottest=1000.0)
SCENE = Scene(actuator=SmaWires(heating_time=PULSE)).at("fast")


def heat(wires: str, tracker: str, hot: str) -> None:
    """Simulated wires; writes the times at which they are heated [s] into a file."""
    Simulator(SCENE).advance(0.5)  # which compiles
    plant = SimulatedPlant(Simulator(SCENE), Sight(delay=0.05), paced=True)
    server = Server(plant, FileIO(int(wires), "r+"), FileIO(int(tracker), "w"), LIMITS)
    with open(hot, "w", encoding="utf-8") as times:
        print("ready", flush=True)
        while True:
            server.turn()
            if plant.heated().any():
                print(f"{time.monotonic():.4f}", file=times, flush=True)
            time.sleep(0.004)


def track(read: str, write: str) -> None:
    """A tracker that passes on what it sees."""
    while data := os.read(int(read), 4096):
        os.write(int(write), data)


def drive(wires: str, tracker: str) -> None:
    """Heat all limbs whenever they have rested, as long as the plant goes."""
    Simulator(SCENE).advance(0.5)
    plant = LinePlant(FileIO(int(wires), "r+"), FileIO(int(tracker), "r"))
    env = PlantSwim(plant, LIMITS, scene=SCENE, decision_period=0.5, actions="continuous")
    env.reset()
    while True:
        *_, truncated, info = env.step(np.ones(5, np.float32))
        print(info["plant_message"] or "swims", flush=True)
        if truncated:
            return


def tank(line: str) -> None:
    """A simulated plant with its tracker on one line, whose wires are those of the chapter."""
    scene = Scene(actuator=SmaWires()).at("fast")
    Simulator(scene).advance(0.5)
    print("ready", flush=True)
    serve(SimulatedPlant(Simulator(scene), Sight(delay=0.05), paced=True), FileIO(int(line), "r+"))


if __name__ == "__main__":
    {"heat": heat, "track": track, "drive": drive, "tank": tank}[sys.argv[1]](*sys.argv[2:])
