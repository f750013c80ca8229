"""A tracker is believed where a robot can be: a picture that cannot be is dropped, and more of them stop the wires."""

import math
from contextlib import nullcontext

import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym import Scene, Sight, Simulator, SmaWires
from seastar_gym.plant.guard import Guard, Limits
from seastar_gym.plant.plant import PlantError, Sighting, SimulatedPlant
from seastar_gym.plant.swim import PlantSwim

SCENE = Scene(actuator=SmaWires(heating_time=0.08, period=0.5)).at("fast")
ANGLES = 2.0 * np.pi * np.arange(5) / 5
ONSET = 1.0
"""When a tracker begins to lie [s]."""


class Seen:
    """Plant whose robot swims at 5 cm/s, or lies still, with a marker on every tip and a tracker that may lie."""

    n_limbs = 5

    def __init__(self, lie=lambda k, seen: seen, rate=30.0, noise=1e-3, speed=0.05, when=lambda k: True, onset=ONSET):
        self.time, self.hot, self.lie, self.rate, self.noise, self.speed = 0.0, False, lie, rate, noise, speed
        self.when, self.onset = when, onset

    def now(self):
        return self.time

    def wait(self, seconds):
        self.time += seconds

    def sight(self):
        k = math.floor(self.time * self.rate + 1e-9)
        x, y, turn = np.random.default_rng(k).normal(scale=self.noise, size=3) + [self.speed * k / self.rate, 0.2, 0.1]
        places = 0.1 * np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=-1)[:, None] + [x, y]
        seen = Sighting(k / self.rate, self.time, (float(x), float(y), float(turn)), places)
        since = k - math.ceil(self.onset * self.rate)
        return self.lie(since + 1, seen) if since >= 0 and self.when(since) else seen

    def heat(self, limbs, seconds):
        self.hot = True

    def stop(self):
        self.hot = False


def posed(change):
    """Lie about the pose, x, y, heading of picture k since the lie began; its markers move along."""

    def lie(k, seen):
        pose = change(k, *seen.pose)
        with np.errstate(invalid="ignore"):
            return seen._replace(pose=pose, markers=seen.markers + (np.array(pose[:2]) - seen.pose[:2]))

    return lie


def marked(value):
    """Lie about one marker."""

    def lie(k, seen):
        seen.markers[2, 0] = value
        return seen

    return lie


LIES = {
    "a kilometre away": posed(lambda k, x, y, turn: (x + 1000.0, y, turn)),
    "another corner": posed(lambda k, x, y, turn: (x - 0.3, y + 0.3, turn)),
    "1e300": posed(lambda k, x, y, turn: (1e300, -1e300, turn)),
    "1e308": posed(lambda k, x, y, turn: (x, y, 1e308)),
    "NaN": posed(lambda k, x, y, turn: (x, y, math.nan)),
    "infinite": posed(lambda k, x, y, turn: (math.inf, y, turn)),
    "turned by pi": posed(lambda k, x, y, turn: (x, y, turn + math.pi)),
    "turned by pi with every picture": posed(lambda k, x, y, turn: (x, y, turn + math.pi * (k % 2))),
    "another limb is the first": posed(lambda k, x, y, turn: (x, y, turn + 0.4 * math.pi)),
    "millimetres": posed(lambda k, x, y, turn: (1e3 * x, 1e3 * y, turn)),
    "degrees": posed(lambda k, x, y, turn: (x, y, math.degrees(turn))),
    "degrees, turned by a full turn": posed(lambda k, x, y, turn: (x, y, math.degrees(turn) + 360.0)),
    "leaving at 1.5 m/s": posed(lambda k, x, y, turn: (x, y + 1.5 * (k - 1) / 30.0, turn)),
    "spinning": posed(lambda k, x, y, turn: (x, y, (turn + 20.0 * (k - 1) / 30.0) % math.tau)),
    "x and y are swapped": posed(lambda k, x, y, turn: (y, x - 0.5, turn)),
    "a marker that is NaN": marked((math.nan, 0.0)),
    "a marker that is infinite": marked((0.0, -math.inf)),
    "a marker far from the hub": marked((0.5, 0.5)),
    "a marker at 1e300": marked((1e300, 0.0)),
    "pictures too soon": lambda k, seen: seen._replace(captured_at=ONSET - 1.0 / 30.0 + 1e-5 * k),
}


def guarded(*arguments, **options):
    plant = Seen(*arguments, **options)
    guard = Guard(plant, Limits(hottest=1e4))
    guard.begin()
    return plant, guard


@pytest.mark.parametrize("lie", LIES)
def test_wires_are_cold_within_200_ms_of_a_lie(lie):
    plant, guard = guarded(LIES[lie])
    guard.wait_until(ONSET - 0.05)
    assert guard.plausibility.n_dropped == 0
    guard.heat([1, 0, 0, 0, -1], 0.08)
    with pytest.raises(PlantError, match=r"cannot be: .*\.$"):
        guard.wait_until(ONSET + 0.5)
    assert not plant.hot and plant.time < ONSET + 0.2
    assert np.abs(np.array(guard.newest.pose) - [0.05, 0.2, 0.1]).max() < 0.1


GRADUAL = {"leaving at 1.5 m/s", "spinning", "pictures too soon"}


@pytest.mark.parametrize("lie", [lie for lie in LIES if lie not in GRADUAL])
def test_a_single_lie_is_dropped_and_counted(lie):
    plant, guard = guarded(LIES[lie], when=lambda k: k in (0, 40))
    while plant.time < ONSET + 3.0:
        newest = guard.look()
        assert abs(newest.pose[0] - 0.05 * newest.captured_at) < 0.01 and newest.pose[2] < 0.2
        plant.wait(0.01)
    assert guard.plausibility.n_dropped == 2
    guard.begin()
    assert guard.plausibility.n_dropped == 0


@pytest.mark.parametrize("rate, every, stops", [(10, 2, True), (30, 2, True), (120, 2, True), (30, 4, True),
                                                (120, 4, True), (30, 20, False), (10, 20, False)])  # fmt: skip
def test_too_large_a_share_of_lies_stops(rate, every, stops):
    plant, guard = guarded(LIES["a kilometre away"], rate=rate, when=lambda k: k % every == 0)
    try:
        guard.wait_until(ONSET + 6.0)
    except PlantError:
        assert plant.time < ONSET + 40 / rate + 0.2
    assert (guard.held_back is not None) == stops


def frozen(k, seen):
    """The same picture again and again."""
    return Seen().sight()._replace(captured_at=seen.captured_at, seen_at=seen.seen_at)


def held(k, seen):
    """A hub that somebody holds, of a robot with a limb that moves."""
    return frozen(k, seen)._replace(markers=seen.markers)


@pytest.mark.parametrize(
    "lie, limbs, stops",
    [(frozen, [1, 0, 0, 0, -1], True), (frozen, [1, 1, 1, 1, 1], True), (frozen, [0, -1, 0, 0, 0], True),
     (frozen, [0, 0, 0, 0, 0], False), (held, [1, 0, 0, 0, -1], False)],
)  # fmt: skip
def test_a_tracker_that_is_frozen_is_told_once_wires_were_heated(lie, limbs, stops):
    plant, guard = guarded(lie, onset=0.0, speed=0.0)
    guard.wait_until(3.0)
    with pytest.raises(PlantError, match=r"No picture has changed for 0\.5 s") if stops else nullcontext():
        for k in range(10):
            guard.wait_until(3.0 + 0.3 * k)
            guard.heat(limbs, 0.1)
    assert plant.time < (3.6 if 0 in limbs else 4.6) and not plant.hot if stops else plant.time > 5.5


@pytest.mark.parametrize(
    "lie, words",
    [("a kilometre away", "millimetres"), ("1e300", "millimetres"), ("degrees, turned by a full turn", "degrees"),
     ("NaN", "not finite"), ("a marker far from the hub", "a marker")],
)  # fmt: skip
def test_a_first_picture_that_cannot_be_is_not_believed(lie, words):
    plant = Seen(LIES[lie], onset=0.0)
    with pytest.raises(PlantError, match=words):
        Guard(plant, Limits()).begin()
    plant = Seen(LIES[lie], onset=0.0, when=lambda k: k < 2)
    assert abs(Guard(plant, Limits()).begin().pose[0]) < 0.1


def test_a_robot_stays_in_its_tank_and_in_its_reach():
    for limits, words in ((Limits(tank=((-1, -1), (0.1, 1))), "outside the tank"), (Limits(reach=0.1), "its reach")):
        plant = Seen(speed=0.1, noise=0.0)
        guard = Guard(plant, limits)
        guard.begin()
        with pytest.raises(PlantError, match=words):
            guard.wait_until(3.0)
        assert 1.0 < plant.time < 1.2
    for tank in (3, ((0, 0),), ((0, 0), (1, 0)), ((0, 0), (1, np.nan)), ((0, 0), "ab")):
        with assert_refused("Limits.tank must be corners"):
            Limits(tank=tank)


@pytest.mark.parametrize("lie", ["a kilometre away", "1e300", "NaN"])
def test_an_episode_is_truncated_by_a_lie_and_never_ended_by_it(lie):
    """Every waypoint is where the tracker says that the robot is."""
    tank = SimulatedPlant(Simulator(SCENE))
    see, onset = tank.sight, tank.now() + 0.7
    tank.sight = lambda: (
        LIES[lie](1, seen._replace(markers=np.zeros((5, 1, 2)))) if (seen := see()).captured_at > onset else seen
    )
    env = PlantSwim(tank, scene=SCENE, decision_period=0.5, actions="pairs", path=[[1000.0, 0.0]], waypoint_radius=10.0)
    env.reset(), env.step(3)
    observation, reward, terminated, truncated, info = env.step(8)
    assert truncated and not terminated and "cannot be" in info["plant_message"] and info["dropped_pictures"] == 3
    assert np.isfinite(observation).all() and abs(reward) < 2.0 and not tank.heated().any()


def rounded(plant):
    """Plant whose tracker rounds to millimetres and milliradians."""
    see = plant.sight
    plant.sight = lambda: (seen := see())._replace(pose=tuple(round(number, 3) for number in seen.pose))
    return plant


@pytest.mark.parametrize("seed", range(4))
def test_nothing_of_a_drive_that_can_be_is_dropped(seed):
    rng = np.random.default_rng(seed)
    noise, turn_noise = (0.0, 0.0) if seed % 4 == 0 else rng.uniform(0.0, [2e-3, 0.03])
    rate, delay, period = float(rng.choice([30, 60, 120])), rng.uniform(0.0, 0.15), float(rng.choice([0.2, 0.5]))
    bad = {"jitter": 0.01, "dropout": 0.01, "noise": noise, "turn_noise": turn_noise}
    sight = Sight(rate, delay, **bad, sees=("pose", 1)[seed % 2])
    simulator = Simulator(SCENE)
    simulator.reset(heading=rng.uniform(-3.1, 3.1))
    tank = SimulatedPlant(simulator, sight, seed)
    actions = str(rng.choice(["pairs", "continuous"]))
    env = PlantSwim(rounded(tank) if seed % 4 == 0 else tank, scene=SCENE, decision_period=period, actions=actions,
                    sight=Sight(sees=sight.sees))  # fmt: skip
    env.reset(seed=seed), env.action_space.seed(seed)
    for _ in range(8):
        info = env.step(env.action_space.sample())[4]
        assert not info["plant_message"] and info["dropped_pictures"] == 0
