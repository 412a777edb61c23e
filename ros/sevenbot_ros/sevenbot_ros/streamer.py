"""Sends the points of what leads the arm as a stream of set-points. One thread calls it.

Knows no ROS.
"""

from __future__ import annotations

import math

import sevenbot

from sevenbot_ros import opening
from sevenbot_ros.clocks import Clock
from sevenbot_ros.events import Events, Measurement
from sevenbot_ros.interlock import Interlock
from sevenbot_ros.lead import Lead
from sevenbot_ros.lead_slot import LeadSlot
from sevenbot_ros.settings import Settings

# `Stream.send` is called this many seconds before a point is due, and waits for the rest itself.
MARGIN = 0.002
# The longest wait for the end of a stream that nothing leads any more, in seconds.
LONGEST_END = 5.0


class Streamer:
    """The stream of one arm, which is open while something leads it."""

    def __init__(self, settings: Settings, interlock: Interlock, leads: LeadSlot, events: Events) -> None:
        self._settings, self._interlock, self._leads, self._events = settings, interlock, leads, events
        self._stream: sevenbot.Stream | None = None
        # What leads the open stream, and the number of periods from the last point but one to the last point.
        self._led: Lead | None = None
        self._skipped = 1
        self._next_point = 0.0
        self._last_number: int | None = None

    @property
    def is_open(self) -> bool:
        """Is a stream open?"""
        return self._stream is not None

    @property
    def due(self) -> float:
        """When `advance` has to send the next point, on the clock of the arm. Infinite if no stream is open."""
        return math.inf if self._stream is None else self._next_point - MARGIN

    def advance(self, arm: sevenbot.Arm, clock: Clock, measurement: Measurement | None) -> None:
        """Sends a point if one is due. Opens the stream when something leads the arm, and closes it when nothing does."""
        lead = self._leads.allowed()
        if lead is None:
            self._close_if_idle()
            return
        if self._stream is None:
            self._open(arm, lead)
        elif lead is not self._led:
            lead.begin(self._led.point if self._led and self._led.point else opening.standing(arm))
            self._led, self._last_number = lead, None
        if self._stream is not None and clock.now() >= self.due:
            self._send(self._stream, lead, clock, measurement)

    def _open(self, arm: sevenbot.Arm, lead: Lead) -> None:
        settings = self._settings
        try:
            lead.begin(opening.standing(arm))
            stream = arm.stream(settings.period, watchdog=settings.watchdog, guard=False)
            stream.__enter__()
        except (sevenbot.PortError, sevenbot.Closed):
            raise
        except sevenbot.Error as error:
            self._give_up(lead, error)
        else:
            self._stream, self._led = stream, lead
            self._next_point, self._last_number = 0.0, None

    def _send(self, stream: sevenbot.Stream, lead: Lead, clock: Clock, measurement: Measurement | None) -> None:
        point = lead.next(self._steps(), measurement)
        if refusal := lead.refusal():
            self._events.refused(refusal)
        if point is None:
            self._end(lead, "it has ended")
            return
        if all(angle is None for angle in point):
            self._next_point = clock.now() + self._settings.period
            return
        try:
            number = stream.send(point)
        except (sevenbot.PortError, sevenbot.Closed):
            raise
        except sevenbot.Error as error:
            self._give_up(lead, error)
        else:
            self._skipped = 1 if self._last_number is None else max(number - self._last_number, 1)
            self._last_number = number
            self._next_point = clock.now() + self._settings.period

    def _steps(self) -> int:
        """How many periods the lead goes on for the next point: as many as there were between the last two, and 0 for the first."""
        return 0 if self._last_number is None else self._skipped

    def _give_up(self, lead: Lead, error: sevenbot.Error) -> None:
        # The lines after the first are hints.
        if self._interlock.halt_first(str(error).partition("\n")[0]):
            self._events.changed(f"the arm holds: {error}")
        self._end(lead, str(error))

    def _end(self, lead: Lead, reason: str) -> None:
        self._leads.end(lead, reason)
        if self._leads.current is None:
            self._close_if_idle()

    def _close_if_idle(self) -> None:
        # A stop makes the arm hold without the end of the stream. Closing the stream here would wait until the stop has ended.
        if not self._interlock.is_stopping:
            self.close()

    def close(self) -> None:
        """Closes the stream if one is open."""
        stream = self._stream
        if stream is None:
            return
        try:
            # With an exception type, `__exit__` does not wait until the joints stand.
            stream.__exit__(sevenbot.Interrupted, None, None)
        finally:
            with self._interlock.lock:
                self._stream = None
                self._interlock.lock.notify_all()

    def wait_until_closed(self) -> None:
        """Waits until no stream is open. For other threads, while the interlock refuses commands. Raises `sevenbot.Interrupted`
        if the stream does not end within `LONGEST_END`."""
        with self._interlock.lock:
            if not self._interlock.lock.wait_for(lambda: self._stream is None, LONGEST_END):
                raise sevenbot.Interrupted("the stream does not end")
