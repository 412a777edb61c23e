"""Measures the joints and reads the health of one connected arm, each at its rate.

Knows no ROS.
"""

from __future__ import annotations

import sevenbot

from sevenbot_ros import health
from sevenbot_ros.clocks import Clock
from sevenbot_ros.events import Events, Measurement

# Seconds between two short reads of the health.
HEALTH_PERIOD = 0.3


class Monitor:
    """Tells measurements and diagnoses as they come."""

    def __init__(self, arm: sevenbot.Arm, clock: Clock, rate: float, events: Events) -> None:
        self._arm, self._clock, self._period, self._events = arm, clock, 1.0 / rate, events
        self._next_health = clock.now()
        self._blocks: list[list[int]] = []
        self._errors_before: int | None = None
        # When the joints are measured next, on the clock of the arm.
        self.due = self._next_health
        self.last: Measurement | None = None

    def poll(self) -> None:
        """Reads what is due."""
        now = self._clock.now()
        if now >= self.due:
            self._measure()
            self.due = _next(self.due, self._period, self._clock.now())
        if now >= self._next_health:
            self._examine()
            self._next_health = _next(self._next_health, HEALTH_PERIOD, self._clock.now())

    def _measure(self) -> None:
        seen = self._arm.observe()
        positions, velocities, loads = (
            tuple(float(value) for value in row) for row in (seen.positions, seen.velocities, seen.loads)
        )
        self.last = Measurement(positions, velocities, loads, seen.age, self._clock.now())
        self._events.measured(self.last)

    def _examine(self) -> None:
        """Reads one block of the health, and tells the health after the last one. A longer read would delay the stream."""
        self._blocks.append(self._arm.get(health.BLOCKS[len(self._blocks)]))
        if len(self._blocks) < len(health.BLOCKS):
            return
        motor, protection, status = self._blocks
        errors = health.bus_errors(status)
        before = errors if self._errors_before is None else self._errors_before
        self._events.diagnosed(health.of_registers(motor, protection, status, before))
        self._blocks, self._errors_before = [], errors


def _next(due: float, period: float, now: float) -> float:
    """A period after `due`, or `now` if that is past."""
    due += period
    return due if due > now else now
