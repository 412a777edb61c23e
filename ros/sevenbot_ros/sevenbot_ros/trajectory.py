"""A trajectory of joints as ROS gives it, sampled at the times of a stream's points.

Knows neither ROS nor the arm. Angles are degrees of the arm, times seconds from the start.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from sevenbot_ros.commands import Refusal, Rules, Targets, check, check_linkage
from sevenbot_ros.joints import NAMES


@dataclass(frozen=True)
class Knot:
    """A point of a trajectory: its time, the angles of all joints, and their speeds if it gives them."""

    time: float
    pose: tuple[float, ...]
    speeds: tuple[float, ...] | None


@dataclass(frozen=True)
class RawPoint:
    """A point of a message: radians, radians a second, and seconds from the start."""

    time: float
    positions: Sequence[float]
    velocities: Sequence[float]


class Trajectory:
    """A path through the angles of all joints. Joints that the message does not name stay where they stand."""

    def __init__(self, knots: Sequence[Knot], joints: tuple[int, ...]) -> None:
        self._knots = tuple(knots)
        self._times = [knot.time for knot in knots]
        self.joints = joints

    @property
    def duration(self) -> float:
        """The time of the last point."""
        return self._times[-1]

    def at(self, time: float) -> list[float | None]:
        """The angles at a time; `None` for joints without a part in it."""
        pose = self.pose(time)
        return [pose[joint] if joint in self.joints else None for joint in range(len(NAMES))]

    def pose(self, time: float) -> tuple[float, ...]:
        """The angles of all joints at a time. Before the first point and after the last one, the angles of that point."""
        index = bisect_right(self._times, time)
        if index == 0:
            return self._knots[0].pose
        if index == len(self._knots):
            return self._knots[-1].pose
        return _between(self._knots[index - 1], self._knots[index], time)


def _between(one: Knot, other: Knot, time: float) -> tuple[float, ...]:
    """A cubic through both points with their speeds, or a straight line where they have none."""
    span = other.time - one.time
    s = (time - one.time) / span
    if one.speeds is None or other.speeds is None:
        return tuple(a + (b - a) * s for a, b in zip(one.pose, other.pose, strict=True))
    cubic = (2 * s**3 - 3 * s**2 + 1, (s**3 - 2 * s**2 + s) * span, 3 * s**2 - 2 * s**3, (s**3 - s**2) * span)
    rows = zip(one.pose, one.speeds, other.pose, other.speeds, strict=True)
    return tuple(sum(weight * value for weight, value in zip(cubic, row, strict=True)) for row in rows)


def plan(
    rules: Rules, names: Sequence[str], points: Sequence[RawPoint], standing: Sequence[float]
) -> Trajectory | Refusal:
    """A trajectory from where the joints stand, or the reason why it is refused."""
    if not points:
        return Refusal("empty", "the trajectory has no point")
    knots = [Knot(0.0, tuple(standing), (0.0,) * len(NAMES))] if points[0].time > 0.0 else []
    last = -1.0
    for number, point in enumerate(points):
        knot = _knot(rules, names, point, standing)
        if isinstance(knot, Refusal):
            return Refusal(knot.key, f"point {number}: {knot.text}")
        if not math.isfinite(point.time) or point.time <= last:
            return Refusal("times", f"point {number}: its time_from_start is not after that of the point before")
        last = point.time
        knots.append(knot)
    return Trajectory(knots, tuple(NAMES.index(name) for name in names))


def _knot(rules: Rules, names: Sequence[str], point: RawPoint, standing: Sequence[float]) -> Knot | Refusal:
    targets = check(rules, names, point.positions, None, 0.0)
    if isinstance(targets, Refusal):
        return targets
    if targets.refused:
        return targets.refused[0]
    pose = _merged(standing, targets)
    if refusal := check_linkage(pose):
        return refusal
    if len(point.velocities) not in (0, len(names)) or not all(map(math.isfinite, point.velocities)):
        return Refusal("velocities", "its velocities are not one number for each joint")
    speeds = [0.0] * len(NAMES)
    for name, speed in zip(names, point.velocities, strict=False):
        speeds[NAMES.index(name)] = math.degrees(speed)
    return Knot(point.time, tuple(pose), tuple(speeds) if len(point.velocities) else None)


def _merged(standing: Sequence[float], targets: Targets) -> list[float]:
    return [targets.degrees.get(joint, angle) for joint, angle in enumerate(standing)]
