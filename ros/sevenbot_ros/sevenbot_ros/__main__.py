"""The program: `python -m sevenbot_ros`, or `ros2 run sevenbot_ros arm`."""

from __future__ import annotations

import sys

import rclpy
from rclpy.executors import MultiThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from sevenbot_ros.node import ArmNode
from sevenbot_ros.parameters import WrongParameter
from sevenbot_ros.signals import EndSignals
from sevenbot_ros.trajectory_action import TRAJECTORIES, TrajectoryAction, published_type

# Threads for commands, a motion, another service, the trajectories, their goals, and `stop`, so that none waits for another.
THREADS = 6 + TRAJECTORIES
# The longest time until a signal is seen, in seconds.
SIGNAL_PERIOD = 0.1


def main(arguments: list[str] | None = None) -> int:
    """Runs the node until a signal comes or the thread of the arm ends. Returns the exit status of the program."""
    signals = EndSignals()
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = ArmNode()
    except WrongParameter as error:
        print(f"sevenbot_ros: {error}", file=sys.stderr)
        rclpy.shutdown()
        return 2
    return spin(node, published_type(), signals)


def spin(node: ArmNode, action: TrajectoryAction | None, signals: EndSignals) -> int:
    """Serves the node, with the action if there is one, until a signal comes or the thread of the arm ends."""
    executor = MultiThreadedExecutor(THREADS)
    executor.add_node(node)
    if action is not None and node.get_parameter("follow_joint_trajectory").value:
        action.serve(node)
    node.start()
    try:
        while rclpy.ok() and not signals.have_come:
            executor.spin_once(SIGNAL_PERIOD)
    finally:
        # Close the arm first, because its thread publishes until it ends.
        node.close()
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    return 1 if node.driver.has_failed else 0


if __name__ == "__main__":
    sys.exit(main())
