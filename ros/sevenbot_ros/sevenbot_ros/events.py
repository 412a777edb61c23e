"""What the thread of the arm tells."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from sevenbot_ros.commands import Refusal
from sevenbot_ros.health import Health


@dataclass(frozen=True)
class Measurement:
    """Positions in degrees of the arm, velocities in degrees per second, and loads in percent of the stall torque.

    `age` is the longest time since the servos were read, `time` the time on the arm's clock. Both are seconds.
    """

    positions: tuple[float, ...]
    velocities: tuple[float, ...]
    loads: tuple[float, ...]
    age: float
    time: float


class Events(Protocol):
    """Receives what happens to the arm. The driver makes its calls from the thread of the arm."""

    def measured(self, measurement: Measurement) -> None:
        """The joints were measured."""

    def diagnosed(self, diagnosis: Health) -> None:
        """The health was read, or no arm answers."""

    def passed(self, simulated: float) -> None:
        """Simulated time passed: it is `simulated` seconds now."""

    def refused(self, refusal: Refusal) -> None:
        """A command is refused."""

    def changed(self, text: str) -> None:
        """Something happened that a user wants to read."""

    def ended(self) -> None:
        """The thread ends."""
