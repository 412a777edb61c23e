"""Turns targets, which may come at any time, into the points of a stream. Limits how far a point may move.

Knows neither ROS nor the arm. Angles are degrees of the arm.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

from sevenbot_ros.commands import Refusal, Targets, check_linkage
from sevenbot_ros.joints import NAMES, linkage, linkage_is_kept

JOINTS = len(NAMES)


class Jump(Enum):
    """What happens to a target that is far from the last one."""

    REFUSE = "refuse"
    APPROACH = "approach"


class Follower:
    """The set-point of each joint. It begins where the joints stand, and follows the targets.

    A target further than `max_jump` degrees from the last one is refused, or approached on a straight line of the joints at
    `approach_speed` degrees a second. A target that moves on meanwhile is caught up with at this speed.
    """

    def __init__(
        self, standing: Sequence[float], *, jump: Jump, max_jump: float = 5.0, approach_speed: float = 30.0
    ) -> None:
        self._jump = jump
        self._max_jump = max_jump
        self._approach_speed = approach_speed
        self._point = list(standing)
        self._goal = list(standing)
        self._is_driven = [False] * JOINTS
        # The first target may be some degrees away, too, and is approached.
        self._is_approaching = True
        # Degrees that the targets moved since the last point. Jumps do not count: they are approached.
        self._travel = 0.0

    @property
    def is_approaching(self) -> bool:
        """True after the start and after a jump, until the points have reached the targets."""
        return self._is_approaching

    def take(self, targets: Targets) -> Refusal | None:
        """Follows these targets from now on. If it returns a refusal, the earlier targets stay."""
        goal = list(self._goal)
        for joint, angle in targets.degrees.items():
            goal[joint] = angle
        # A hand or a restart may have left the arm outside the linkage's range. Then only targets that lead back are allowed.
        if (refusal := check_linkage(goal)) and (linkage_is_kept(self._goal) or linkage(goal) > linkage(self._goal)):
            return refusal
        distance, joint = max((abs(to - at), joint) for joint, (to, at) in enumerate(zip(goal, self._goal, strict=True)))
        if distance > self._max_jump:
            if self._jump is Jump.REFUSE:
                return Refusal(
                    "jump",
                    f"{NAMES[joint]} would jump by {distance:.1f} degrees, and {self._max_jump:g} is the limit "
                    "(max_jump_degrees): begin where the arm stands, or set jump to approach",
                )
            self._is_approaching = True
        else:
            self._travel += distance
        self._goal = goal
        for joint in targets.degrees:
            self._is_driven[joint] = True
        return None

    def advance(self, seconds: float) -> list[float | None]:
        """The next point, this long after the last one. `None` for joints that never had a target."""
        # The first point is where the joints stand: targets that came while the stream opened may have gone far.
        travel, self._travel = self._travel if seconds > 0.0 else 0.0, 0.0
        if self._is_approaching:
            self._approach(self._approach_speed * seconds + travel)
        else:
            self._point = list(self._goal)
        return [angle if driven else None for angle, driven in zip(self._point, self._is_driven, strict=True)]

    def _approach(self, step: float) -> None:
        left = [goal - at for goal, at in zip(self._goal, self._point, strict=True)]
        furthest = max(abs(angle) for angle in left)
        if furthest <= step:
            self._point, self._is_approaching = list(self._goal), False
            return
        self._point = [at + angle * step / furthest for at, angle in zip(self._point, left, strict=True)]
