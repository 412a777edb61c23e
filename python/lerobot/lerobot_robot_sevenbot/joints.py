"""Joints as LeRobot names and scales them: `joint_1.pos` to `joint_6.pos` in degrees, `claw.pos` from 0 (closed) to 100 (open).

Knows neither an arm nor LeRobot.
"""

import math
from collections.abc import Iterable, Mapping
from typing import SupportsFloat

import sevenbot

NAMES = ("joint_1", "joint_2", "joint_3", "joint_4", "joint_5", "joint_6", "claw")
"""The names of the joints, joint 1 first. Those of joints 1 to 6 are also in the arm's URDF and MJCF."""

LOWEST, HIGHEST = ([float(angle) for angle in angles] for angles in sevenbot.limits())
CLAW_OPEN = HIGHEST[6]
"""The angle of the open claw in degrees; at 0 it is closed."""
LEVEL = 65.0
"""The forearm is parallel to the rear arm at this sum of joints 2 and 3."""
LINKAGE = (19.0, 161.0)
"""The linkage keeps joint 2 + joint 3 - 65 between these angles."""

Angles = list[float]
"""The angles of joints 1 to 7 in degrees."""


def keys(kind: str) -> list[str]:
    """The keys of one kind of value, `pos`, `vel` or `load`, joint 1 first."""
    return [f"{name}.{kind}" for name in NAMES]


def to_lerobot(kind: str, values: Iterable[SupportsFloat]) -> dict[str, float]:
    """Values of joints 1 to 7 with LeRobot's keys and scale. The claw's position and velocity are percent of its way."""
    scaled = [float(value) for value in values]
    if kind != "load":
        scaled[6] *= 100 / CLAW_OPEN
    return dict(zip(keys(kind), scaled, strict=True))


def to_angles(action: Mapping[str, SupportsFloat]) -> Angles:
    """The angles of an action: its values are numbers, or tensors and arrays of one number."""
    missing = [key for key in keys("pos") if key not in action]
    if missing:
        raise ValueError(f"the action has no {', '.join(missing)}: it needs {', '.join(keys('pos'))}")
    angles = [float(action[key]) for key in keys("pos")]
    for key, angle in zip(keys("pos"), angles, strict=True):
        if not math.isfinite(angle):
            raise ValueError(f"the action has {key}={angle}: the policy or the dataset is wrong there")
    angles[6] *= CLAW_OPEN / 100
    return angles


def within_limits(angles: Iterable[float]) -> Angles:
    """The nearest angles that the arm takes. If the linkage is in the way, joints 2 and 3 give way by the same angle."""
    inside = [min(max(angle, low), high) for angle, low, high in zip(angles, LOWEST, HIGHEST, strict=True)]
    linkage = inside[1] + inside[2] - LEVEL
    excess = linkage - min(max(linkage, LINKAGE[0]), LINKAGE[1])
    # If one joint cannot give way by half of the excess, the other one takes the rest.
    second = min(max(inside[1] - excess / 2, LOWEST[1]), HIGHEST[1])
    third = min(max(inside[2] - (excess - (inside[1] - second)), LOWEST[2]), HIGHEST[2])
    inside[1] -= excess - (inside[2] - third)
    inside[2] = third
    return inside


def within_step(angles: Iterable[float], before: Iterable[float], step: float) -> Angles:
    """The angles, with the change of each joint limited to `step` degrees."""
    return [min(max(angle, last - step), last + step) for angle, last in zip(angles, before, strict=True)]


def towards(angles: Iterable[float], before: Angles, step: float) -> Angles:
    """The angles, or a point on the straight way to them at which no joint has changed by more than a step of degrees."""
    ways = [angle - last for angle, last in zip(angles, before, strict=True)]
    longest = max(abs(way) for way in ways)
    share = min(step / longest, 1.0) if longest > 0 else 1.0
    return [last + share * way for way, last in zip(ways, before, strict=True)]


def differing(wanted: Iterable[float], given: Iterable[float], tolerance: float) -> list[str]:
    """The names of the joints whose angles differ by more than a tolerance in degrees."""
    pairs = zip(NAMES, wanted, given, strict=True)
    return [name for name, one, other in pairs if abs(one - other) > tolerance]
