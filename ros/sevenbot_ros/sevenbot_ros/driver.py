"""The arm of a node: the thread that opens, measures and leads it, again and again.

    commands, goals ──▶ LeadSlot ──▶ Streamer ──▶ arm ──▶ Monitor ──▶ Events
    services ─────────▶ Interlock, which refuses commands and motions

Knows no ROS. One thread sends the points of the stream and measures. Services call the arm from their own threads, which the
package `sevenbot` allows. All but `stop` and `vacuum` wait until the stream has ended.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import sevenbot

from sevenbot_ros import health, opening
from sevenbot_ros.clocks import Clock, RealClock
from sevenbot_ros.events import Events, Measurement
from sevenbot_ros.interlock import Interlock
from sevenbot_ros.lead_slot import LeadSlot
from sevenbot_ros.monitor import Monitor
from sevenbot_ros.settings import Settings
from sevenbot_ros.streamer import Streamer

# Seconds between two tries to open the arm.
RETRY = 0.5


class Driver:
    """One arm, opened again and again while the node lives."""

    def __init__(self, settings: Settings, events: Events) -> None:
        self.settings = settings
        self.interlock = Interlock()
        self.leads = LeadSlot(settings, self.interlock)
        self.streamer = Streamer(settings, self.interlock, self.leads, events)
        # True if the thread ended although the node was not closing.
        self.has_failed = False
        self._events = events
        self._clock: Clock = RealClock()
        self._monitor: Monitor | None = None
        self._thread = threading.Thread(target=self._run, name="arm", daemon=True)
        self._closing = threading.Event()

    def start(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def close(self) -> None:
        """Ends the thread, makes the arm hold, and closes it."""
        self._closing.set()
        self._thread.join()

    @property
    def is_closing(self) -> bool:
        """Does the node end?"""
        return self._closing.is_set()

    @property
    def measurement(self) -> Measurement | None:
        """The last measurement; `None` while no arm answers, and before the first one."""
        monitor = self._monitor
        return None if monitor is None else monitor.last

    def arm(self) -> sevenbot.Arm:
        """The arm. Raises `sevenbot.Closed` if none answers."""
        return self.interlock.arm()

    def now(self) -> float:
        """The clock of the arm."""
        return self._clock.now()

    def standing(self) -> tuple[float, ...]:
        """The last point of the stream, or without a stream the targets of the joints, in degrees of the arm."""
        lead = self.leads.current
        return lead.point if lead is not None and lead.point is not None else opening.standing(self.arm())

    @contextmanager
    def action(self) -> Iterator[sevenbot.Arm]:
        """The arm without a stream, for a service. Commands are refused meanwhile."""
        with self.interlock.action() as arm:
            self.streamer.wait_until_closed()
            yield arm

    @contextmanager
    def motion(self) -> Iterator[sevenbot.Arm]:
        """As `action`, for a service that moves the arm: every stop ends the motion. Raises `Halted` if commands are
        refused until `hold`."""
        with self.action() as arm, self.interlock.motion():
            yield arm

    def _run(self) -> None:
        try:
            self._open_and_serve()
        finally:
            # Without this thread the node would publish nothing, so it ends.
            self.has_failed = not self._closing.is_set()
            self._events.ended()

    def _open_and_serve(self) -> None:
        last = ""
        while not self._closing.is_set():
            try:
                arm, clock = opening.open_arm(self.settings)
            except (sevenbot.Error, OSError) as error:
                if str(error) != last:
                    last = str(error)
                    self._events.changed(f"no arm yet: {last}")
                self._events.diagnosed(health.lost(last))
                self._closing.wait(RETRY)
                continue
            last = ""
            self._serve_until_lost(arm, clock)

    def _serve_until_lost(self, arm: sevenbot.Arm, clock: Clock) -> None:
        monitor = Monitor(arm, clock, self.settings.rate, self._events)
        self._clock, self._monitor = clock, monitor
        self.interlock.connect(arm)
        self._events.changed(f"the arm {arm.chip_id} answers at {arm.port}, firmware {arm.firmware}")
        try:
            # Leaving the block makes the arm hold, which fails if the arm is gone.
            with arm:
                try:
                    self._serve(arm, clock, monitor)
                finally:
                    self._disconnect()
        except sevenbot.Error as error:
            self._events.changed(f"the arm is lost: {error}")
            self._events.diagnosed(health.lost(str(error)))
            self._closing.wait(RETRY)

    def _disconnect(self) -> None:
        # Disconnect first, so that no command that comes now leads the arm after the next connection.
        self.interlock.connect(None)
        self._monitor = None
        self.leads.end(self.leads.current, "the arm is lost")
        try:
            self.streamer.close()
        except sevenbot.Error:
            # `close` drops the stream even if it raises.
            pass

    def _serve(self, arm: sevenbot.Arm, clock: Clock, monitor: Monitor) -> None:
        while not self._closing.is_set():
            self.streamer.advance(arm, clock, monitor.last)
            monitor.poll()
            clock.wait_until(min(monitor.due, self.streamer.due))
            if arm.simulation is not None:
                self._events.passed(clock.now())
