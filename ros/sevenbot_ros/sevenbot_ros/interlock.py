"""Decides whether commands may move the arm: it has to be connected, not stopped, and not used by a service.

Knows neither ROS nor the stream. All threads call it.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import sevenbot

from sevenbot_ros.commands import Refusal


class Halted(sevenbot.Error):
    """Commands and motions are refused until `hold`."""


class Interlock:
    """The connected arm, and the reasons why it must not move."""

    def __init__(self) -> None:
        # Public, because a caller that acts on an answer of this class holds this lock meanwhile, so that the answer stays true.
        self.lock = threading.Condition()
        self._arm: sevenbot.Arm | None = None
        # Why commands are refused until `hold`, and how often the arm was stopped.
        self._halted: str | None = None
        self._stop_count = 0
        # The numbers of services that use the arm, of services that move it, and of stops that still watch whether it holds.
        self._actions = self._motions = self._stops = 0

    def connect(self, arm: sevenbot.Arm | None) -> None:
        """Sets the arm that answers; `None`: no arm answers."""
        with self.lock:
            self._arm = arm

    def arm(self) -> sevenbot.Arm:
        """The arm. Raises `sevenbot.Closed` if none answers."""
        arm = self._arm
        if arm is None:
            raise sevenbot.Closed("no arm answers")
        return arm

    def refusal(self) -> Refusal | None:
        """Why a command is refused now; `None` if it is not refused."""
        with self.lock:
            if self._arm is None:
                return Refusal("no arm", "no arm answers")
            if self._halted is not None:
                return Refusal("halted", _until_hold(self._halted))
            if self._actions:
                return Refusal("busy", "a service moves the arm")
            return None

    @property
    def stop_count(self) -> int:
        """How often the arm was stopped so far."""
        return self._stop_count

    @property
    def is_stopping(self) -> bool:
        """Is a stop still at work, which makes the arm hold and watches whether it does?"""
        return self._stops > 0

    def halt(self, reason: str) -> None:
        """Refuses all commands for this reason, until `release`."""
        with self.lock:
            self._halted = reason

    def halt_first(self, reason: str) -> bool:
        """As `halt`, unless there is a reason already. Returns whether it has set the reason."""
        with self.lock:
            if self._halted is not None:
                return False
            self._halted = reason
            return True

    def release(self, stop_count: int) -> None:
        """Takes commands again. Raises `Halted` if the arm was stopped since this count."""
        with self.lock:
            if self._stop_count == stop_count:
                self._halted = None
        self.check_halted()

    def check_halted(self) -> None:
        """Raises `Halted` if commands are refused until `hold`."""
        halted = self._halted
        if halted is not None:
            raise Halted(_until_hold(halted))

    def wait(self, seconds: float) -> None:
        """Waits this long, at most until a stop. Then raises `Halted` if commands are refused until `hold`."""
        with self.lock:
            self.lock.wait_for(lambda: self._halted is not None, seconds)
        self.check_halted()

    def stop(self, reason: str) -> list[int]:
        """Makes the arm hold at once, also in the middle of a stream, ends all motions, and refuses commands for this reason.

        Returns the targets in degrees.
        """
        arm = self.arm()
        with self.lock:
            self._halted = reason
            self._stop_count += 1
            self._stops += 1
            self.lock.notify_all()
        try:
            self._end_motions(arm)
            return arm.stop()
        finally:
            with self.lock:
                self._stops -= 1

    def _end_motions(self, arm: sevenbot.Arm) -> None:
        """Repeats the hold until all motions have ended: one that began before the stop may write a target after a hold."""
        while self._motions:
            # The hold after this loop reports what is wrong.
            with suppress(sevenbot.Error):
                arm.stop()

    @contextmanager
    def action(self) -> Iterator[sevenbot.Arm]:
        """The arm for a service. Commands are refused meanwhile."""
        arm = self.arm()
        with self.lock:
            self._actions += 1
        try:
            yield arm
        finally:
            with self.lock:
                self._actions -= 1

    @contextmanager
    def motion(self) -> Iterator[None]:
        """The context of a service that moves the arm. Every `stop` ends the motion. Raises `Halted` if commands are refused until
        `hold`."""
        with self.lock:
            self.check_halted()
            self._motions += 1
        try:
            yield
        finally:
            with self.lock:
                self._motions -= 1


def _until_hold(reason: str) -> str:
    return f"{reason}: call the service `hold` to move again"
