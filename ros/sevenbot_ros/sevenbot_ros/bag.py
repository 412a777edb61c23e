"""Records topics of the arm into a bag in the format MCAP, without rosbag2: `python -m sevenbot_ros.bag FOLDER`.

With rosbag2, use `ros2 bag record`. This module needs `pip install rosbags`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import String

LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TOPICS: tuple[tuple[str, Any, str, Any], ...] = (
    ("robot_joint_states", JointState, "sensor_msgs/msg/JointState", qos_profile_sensor_data),
    ("robot_joint_command", JointState, "sensor_msgs/msg/JointState", qos_profile_sensor_data),
    ("joint_states", JointState, "sensor_msgs/msg/JointState", 10),
    ("tip", PoseStamped, "geometry_msgs/msg/PoseStamped", 10),
    ("robot_description", String, "std_msgs/msg/String", LATCHED),
)


class Recorder:
    """Writes the messages of `TOPICS` into a bag, serialised as they were received."""

    def __init__(self, node: Node, folder: Path) -> None:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore

        self._node = node
        self._writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        store = get_typestore(Stores.ROS2_JAZZY)
        for topic, kind, name, quality in TOPICS:
            full = node.resolve_topic_name(topic)
            connection = self._writer.add_connection(full, name, typestore=store)
            node.create_subscription(kind, topic, self._write(connection), quality, raw=True)

    def _write(self, connection: Any) -> Callable[[bytes], None]:
        def write(message: bytes) -> None:
            self._writer.write(connection, self._node.get_clock().now().nanoseconds, message)

        return write

    def close(self) -> None:
        """Ends the bag."""
        self._writer.close()


def main(arguments: list[str] | None = None) -> int:
    """Records until a signal ends it."""
    rclpy.init(args=arguments)
    words = rclpy.utilities.remove_ros_args(arguments or sys.argv)[1:]
    parser = argparse.ArgumentParser(description="Record topics of the arm into a bag (MCAP)")
    parser.add_argument("folder", type=Path, help="the folder of the bag, which must not exist")
    node = rclpy.create_node("sevenbot_bag")
    recorder = Recorder(node, parser.parse_args(words).folder)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        recorder.close()
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
