"""A plant over ROS 2: a tracker publishes poses of the hub, a node with the wires hears what to heat.

The node with the wires stops them by itself when it has heard nothing for 0.1 s, as every plant does.
"""

import math

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from std_msgs.msg import String

from seastar_gym.plant.plant import Sighting


class RosPlant(Node):
    """Plant of the topics `hub_pose` (PoseStamped, in the tank) and `wires` (String: those of plant/lines.py)."""

    def __init__(self, n_limbs: int = 5):
        super().__init__("seastar")
        self.n_limbs, self._seen = n_limbs, None
        self.create_subscription(PoseStamped, "hub_pose", self._see, 1)
        self._wires = self.create_publisher(String, "wires", 1)

    def _see(self, message: PoseStamped) -> None:
        stamp, at, q = message.header.stamp, message.pose.position, message.pose.orientation
        heading = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y**2 + q.z**2))
        self._seen = Sighting(stamp.sec + 1e-9 * stamp.nanosec, self.now(), (at.x, at.y, heading))

    def now(self) -> float:
        return 1e-9 * self.get_clock().now().nanoseconds

    def wait(self, seconds: float) -> None:
        until = self.now() + seconds
        while (left := until - self.now()) > 0.0:
            rclpy.spin_once(self, timeout_sec=left)

    def sight(self) -> Sighting | None:
        rclpy.spin_once(self, timeout_sec=0.0)
        self._wires.publish(String(data="beat"))
        return self._seen

    def heat(self, limbs, seconds: float) -> None:
        signs = "".join("-0+"[1 + limb] for limb in limbs)
        self._wires.publish(String(data=f"heat {round(1000.0 * seconds)} {signs}"))

    def stop(self) -> None:
        self._wires.publish(String(data="stop"))
