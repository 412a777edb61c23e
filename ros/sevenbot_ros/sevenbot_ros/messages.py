"""From measurements to the messages of ROS. Lengths are metres, axes as in REP-103: x forward, y to the left, z up."""

from __future__ import annotations

import math
from collections.abc import Sequence

import sevenbot
from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState

from sevenbot_ros.events import Measurement
from sevenbot_ros.health import Health
from sevenbot_ros.joints import NAMES, PASSIVE, STALL_TORQUE, speeds_to_radians, to_radians, with_passive

Quaternion = tuple[float, float, float, float]

ALL_NAMES = [*NAMES, *(name for name, _, _ in PASSIVE)]
# The axes of joints 1 and 3 to 6 in the straight pose. Joint 2 does not turn the tip: the linkage keeps the forearm's tilt.
AXES = ((0, (0.0, 0.0, 1.0)), (2, (0.0, 1.0, 0.0)), (3, (-1.0, 0.0, 0.0)), (4, (0.0, 1.0, 0.0)), (5, (-1.0, 0.0, 0.0)))


def seconds(message: Time | Duration) -> float:
    """A time or a duration of ROS in seconds. It may be negative, which `rclpy.time.Time` refuses."""
    return float(message.sec + message.nanosec / 1e9)


def stamp(seconds: float) -> Time:
    """Converts seconds to a time of ROS."""
    whole = math.floor(seconds)
    return Time(sec=whole, nanosec=min(round((seconds - whole) * 1e9), 999_999_999))


def joint_state(measurement: Measurement, time: Time, *, passive: bool) -> JointState:
    """The seven joints, and with `passive` those that follow them. Efforts are estimates: see `STALL_TORQUE`."""
    message = JointState()
    message.header.stamp = time
    positions, speeds = to_radians(measurement.positions), speeds_to_radians(measurement.velocities)
    efforts = [load / 100.0 * STALL_TORQUE for load in measurement.loads]
    if not passive:
        message.name, message.position, message.velocity, message.effort = list(NAMES), positions, speeds, efforts
        return message
    message.name, message.position, message.velocity = ALL_NAMES, with_passive(positions), with_passive(speeds)
    message.effort = [*efforts, *[0.0] * len(PASSIVE)]
    return message


def tip_pose(measurement: Measurement, time: Time, frame: str) -> PoseStamped:
    """Where the tip is: its x axis points along the tool."""
    x, y, z = sevenbot.forward(measurement.positions).tip
    message = PoseStamped()
    message.header.stamp, message.header.frame_id = time, frame
    message.pose.position.x, message.pose.position.y, message.pose.position.z = y / 1000, -x / 1000, z / 1000
    turn = orientation(to_radians(measurement.positions))
    message.pose.orientation.x, message.pose.orientation.y, message.pose.orientation.z, message.pose.orientation.w = turn
    return message


def orientation(radians: Sequence[float]) -> Quaternion:
    """The rotation of the tip, as x, y, z, w."""
    turn: Quaternion = (0.0, 0.0, 0.0, 1.0)
    for joint, (x, y, z) in AXES:
        sine, cosine = math.sin(radians[joint] / 2), math.cos(radians[joint] / 2)
        turn = _product(turn, (x * sine, y * sine, z * sine, cosine))
    return turn


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def diagnostics(diagnosis: Health, time: Time, name: str, hardware: str) -> DiagnosticArray:
    """One status for the arm."""
    status = DiagnosticStatus(name=name, hardware_id=hardware, message=diagnosis.message)
    status.level = bytes([diagnosis.level])
    status.values = [KeyValue(key=key, value=value) for key, value in diagnosis.values.items()]
    message = DiagnosticArray(status=[status])
    message.header.stamp = time
    return message
