"""Plants: lines, guard, the environment around them and its logs; whatever is wrong is said, and wires are stopped."""

import io
import json
import os
import socket
import subprocess
import sys
import threading
import time
import tty
from collections import deque
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from faults import LIES, Tank
from refusals import assert_refused
from seastar_gym import Body, DomainRandomization, Scene, Seastar, Sight, Simulator, SmaPulse, SmaWires, Uniform, files
from seastar_gym.cli import drive as drive_command
from seastar_gym.cli.main import main
from seastar_gym.controllers.open_loop import OpenLoopPolicy
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.identify import Measurement, trajectory
from seastar_gym.identify.measurement import ORIENTATION
from seastar_gym.plant import lines
from seastar_gym.plant.guard import FIRST, Guard, Limits
from seastar_gym.plant.lines import LineError, LinePlant, Server, open_serial, opened, sealed
from seastar_gym.plant.plant import PlantError, SimulatedPlant
from seastar_gym.plant.swim import PlantSwim

SCENE = Scene(actuator=SmaWires(heating_time=0.08, period=0.5)).at("fast")
OPTIONS = {"scene": SCENE, "decision_period": 0.5, "actions": "pairs"}


def simulated(sight=None, heading=0.0, scene=SCENE, **arguments):
    simulator = Simulator(scene)
    simulator.reset(heading=heading)
    return SimulatedPlant(simulator, sight, **arguments)


def guarded(**limits):
    plant = Tank()
    guard = Guard(plant, Limits(**limits))
    guard.begin()
    plant.stop = Mock(wraps=plant.stop)
    return plant, guard


# The guard


WRONG = {
    "clock has jumped": (-0.05, {}), "clock has gone back": (0.0, {"lag": 0.2}), "s old": (1.0, {"lag": 0.6}),
    "No new picture for 0.12 s": (0.13, {"seen_until": 0.5}),
    "in the future": (0.0, {"lag": -1.0}),
}  # fmt: skip
"""Time that passes [s], and what becomes of a plant, by words of the sentence."""


@pytest.mark.parametrize("words", WRONG)
def test_whatever_is_wrong_stops_all_wires_for_good(words):
    plant, guard = guarded()
    guard.wait_until(0.5)
    guard.heat([1, 0, 0, -1, 0], 0.1)
    seconds, attributes = WRONG[words]
    plant.time += seconds
    vars(plant).update(attributes)
    with pytest.raises(PlantError, match=words) as refused:
        guard.look()
    assert plant.stop.called and str(refused.value).endswith(".")
    plant.lag, plant.seen_until = 0.0, np.inf
    plant.time += 1.0
    with pytest.raises(PlantError, match=words):
        guard.heat([1, 0, 0, 0, 0], 0.01)
    assert plant.heated.intervals.keys() == {(0, 0), (3, 1)}
    guard.begin()
    guard.wait_until(plant.time + 0.2)
    guard.heat([1, 0, 0, 0, 0], 0.01)


def test_pulses_are_as_short_and_wires_rest_as_long_as_they_have_to():
    plant, guard = guarded(longest_pulse=0.1, shortest_rest=0.2)
    guard.heat([1, -1, 0, 0, 0], 0.1)
    assert guard.resting().tolist() == [[True, True], [True, True], *[[False, False]] * 3]
    guard.wait_until(0.25)
    guard.heat([-1, 1, 0, 0, 0], 0.1)  # the other wires
    with pytest.raises(PlantError, match=r"within 0\.2 s of its last pulse"):
        guard.heat([1, 0, 0, 0, 0], 0.05)
    guard.begin()
    guard.wait_until(1.0)
    assert not guard.resting().any()
    for seconds in (0.11, -0.1, np.nan):
        with pytest.raises(PlantError, match=r"from 0 to 0\.1 s"):
            guard.heat([1, 0, 0, 0, 0], seconds)
        guard.begin()
    assert [len(each) for each in plant.heated.intervals.values()] == [1] * 4 and plant.stop.call_count >= 4


# Lines


def test_a_line_comes_back_and_a_garbled_one_does_not():
    line = sealed("heat 80 +0-00")
    assert opened(line.rstrip(b"\n")) == ["heat", "80", "+0-00"]
    for k in range(len(line) - 1):
        with pytest.raises(LineError, match="garbled"):
            opened((line[:k] + bytes([line[k] ^ 1]) + line[k + 1 :]).rstrip(b"\n"))


@pytest.fixture
def ends():
    pair = socket.socketpair()
    yield pair
    for end in pair:
        end.close()


def joined(ends, plant):
    """A `LinePlant`, and the `Server` of a plant at the other end."""
    server, over = Server(plant, ends[0]), threading.Event()

    def turn():
        while not over.is_set():
            server.turn()

    thread = threading.Thread(target=turn)
    thread.start()
    try:
        return LinePlant(ends[1], clock=plant.now), server
    finally:
        over.set()
        thread.join()


def test_a_plant_is_heated_and_seen_over_a_line(ends):
    plant = simulated(Sight(delay=0.05, sees=1), heading=0.3)
    far, server = joined(ends, plant)
    far.heat([1, 0, -1, 0, 0], 0.08)
    server.turn(), plant.wait(0.02)
    assert plant.heated().tolist() == [[True, False], [False, False], [False, True], [False, False], [False, False]]
    far.sight(), far.stop(), server.turn()
    assert not plant.heated().any()
    for _ in range(20):
        far.sight(), plant.wait(0.01), server.turn()
    ours, theirs = plant.sight(), far.sight()
    assert theirs.captured_at == pytest.approx(ours.captured_at, abs=1e-5) and ours.captured_at > plant.now() - 0.2
    np.testing.assert_allclose(theirs.pose, ours.pose, atol=1e-6)
    np.testing.assert_allclose(theirs.markers, ours.markers, atol=1e-6)
    assert theirs.markers.shape == (5, 1, 2)


@pytest.mark.parametrize("bad", LIES)
def test_bad_lines_stop_the_wires(bad, ends):
    plant = simulated()
    far, server = joined(ends, plant)
    far.heat([1, 1, 1, 1, 1], 0.08)
    server.turn(), plant.wait(0.01)
    assert plant.heated()[:, 0].all()
    ends[1].send(bad)
    server.turn()
    assert not plant.heated().any()
    with pytest.raises(PlantError, match=r"The plant has (stopped: .*\.|restarted.*)$") as refused:
        far.sight()
    assert "\n" not in str(refused.value)
    for _ in range(20):
        server.turn(), plant.wait(0.01)
    ends[1].send(b"\n" + sealed("beat"))  # which ends what has no end
    server.turn(), server.turn()
    far.heat([0, 1, 0, 0, 0], 0.08)
    server.turn(), plant.wait(0.01)
    assert plant.heated().any() == (b"hello 2" not in bad)


@pytest.mark.parametrize("error", [OSError(5, "gone"), KeyboardInterrupt(), MemoryError(), SystemExit()])
def test_whatever_ends_a_plant_s_loop_stops_the_wires(error, ends, monkeypatch):
    plant = simulated()
    plant.heat([1, 0, 0, 0, 0], 0.08), plant.wait(0.01)

    def fail():
        raise error

    monkeypatch.setattr(plant, "sight", fail)
    with pytest.raises(type(error)):
        lines.serve(plant, ends[0])
    assert not plant.heated().any()
    monkeypatch.undo()
    plant.heat([0, 1, 0, 0, 0], 0.08)
    lines.serve(plant, ends[0], seconds=0.02)
    assert not plant.heated().any()


def test_a_board_that_restarts_when_its_port_is_opened_is_greeted(ends):
    """It says hello when it begins to hear; what earlier drives have left on the line is dropped."""
    ends[0].send(b"garbled" + sealed("hello 1 7") + sealed("error It burns.") + sealed("hello 1 5"))
    plant, over, servers = simulated(Sight(delay=0.05)), threading.Event(), []

    def board():
        time.sleep(0.5)
        ends[0].recv(65536)
        servers.append(Server(plant, ends[0]))
        while not over.is_set():
            servers[0].turn(), time.sleep(0.002)

    thread = threading.Thread(target=board)
    thread.start()
    far = LinePlant(ends[1], clock=plant.now)
    over.set(), thread.join()
    assert far.n_limbs == 5
    far.heat([1, 0, 0, 0, 0], 0.08), servers[0].turn(), plant.wait(0.01)
    assert plant.heated().any()
    far.sight()
    restarted = Server(plant, ends[0])
    with pytest.raises(PlantError, match="has restarted"):
        far.sight()
    restarted.turn()
    assert not plant.heated().any()


def test_a_garbled_line_from_the_wires_ends_a_drive_before_anything_is_seen(ends):
    far, _ = joined(ends, simulated(Sight(delay=5.0)))
    assert far.sight() is None
    ends[0].send(b"garbled\n")
    with pytest.raises(PlantError, match="garbled"):
        far.sight()


def test_pulses_that_waited_for_a_busy_plant_are_not_heated(ends):
    plant = simulated()
    far, server = joined(ends, plant)
    far.heat([1, 0, 0, 0, 0], 0.08), plant.wait(0.3), server.turn()
    assert not plant.heated().any()
    with pytest.raises(PlantError, match="The plant was busy"):
        far.sight()


def test_a_line_that_is_closed_or_full_is_said_to_be(ends, monkeypatch):
    monkeypatch.setattr(lines, "HELLO", 0.05)
    with pytest.raises(PlantError, match=r"did not answer within 0\.05 s"):
        LinePlant(ends[1])
    far, _ = joined(ends, simulated())
    with pytest.raises(PlantError, match="takes no more lines"):
        deque((far.sight() for _ in range(100_000)), maxlen=0)
    ends[0].close()
    with pytest.raises(PlantError, match="is broken: "):
        far.sight()
    far.stop()


# The environment


@pytest.mark.parametrize("sees", ["pose", 3])
def test_a_simulated_plant_is_seen_as_the_environment_sees_its_robot(sees):
    """To what pieces of 5 ms differ from decisions of 0.5 s, see `Simulator.advance`."""
    sight = Sight(delay=0.05, sees=sees)
    ours = PlantSwim(simulated(sight), Limits(shortest_rest=0.0), sight=sight, **OPTIONS)
    theirs = SeastarSwimEnv(sight=sight, **OPTIONS)
    first, _ = theirs.reset(seed=0)
    found, _ = ours.reset(seed=0)
    assert ours.observation_space == theirs.observation_space
    np.testing.assert_allclose(found, first, atol=1e-6)
    for action in (3, 8, 3, 12, 0):
        np.testing.assert_allclose(ours.step(action)[0], theirs.step(action)[0], atol=0.02)


def test_a_plant_that_stops_truncates_the_episode_and_one_that_sees_no_robot_begins_none():
    plant = simulated()
    env = PlantSwim(plant, **OPTIONS)
    env.reset(), env.step(3)
    see = plant.sight()
    plant.sight = lambda: see
    *_, terminated, truncated, info = env.step(8)
    assert truncated and not terminated and "No new picture" in info["plant_message"] and not plant.heated().any()
    with pytest.raises(Exception, match="reset"):
        env.step(0)
    plant = Tank()
    plant.sight, plant.stop = lambda: None, Mock()
    with pytest.raises(PlantError, match=f"not seen the robot for {FIRST:g} s"):
        PlantSwim(plant, **OPTIONS).reset()
    assert plant.stop.call_count >= 2


@pytest.mark.parametrize("where", ["sight", "hub_position", "action"])
def test_whatever_ends_a_step_stops_the_wires(where, monkeypatch):
    plant = simulated()
    env = PlantSwim(plant, **OPTIONS)
    env.reset()
    plant.heat([1, 0, 0, 0, 0], 0.08), plant.wait(0.01)
    assert plant.heated().any()

    def fail(*_):
        raise KeyboardInterrupt

    if where != "action":
        monkeypatch.setattr(plant if where == "sight" else env.unwrapped.simulator, where, fail)
    with pytest.raises((KeyboardInterrupt, ValueError)):
        env.step(99 if where == "action" else 3)
    monkeypatch.undo()
    assert not plant.heated().any()
    env.close()


def test_late_decisions_make_the_clock_wait_and_wires_that_have_to_rest_are_masked():
    plant = simulated(Sight(rate=100.0))
    env = PlantSwim(plant, Limits(oldest=2.0), **OPTIONS)
    _, info = env.reset()
    plant.wait(0.3)
    info = env.step(3)[4]
    assert info["late"] == pytest.approx(0.3) and info["time"] == 0.5 and plant.now() == pytest.approx(0.8, abs=0.06)
    assert env.step(8)[4]["late"] == pytest.approx(0.0, abs=1e-9)
    assert info["sight_age"] == pytest.approx(0.0, abs=0.011)
    env = PlantSwim(simulated(), Limits(shortest_rest=0.6), **OPTIONS)
    env.reset()
    heated = [env.step(action)[4] for action in (3, 3, 3)]
    assert [info["masked_limbs"] for info in heated] == [0, 2, 0]
    assert [info["limbs_heated"] for info in heated] == [2, 0, 2]
    assert not any(info["plant_message"] for info in heated)


WITH_BODY = replace(SCENE, robot=Seastar(n_limbs=3, nodes_per_limb=7, body=Body(radius=0.02)))


@pytest.mark.parametrize("late", [0.0, 0.03])
@pytest.mark.parametrize("scene, nodes", [(SCENE, (0, 6, 12, 18, 24, 30)), (WITH_BODY, (0, 6, 12, 18, ORIENTATION))])
def test_logs_tell_when_commands_were_given_and_what_the_robot_did(scene, nodes, late, tmp_path):
    """The robot begins turned; its logs are in the frame in which it lay."""
    sight = Sight(rate=50.0, delay=0.1, sees=1)
    plant = simulated(sight, heading=1.0, scene=scene)
    env = PlantSwim(plant, logs=tmp_path, sight=sight, **OPTIONS | {"scene": scene})
    env.reset()
    for action in (3, 1, 4, 0, 5):
        plant.wait(late)
        env.step(action)
    env.close()
    with pytest.raises(Exception, match="reset"):  # or wires were heated again
        env.step(1)
    measured = Measurement.from_csv(tmp_path / "tracking.csv", tmp_path / "commands.csv")
    assert measured.nodes == nodes and measured.commands.shape == (5, scene.robot.n_limbs)
    assert measured.command_times == pytest.approx((0.5 + late) * np.arange(5), abs=1e-5)
    expected = trajectory(measured.time, nodes, measured.commands, scene, measured.command_times)
    assert np.abs(measured.positions - expected).max() < 1e-3 < np.abs(expected - expected[0]).max() / 10
    poses = np.loadtxt(tmp_path / "poses.csv", delimiter=",", skiprows=1)
    assert poses[0, 4] == pytest.approx(1.0, abs=1e-6) and (poses[:, 0] < poses[:, 1]).all() and len(poses) > 100


def test_a_plant_with_logs_is_reset_again(tmp_path):
    """At times whose sums are rounded: a reset waits, and has to end."""
    env = PlantSwim(simulated(), logs=tmp_path, **OPTIONS)
    for _ in range(4):
        env.reset()
        env.step(3)
    env.close()


@pytest.mark.parametrize("name", ["tracking", "commands", "poses"])
def test_a_full_disk_stops_the_wires_in_a_sentence(name, tmp_path, monkeypatch):
    def full(path, mode, **_):
        return io.FileIO("/dev/full" if name in path else path, mode)

    monkeypatch.setattr(files, "FileIO", full)
    plant = simulated()
    env = PlantSwim(plant, logs=tmp_path, **OPTIONS)
    try:
        env.reset()
        told = env.step(3)[4]["plant_message"]
        env.close()
    except PlantError as stopped:
        told = str(stopped)
    assert told.endswith("no space left on device.") and not plant.heated().any()


def swim(**arguments):
    return PlantSwim(**{"plant": Tank(), **OPTIONS, **arguments})


def simulation(**arguments):
    return SimulatedPlant(**{"simulator": Simulator(SCENE), **arguments})


DENSITIES = DomainRandomization({"robot.density": Uniform(1.0, 2.0)})
FOUR = Scene(Seastar(n_limbs=4), actuator=SmaWires(heating_time=0.08))


@pytest.mark.parametrize(
    ("make", "arguments", "words"),
    [(swim, {"sight": Sight(sees="nodes")}, "sees no nodes"), (swim, {"action_delay": 0.5}, "late"),
     (swim, {"randomization": DENSITIES}, "randomization"), (swim, {"random_heading": True}, "at random"),
     (swim, {"limits": Limits(0.05)}, "the guard allows 0.05 s"), (swim, {"scene": FOUR}, "has 5 limbs"),
     (simulation, {"sight": Sight(sees="nodes")}, "sees no nodes"),
     (simulation, {"simulator": Simulator(SCENE, 2)}, "one robot with wires"),
     (simulation, {"simulator": Simulator(Scene(actuator=SmaPulse()))}, "one robot with wires")],
)  # fmt: skip
def test_what_no_plant_can_be_or_do_is_refused(make, arguments, words):
    with assert_refused(words):
        make(**arguments)


# `seastar drive`: it plans, asks, drives and reports, and says in a sentence why it does not.


ROLES = Path(__file__).with_name("roles.py")
SHORT = ["--path", "line", "--seconds", "2", "--no-window"]


def drive(tmp_path, *more):
    return main(["drive", "straight", *SHORT, "--out", str(tmp_path / "out"), *more])


@pytest.fixture
def tank():
    """A simulated plant in another process, and the name of its serial line."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, ROLES, "tank", str(ours)]
    with subprocess.Popen(command, pass_fds=[ours], env=environment, text=True, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == "ready\n"
        yield process, f"serial:{os.ttyname(theirs)}"
        process.kill()
    for file in (ours, theirs):
        os.close(file)


def test_a_simulated_drive_is_planned_driven_and_reported(tmp_path, capsys):
    assert drive(tmp_path, "--yes", "--sight", "1") == 0
    said, out = capsys.readouterr().out, tmp_path / "out"
    assert "Plan: 0 of 1 waypoints, 0.4 s of heat in 4 decisions" in said and "The guard had nothing to stop." in said
    names = {"plan.png", "driven.png", "report.md", "tracking.csv", "commands.csv", "poses.csv"}
    assert {file.name for file in out.iterdir()} == names
    measured = Measurement.from_csv(out / "tracking.csv", out / "commands.csv")
    assert measured.commands.tolist() == [[0, 1, 0, 0, -1], [0] * 5] * 2 and len(measured.nodes) == 6


@pytest.mark.parametrize("plant", ["sim", "serial:/dev/null"])
def test_logs_are_never_written_over(plant, tmp_path, capsys):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "poses.csv").write_text("somebody's")
    assert drive(tmp_path, "--yes", "--plant", plant) == 2
    assert capsys.readouterr().err == f"{tmp_path / 'out'} has the logs of another drive: give another --out.\n"


def test_a_file_for_a_folder_and_another_number_of_limbs_are_refused_before_the_plan(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("seastar_gym.cli.drive.plan", lambda *_: pytest.fail("planned"))
    (scene := tmp_path / "three.json").write_text(json.dumps(Scene(Seastar(n_limbs=3)).to_dict()))
    assert drive(tmp_path, "--yes", "--plant", f"sim:{scene}") == 2
    assert "has 3 limbs, the scene's robot 5." in capsys.readouterr().err
    (tmp_path / "out").write_text("somebody's")
    assert drive(tmp_path, "--yes") == 2 and "is no folder" in capsys.readouterr().err


@pytest.mark.parametrize(
    "plant, code, words",
    [
        (["sim", "--tracker", "serial:/dev/null"], 2, "has a tracker of its own"),
        (["serial:/dev/ttyNone"], 1, "cannot be opened"),
        (["serial:a board"], 2, "The plant has 5 limbs, the scene's robot 3."),
    ],
)
def test_a_plant_that_cannot_be_driven_is_told_before_the_plan(plant, code, words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    files.write_json(Path("three.json"), Scene(Seastar(3), actuator=SmaWires()).to_dict())
    if "serial:a board" in plant:
        monkeypatch.setattr(drive_command, "open_serial", nullcontext)
        monkeypatch.setattr(drive_command, "LinePlant", lambda _: Tank())
    assert drive(tmp_path, "--yes", "--scene", "three.json", "--plant", *plant) == code
    said = capsys.readouterr()
    assert words in said.err and said.err.endswith(".\n") and not said.out and not (tmp_path / "out").exists()


def test_an_interrupted_drive_stops_the_wires(tmp_path, monkeypatch):
    plants, make = [], drive_command.simulated

    def simulated(*arguments, **options):
        plants.append(make(*arguments, **options))
        return plants[-1]

    def predict(policy, observation, *_, **__):
        if not plants[-1].heated().any() and len(plants) > 2:
            plants[-1].heat([1, 0, 0, 0, 0], 0.1)
            raise KeyboardInterrupt
        return np.zeros(5, int), None

    monkeypatch.setattr(drive_command, "simulated", simulated)
    monkeypatch.setattr(OpenLoopPolicy, "predict", predict)
    with pytest.raises(KeyboardInterrupt):
        drive(tmp_path, "--yes")
    assert not plants[-1].heated().any()


@pytest.mark.parametrize(
    "more, answer, is_heated",
    [
        ([], "n\n", False),
        ([], "", False),
        ([], "yes\n", True),
        (["--dry", "--plant", "serial:/dev/null"], "y\n", False),
        (["--dry", "--decision-period", "1"], "", False),
    ],
)
def test_it_asks_before_wires_are_heated(more, answer, is_heated, tmp_path, capsys, monkeypatch):
    """A dry run heats nothing, and asks nothing."""
    monkeypatch.setattr(sys, "stdin", io.StringIO(answer))
    assert drive(tmp_path, *more) == 0
    assert ("Heat the wires? [y/N] " in (said := capsys.readouterr().out)) == (not more)
    assert said.endswith("No wire was heated.\n") != is_heated
    assert (tmp_path / "out" / "tracking.csv").exists() == is_heated and (tmp_path / "out" / "plan.png").exists()


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="There are no pseudo-terminals here.")
def test_a_drive_over_a_serial_line(tank, tmp_path, capsys, monkeypatch):
    """The second one finds what is left of the first one on the line, and its plant dies. A busy machine has time."""
    process, line = tank
    monkeypatch.setattr(drive_command, "Limits", partial(Limits, patience=1.0, oldest=2.0))
    assert drive(tmp_path / "first", "--yes", "--plant", line) == 0
    assert "The guard had nothing to stop." in capsys.readouterr().out
    commands = tmp_path / "second" / "out" / "commands.csv"

    def kill():
        while not commands.exists() or len(commands.read_text().splitlines()) < 4:
            time.sleep(0.05)
        process.kill()

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    assert drive(tmp_path / "second", "--yes", "--plant", line, "--seconds", "20") == 1
    killer.join(10.0)
    assert "No new picture for 1 s: all wires are stopped." in capsys.readouterr().out


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="There are no pseudo-terminals here.")
def test_a_port_has_one_driver_and_one_that_is_full_is_no_hang():
    ours, theirs = os.openpty()
    with open_serial(os.ttyname(theirs)) as port:
        with pytest.raises(PlantError, match=r"is driven by another program\.$"):
            open_serial(os.ttyname(theirs))
        talk = lines.Lines(port)
        with pytest.raises(PlantError, match="takes no more lines"):
            deque((talk.send("beat") for _ in range(100_000)), maxlen=0)
    os.close(ours), os.close(theirs)
