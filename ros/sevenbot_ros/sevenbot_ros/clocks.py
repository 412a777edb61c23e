"""The clock of an arm: the real one, or that of a simulated arm, which this program paces."""

from __future__ import annotations

import time
from typing import Protocol

import sevenbot

# If simulated time differs from real time by more than this, in seconds, the clock is rebased and does not catch up.
LEAP = 0.3
# The shortest sleep, in seconds.
STEP = 1e-5


class Clock(Protocol):
    """Seconds that never go back, and a wait."""

    def now(self) -> float:
        """The present time in seconds."""

    def wait_until(self, end: float) -> None:
        """Waits until this time. A stop of the arm may end the wait early."""


class RealClock:
    """The clock of a real arm."""

    def now(self) -> float:
        return time.monotonic()

    def wait_until(self, end: float) -> None:
        left = end - self.now()
        if left > 0.0:
            time.sleep(left)


class SimulatedClock:
    """Virtual time, led so that it passes `factor` times as fast as real time.

    Virtual time also passes while a request waits for its reply. If it falls behind by more than `LEAP`, it does not catch up.
    """

    def __init__(self, arm: sevenbot.SimulatedArm, factor: float = 1.0) -> None:
        self._arm = arm
        self._factor = factor
        self._rebase()

    def _rebase(self) -> None:
        self._virtual, self._real = self.now(), time.monotonic()

    def now(self) -> float:
        return self._arm.simulation.now

    def wait_until(self, end: float) -> None:
        left = end - self.now()
        if left > 0.0:
            # The arm's clock counts microseconds: a sleep of less than one would not pass any time.
            try:
                self._arm.sleep(max(left, STEP))
            except sevenbot.Interrupted:
                # A service stopped the arm, which ends the wait of this thread, too.
                return
        ahead = (self.now() - self._virtual) / self._factor - (time.monotonic() - self._real)
        if ahead > LEAP or ahead < -LEAP:
            self._rebase()
        elif ahead > 0.0:
            time.sleep(ahead)
