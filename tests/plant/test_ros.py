"""The plant over ROS 2 of examples/ drives a simulated robot; in the place of ROS stand a few lines."""

import math
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from seastar_gym import Scene, Sight, Simulator, SmaWires
from seastar_gym.controllers import scripted
from seastar_gym.plant.guard import Limits
from seastar_gym.plant.plant import SimulatedPlant
from seastar_gym.plant.swim import PlantSwim

EXAMPLE = Path(__file__).parents[2] / "examples" / "ros_plant.py"
SCENE = Scene(actuator=SmaWires(heating_time=0.08, period=0.5)).at("fast")


class Ros:
    """A simulated robot, its tracker and its wires behind two topics, in simulated time."""

    def __init__(self, lost_after: float = math.inf):
        self.plant, self.said, self.lost_after = SimulatedPlant(Simulator(SCENE), Sight(delay=0.05)), [], lost_after
        self.see, self.last = None, -1.0

    def spin_once(self, node, timeout_sec):
        if timeout_sec > 0.0:
            self.plant.wait(0.005)
        seen = self.plant.sight()
        if seen.captured_at > self.last and self.plant.now() < self.lost_after:
            (x, y, turn), self.last = seen.pose, seen.captured_at
            stamp = SimpleNamespace(sec=math.floor(self.last), nanosec=round(1e9 * (self.last % 1.0)))
            q = SimpleNamespace(w=math.cos(0.5 * turn), x=0.0, y=0.0, z=math.sin(0.5 * turn))
            pose = SimpleNamespace(position=SimpleNamespace(x=x, y=y), orientation=q)
            self.see(SimpleNamespace(header=SimpleNamespace(stamp=stamp), pose=pose))

    def hear(self, message):
        self.said.append(message.data)
        match message.data.split():
            case ["heat", milliseconds, signs]:
                self.plant.heat(["-0+".index(sign) - 1 for sign in signs], int(milliseconds) / 1000.0)
            case ["stop"]:
                self.plant.stop()


@pytest.fixture
def ros_plant(monkeypatch):
    def make(**options):
        ros = Ros(**options)

        class Node:
            def __init__(self, name):
                assert name

            def create_subscription(self, kind, topic, callback, depth):
                assert (kind, topic, depth) == ("PoseStamped", "hub_pose", 1)
                ros.see = callback

            def create_publisher(self, kind, topic, depth):
                assert (topic, depth) == ("wires", 1)
                return SimpleNamespace(publish=ros.hear)

            def get_clock(self):
                return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=round(1e9 * ros.plant.now())))

        made = {
            "rclpy": {"spin_once": ros.spin_once}, "rclpy.node": {"Node": Node}, "geometry_msgs": {}, "std_msgs": {},
            "geometry_msgs.msg": {"PoseStamped": "PoseStamped"}, "std_msgs.msg": {"String": SimpleNamespace},
        }  # fmt: skip
        for name, contents in made.items():
            module = ModuleType(name)
            vars(module).update(contents)
            monkeypatch.setitem(sys.modules, name, module)
        return ros, runpy.run_path(str(EXAMPLE))["RosPlant"]()

    return make


@pytest.mark.parametrize("lost_after", [math.inf, 1.0])
def test_a_gait_drives_a_robot_over_ros_until_its_tracker_falls_silent(lost_after, ros_plant):
    ros, plant = ros_plant(lost_after=lost_after)
    env, gait = PlantSwim(plant, Limits(), scene=SCENE, decision_period=0.5), scripted("straight")
    (observation, info), truncated, decisions = env.reset(), False, 0
    while not truncated and decisions < 6:
        observation, _, _, truncated, info = env.step(gait.predict(observation)[0])
        decisions += 1
    assert truncated == bool(info["plant_message"]) == (lost_after < math.inf)
    if truncated:
        assert ros.said[-1] == "stop" and not ros.plant.heated().any()
        return
    env.close()
    assert {line.split()[0] for line in ros.said} == {"beat", "heat", "stop"}
    assert np.linalg.norm(ros.plant.simulator.hub_position()) > 1e-4
    np.testing.assert_allclose(info["hub_position"], ros.plant.simulator.hub_position()[0], atol=5e-3)
