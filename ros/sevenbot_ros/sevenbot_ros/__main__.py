"""The program: `python -m sevenbot_ros`, or `ros2 run sevenbot_ros arm`."""

from __future__ import annotations

import sys

import rclpy
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor

from sevenbot_ros.node import ArmNode
from sevenbot_ros.parameters import WrongParameter
from sevenbot_ros.trajectory_action import TrajectoryAction, published_type

# Commands, one service that takes long, `stop` beside it, and a trajectory.
THREADS = 4


def main(arguments: list[str] | None = None) -> int:
    """Runs the node until a signal ends it. The exit status is that of the program."""
    rclpy.init(args=arguments)
    try:
        node = ArmNode()
    except WrongParameter as error:
        print(f"sevenbot_ros: {error}", file=sys.stderr)
        rclpy.shutdown()
        return 2
    return spin(node, published_type())


def spin(node: ArmNode, action: TrajectoryAction | None) -> int:
    """Serves the node, with the action if there is one."""
    executor = MultiThreadedExecutor(THREADS)
    executor.add_node(node)
    if action is not None and node.get_parameter("follow_joint_trajectory").value:
        action.serve(node)
    node.start()
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.close()
        node.destroy_node()
        rclpy.try_shutdown()
    return 1 if node.driver.has_failed else 0


if __name__ == "__main__":
    sys.exit(main())
