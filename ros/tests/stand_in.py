"""The node with its trajectory action, but of type `test_msgs/action/Fibonacci`: `control_msgs` is not on PyPI, and this is.

The number in a goal chooses a trajectory of `TRAJECTORIES`. Feedback and results are numbers: thousandths of a radian, and the
code. The server, its checks and the motion are those of the product.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from typing import Any

import rclpy
from rclpy.signals import SignalHandlerOptions
from sevenbot_ros.__main__ import spin
from sevenbot_ros.messages import stamp
from sevenbot_ros.node import ArmNode
from sevenbot_ros.signals import EndSignals
from sevenbot_ros.trajectory_action import Goal, TrajectoryAction
from test_msgs.action import Fibonacci
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

JOINTS = ["joint_1", "joint_2", "joint_3", "joint_5"]
# The pose in which the path begins and ends, in degrees of the model: with the forearm up a joint bends less than a degree.
BEGIN = (0.0, 0.0, -45.0, 0.0)
# The amplitude of each joint in degrees of the model, and its phase in radians.
WAVES = ((30.0, 0.0), (-8.0, 1.0), (6.0, 0.0), (15.0, 3.0))
POINTS, STEP = 500, 0.02


def planned(time: float) -> tuple[list[float], list[float]]:
    """The positions and velocities of a planner's path in radians, from `BEGIN` back to it."""
    end = POINTS * STEP
    # It begins and ends at rest.
    share = 0.5 - 0.5 * math.cos(math.pi * time / end)
    speed = 0.5 * math.pi / end * math.sin(math.pi * time / end)
    turn = 2 * math.pi
    positions = [
        math.radians(begin + size * (math.sin(turn * share + phase) - math.sin(phase)))
        for begin, (size, phase) in zip(BEGIN, WAVES, strict=True)
    ]
    velocities = [math.radians(size) * turn * math.cos(turn * share + phase) * speed for size, phase in WAVES]
    return positions, velocities


def long_path() -> JointTrajectory:
    """Points as MoveIt gives them."""
    message = JointTrajectory(joint_names=JOINTS)
    for number in range(1, POINTS + 1):
        positions, velocities = planned(number * STEP)
        point = JointTrajectoryPoint(positions=positions, velocities=velocities)
        nanoseconds = round(number * STEP * 1e9)
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(nanoseconds, 10**9)
        message.points.append(point)
    return message


def way_to_begin() -> JointTrajectory:
    """A trajectory of one point, `BEGIN`, without velocities."""
    message = JointTrajectory(joint_names=JOINTS)
    message.points = [JointTrajectoryPoint(positions=[math.radians(angle) for angle in BEGIN])]
    message.points[0].time_from_start.sec = 2
    return message


def claw() -> JointTrajectory:
    """The claw from 80 to 60 degrees, as a planner's trajectory of its group."""
    message = JointTrajectory(joint_names=["joint_7"])
    message.points = [JointTrajectoryPoint(positions=[math.radians(60.0)])]
    message.points[0].time_from_start.sec = 1
    return message


def later(seconds: float) -> JointTrajectory:
    """The trajectory to `BEGIN`, which begins this many seconds from now."""
    message = way_to_begin()
    message.header.stamp = stamp(time.time() + seconds)
    return message


def wrong(name: str) -> JointTrajectory:
    """A trajectory that is refused."""
    message = JointTrajectory(joint_names=[name])
    message.points = [JointTrajectoryPoint(positions=[4.0])]
    message.points[0].time_from_start.sec = 1
    return message


TRAJECTORIES = {
    1: long_path,
    2: lambda: wrong("joint_9"),
    3: lambda: wrong("joint_1"),
    4: way_to_begin,
    5: claw,
    6: lambda: later(4.0),
    7: lambda: later(25.0),
}


class StandIn:
    """Reads and writes `Fibonacci` as if it were FollowJointTrajectory."""

    def goal(self, request: Any) -> Goal:
        # The path tolerance is 0.5 rad: a joint that is further away fails the goal.
        trajectory = TRAJECTORIES[request.order]()
        return Goal(trajectory, {name: 0.5 for name in trajectory.joint_names}, {}, 0.0)

    def feedback(self, names: Sequence[str], desired: Sequence[float], actual: Sequence[float], seconds: float) -> Any:
        return Fibonacci.Feedback(sequence=[round(angle * 1000) for angle in [*desired, *actual]])

    def result(self, code: int, text: str) -> Any:
        print(f"result {code} {text}", file=sys.stderr)
        return Fibonacci.Result(sequence=[code])


def main() -> int:
    signals = EndSignals()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    return spin(ArmNode(), TrajectoryAction(Fibonacci, StandIn()), signals)


if __name__ == "__main__":
    sys.exit(main())
