"""What a command of ROS means for the arm: targets in degrees, or the reason why it is refused.

Knows neither ROS nor the arm: a command is names, positions in radians and a stamp in seconds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from sevenbot_ros.joints import LINKAGE, NAMES, Limits, linkage_is_kept, to_degrees

# A controller may compute a position slightly beyond a limit. A position this near, in degrees, counts as the limit.
ROUNDING = 0.1


@dataclass(frozen=True)
class Refusal:
    """Why a command is refused. `key` is the same for all refusals of a kind."""

    key: str
    text: str


@dataclass(frozen=True)
class Targets:
    """An accepted command: degrees of the arm by joint, counted from 0. `refused` joints keep their last target."""

    degrees: dict[int, float]
    refused: tuple[Refusal, ...] = ()


@dataclass(frozen=True)
class Rules:
    """What a command has to keep. Ages are seconds."""

    limits: Limits = field(default_factory=Limits.of_arm)
    max_age: float = 0.5


def check(
    rules: Rules, names: Sequence[str], positions: Sequence[float], stamp: float | None, now: float
) -> Targets | Refusal:
    """The targets of a command, or the reason why it is refused. `stamp` is `None` if the sender gave none."""
    return _shape(names, positions) or _age(rules, stamp, now) or _targets(rules, names, positions)


def _shape(names: Sequence[str], positions: Sequence[float]) -> Refusal | None:
    if unknown := [name for name in names if name not in NAMES]:
        return Refusal("unknown joint", f"the arm has no joint {', '.join(unknown)}: its joints are {', '.join(NAMES)}")
    if len(set(names)) < len(names):
        return Refusal("twice", "a joint is named twice")
    if len(names) != len(positions):
        return Refusal("length", f"{len(names)} names have {len(positions)} positions: only positions move this arm")
    if not names:
        return Refusal("empty", "the command names no joint")
    return None


def _age(rules: Rules, stamp: float | None, now: float) -> Refusal | None:
    if stamp is None:
        return None
    if now - stamp > rules.max_age:
        return Refusal(
            "old",
            f"the command is {now - stamp:.2f} s old, and {rules.max_age:g} s is the limit (max_age): do both programs have the "
            "same clock (use_sim_time)?",
        )
    if stamp - now > rules.max_age:
        return Refusal(
            "future",
            f"the command is {stamp - now:.2f} s in the future: do both programs have the same clock (use_sim_time)?",
        )
    return None


def _targets(rules: Rules, names: Sequence[str], positions: Sequence[float]) -> Targets | Refusal:
    degrees: dict[int, float] = {}
    refused: list[Refusal] = []
    for name, position in zip(names, positions, strict=True):
        joint = NAMES.index(name)
        if math.isnan(position):
            refused.append(Refusal(f"NaN {name}", f"the position of {name} is not a number: does it have an active controller?"))
            continue
        angle = to_degrees(joint, position)
        low, high = rules.limits.low[joint], rules.limits.high[joint]
        if not low - ROUNDING <= angle <= high + ROUNDING:
            return Refusal(
                f"range {name}",
                f"{name} cannot be at {position:.4f} rad: its range is {_radians(joint, low)} to {_radians(joint, high)}",
            )
        degrees[joint] = min(max(angle, low), high)
    if not degrees:
        return Refusal("NaN", "no position is a number: is a controller active?")
    return Targets(degrees, tuple(refused))


def _radians(joint: int, degrees: float) -> str:
    return f"{math.radians(degrees - to_degrees(joint, 0.0)):.4f}"


def check_linkage(pose: Sequence[float]) -> Refusal | None:
    """Why the linkage does not allow the targets of all joints, in degrees of the arm; `None` if it does."""
    if linkage_is_kept(pose):
        return None
    total = math.radians(pose[1] - to_degrees(1, 0.0) + pose[2] - to_degrees(2, 0.0))
    limit = math.radians(LINKAGE)
    return Refusal(
        "linkage", f"joint_2 + joint_3 would be {total:.4f} rad: the linkage keeps the sum within -{limit:.4f} and {limit:.4f}"
    )


class Throttle:
    """Lets a kind of message pass once in a period, and counts those that it holds back."""

    def __init__(self, period: float = 5.0) -> None:
        self._period = period
        self._last: dict[str, float] = {}
        self._held: dict[str, int] = {}

    def pass_(self, key: str, now: float) -> int | None:
        """`None` if the message is held back. Otherwise the number of messages of this kind that were held back before."""
        last = self._last.get(key)
        if last is not None and 0.0 <= now - last < self._period:
            self._held[key] = self._held.get(key, 0) + 1
            return None
        self._last[key] = now
        return self._held.pop(key, 0)
