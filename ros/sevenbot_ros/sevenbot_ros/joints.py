"""The joints as ROS names them, and their angles in both units.

A joint of the model is 0 in the straight pose, which the arm has at 90 90 65 90 90 90 degrees. Joint 7, the claw, is 0 when it is
closed. The linkage of joints 2 and 3 has passive joints, which the model computes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import sevenbot

NAMES = tuple(f"joint_{number}" for number in range(1, 8))
# The angles of the arm, in degrees, at which the joints of the model are 0.
ZEROS = (90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 0.0)
# What the model computes: the joint, the joint that it follows, and the factor.
PASSIVE = (("elbow", "joint_2", -1.0), ("finger", "joint_7", 0.5), ("opposite_finger", "joint_7", -0.5))
# The arm keeps joint 2 + joint 3 of the model within this many degrees.
LINKAGE = 71.0
# The largest angle of the claw, in degrees.
CLAW_MAX = 84.0
# The largest torque, in N m, which URDF requires. The stall torque of the servos was not measured.
STALL_TORQUE = 2.0


def to_radians(degrees: Sequence[float]) -> list[float]:
    """Converts angles of the arm in degrees to angles of the model in radians."""
    return [math.radians(angle - zero) for angle, zero in zip(degrees, ZEROS, strict=True)]


def to_degrees(joint: int, radians: float) -> float:
    """Converts an angle of the model in radians to the angle of the arm in degrees. `joint` counts from 0."""
    return math.degrees(radians) + ZEROS[joint]


def speeds_to_radians(degrees: Sequence[float]) -> list[float]:
    """Converts degrees per second to radians per second, for arm and model alike."""
    return [math.radians(speed) for speed in degrees]


def with_passive(radians: Sequence[float]) -> list[float]:
    """The angles, or the speeds, of all joints of the model: `NAMES`, then those of `PASSIVE`."""
    by_name = dict(zip(NAMES, radians, strict=True))
    return [*radians, *(factor * by_name[of] for _, of, factor in PASSIVE)]


@dataclass(frozen=True)
class Limits:
    """The range of each joint in degrees of the arm."""

    low: tuple[float, ...]
    high: tuple[float, ...]

    @classmethod
    def of_arm(cls) -> Limits:
        """The limits of the arm itself. The claw ends at `CLAW_MAX`."""
        low, high = (tuple(float(angle) for angle in side) for side in sevenbot.limits())
        return cls(low, (*high[:6], min(high[6], CLAW_MAX)))

    def within(self, low: Sequence[float], high: Sequence[float]) -> Limits:
        """These limits, tightened by angles of the model in radians. An empty list leaves a side as it is."""
        lows = [to_degrees(joint, angle) for joint, angle in enumerate(low)] or self.low
        highs = [to_degrees(joint, angle) for joint, angle in enumerate(high)] or self.high
        return Limits(
            tuple(max(pair) for pair in zip(self.low, lows, strict=True)),
            tuple(min(pair) for pair in zip(self.high, highs, strict=True)),
        )


def linkage(degrees: Sequence[float]) -> float:
    """How far joint 2 + joint 3 of the model is from 0 in this pose, in degrees."""
    return abs(degrees[1] - ZEROS[1] + degrees[2] - ZEROS[2])


def linkage_is_kept(degrees: Sequence[float]) -> bool:
    """Does the linkage allow joints 2 and 3 of this pose? Within a tenth of a degree."""
    return linkage(degrees) <= LINKAGE + 0.1
