"""The arm of a node: the thread that measures and leads it, and what services ask of it.

    commands, goals ──▶ Driver ──▶ thread: stream ──▶ Arm ──▶ Events: states, health, clock
    services ─────────▶ actions, in the threads of their callers

Knows no ROS. One thread sends the points of the stream and measures; services call the arm from their own threads, which the package
`sevenbot` allows, after the stream has ended.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol

import sevenbot

from sevenbot_ros import health, opening
from sevenbot_ros.clocks import Clock, RealClock
from sevenbot_ros.commands import Refusal, Rules, Targets
from sevenbot_ros.follower import Jump
from sevenbot_ros.lead import CommandLead, Lead

# Seconds between two tries to open the arm, and between two short reads of its health.
RETRY = 0.5
HEALTH_PERIOD = 0.3
# The stream is asked this much before a point is due, and waits the rest itself.
MARGIN = 0.002


@dataclass(frozen=True)
class Settings:
    """What the parameters of the node say. Times are seconds, angles degrees."""

    port: str = ""
    id: int = -1
    chip: str = ""
    rate: float = 50.0
    period: float = 0.02
    watchdog: float = 0.3
    jump: Jump = Jump.REFUSE
    max_jump: float = 5.0
    approach_speed: float = 30.0
    real_time_factor: float = 1.0
    seed: int = 1
    rules: Rules = field(default_factory=Rules)


@dataclass(frozen=True)
class Measurement:
    """Degrees of the arm, degrees a second, percent of the stall torque, and the greatest age in seconds."""

    positions: tuple[float, ...]
    velocities: tuple[float, ...]
    loads: tuple[float, ...]
    age: float
    time: float


class Events(Protocol):
    """What the driver tells. All calls come from its thread."""

    def measured(self, measurement: Measurement) -> None:
        """The joints were measured."""

    def diagnosed(self, diagnosis: health.Health) -> None:
        """The health was read."""

    def passed(self, simulated: float) -> None:
        """Simulated time passed."""

    def refused(self, refusal: Refusal) -> None:
        """A command is refused."""

    def changed(self, text: str) -> None:
        """Something happened that a user wants to read."""

    def ended(self) -> None:
        """The thread ends."""


class Halted(sevenbot.Error):
    """Commands and motions are refused until `hold`."""


class Driver:
    """One arm, opened again and again while the node lives."""

    def __init__(self, settings: Settings, events: Events) -> None:
        self.settings = settings
        self._events = events
        self._thread = threading.Thread(target=self._run, name="arm", daemon=True)
        self._closing = threading.Event()
        self._lock = threading.RLock()
        self._idle = threading.Condition(self._lock)
        self._arm: sevenbot.Arm | None = None
        self._clock: Clock = RealClock()
        self._stream: sevenbot.Stream | None = None
        self._lead: Lead | None = None
        # Why commands are refused until `hold`, and how often the arm was stopped.
        self._halted: str | None = None
        self._stop_count = 0
        self._actions = 0
        # Did the thread end by an error of this program?
        self.has_failed = False
        # Services that make the arm hold while its stream is still open.
        self._stops = 0
        # What leads the open stream, and how many periods it was late at its last point.
        self._led: Lead | None = None
        self._skipped = 1
        self._next_point = 0.0
        self._last_number: int | None = None
        self._measurement: Measurement | None = None
        self._blocks: list[list[int]] = []
        self._errors_before: int | None = None

    def start(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def close(self) -> None:
        """Ends the thread, and closes the arm, which holds."""
        self._closing.set()
        self._thread.join()

    @property
    def measurement(self) -> Measurement | None:
        """The last one; `None` while no arm answers."""
        return self._measurement

    def command(self, targets: Targets) -> Refusal | None:
        """Follow these targets. Other refusals, such as that of a jump, come as an event."""
        with self._lock:
            if refusal := self._refusal():
                return refusal
            if self._lead is not None and not isinstance(self._lead, CommandLead):
                return Refusal("trajectory", "a trajectory is running: cancel it first")
            if self._lead is None:
                self._lead = CommandLead(self.settings)
            self._lead.command(targets)
            return None

    def lead(self, lead: Lead) -> Refusal | None:
        """Be led by this from the next point on."""
        with self._lock:
            if refusal := self._refusal():
                return refusal
            if self._lead is not None:
                if not self._lead.gives_way_to(lead):
                    return Refusal("busy", "a trajectory of other joints is running: wait for its end, or cancel it")
                self._lead.end("another one replaces it")
            self._lead = lead
            return None

    def _refusal(self) -> Refusal | None:
        if self._arm is None:
            return Refusal("no arm", "no arm answers")
        if self._halted is not None:
            return Refusal("halted", _until_hold(self._halted))
        if self._actions:
            return Refusal("busy", "a service moves the arm")
        return None

    def standing(self) -> tuple[float, ...]:
        """Where the joints stand, or the last point of the stream, in degrees of the arm."""
        with self._lock:
            lead = self._lead
        return lead.point if lead is not None and lead.point is not None else opening.standing(self.arm())

    def arm(self) -> sevenbot.Arm:
        """The arm. Raises `sevenbot.Closed` if none answers."""
        arm = self._arm
        if arm is None:
            raise sevenbot.Closed("no arm answers")
        return arm

    def now(self) -> float:
        """The clock of the arm."""
        return self._clock.now()

    def check_halted(self) -> None:
        """Raises `Halted` if commands are refused until `hold`."""
        halted = self._halted
        if halted is not None:
            raise Halted(_until_hold(halted))

    def halt(self, reason: str) -> None:
        """Refuse all commands for this reason, until `release`."""
        with self._lock:
            self._halted = reason

    @property
    def stop_count(self) -> int:
        """How often the arm was stopped so far."""
        return self._stop_count

    def release(self, stop_count: int) -> None:
        """Takes commands again. Raises `Halted` if the arm was stopped since this count."""
        with self._lock:
            if self._stop_count == stop_count:
                self._halted = None
        self.check_halted()

    def stop(self, reason: str) -> list[int]:
        """Makes the arm hold at once, also in the middle of a stream, and refuses commands for this reason."""
        arm = self.arm()
        with self._lock:
            self._halted = reason
            self._stop_count += 1
            self._stops += 1
        try:
            return arm.stop()
        finally:
            with self._lock:
                self._stops -= 1

    @contextmanager
    def action(self) -> Iterator[sevenbot.Arm]:
        """The arm without a stream, for a service. Commands are refused meanwhile."""
        arm = self.arm()
        with self._idle:
            self._actions += 1
        try:
            with self._idle:
                if not self._idle.wait_for(lambda: self._stream is None, timeout=5.0):
                    raise sevenbot.Interrupted("the stream does not end")
            yield arm
        finally:
            with self._idle:
                self._actions -= 1

    def _run(self) -> None:
        try:
            self._open_and_serve()
        finally:
            # Without this thread the node would be silent.
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
        self._connect(arm, clock)
        try:
            # To leave the block makes the arm hold, which fails where it is gone.
            with arm:
                try:
                    self._serve(arm, clock)
                finally:
                    self._disconnect()
        except sevenbot.Error as error:
            self._events.changed(f"the arm is lost: {error}")
            self._events.diagnosed(health.lost(str(error)))
            self._closing.wait(RETRY)

    def _connect(self, arm: sevenbot.Arm, clock: Clock) -> None:
        with self._lock:
            self._arm, self._clock = arm, clock
            self._blocks, self._errors_before = [], None
        self._events.changed(f"the arm {arm.chip_id} answers at {arm.port}, firmware {arm.firmware}")

    def _disconnect(self) -> None:
        # First, so that no command of this time leads the arm after the next connection.
        with self._lock:
            self._arm = self._measurement = None
        try:
            self._drop(self._lead, "the arm is lost")
            self._close_stream()
        except sevenbot.Error:
            # The stream is forgotten all the same.
            pass

    def _serve(self, arm: sevenbot.Arm, clock: Clock) -> None:
        next_state = next_health = clock.now()
        while not self._closing.is_set():
            self._advance(arm, clock)
            now = clock.now()
            if now >= next_state:
                self._measure(arm, clock)
                next_state = _next(next_state, 1.0 / self.settings.rate, clock.now())
            if now >= next_health:
                self._examine(arm)
                next_health = _next(next_health, HEALTH_PERIOD, clock.now())
            next_point = self._next_point - MARGIN if self._stream is not None else next_state
            clock.wait_until(min(next_state, next_point))
            if arm.simulation is not None:
                self._events.passed(clock.now())

    def _advance(self, arm: sevenbot.Arm, clock: Clock) -> None:
        """Sends a point if one is due."""
        with self._lock:
            lead, stopped = self._lead, self._halted or ("a service moves the arm" if self._actions else None)
            if stopped:
                self._lead = None
        if lead is not None and stopped:
            lead.end(stopped)
        if lead is None or stopped:
            # A stop ends the stream itself. To close it would wait until the stop has ended.
            if not self._stops:
                self._close_stream()
            return
        if self._stream is None:
            self._begin_stream(arm, lead)
        elif lead is not self._led:
            lead.begin(self._led.point if self._led and self._led.point else opening.standing(arm))
            self._led, self._last_number = lead, None
        if self._stream is not None and clock.now() >= self._next_point - MARGIN:
            self._send(self._stream, lead, clock)

    def _begin_stream(self, arm: sevenbot.Arm, lead: Lead) -> None:
        settings = self.settings
        try:
            lead.begin(opening.standing(arm))
            stream = arm.stream(settings.period, watchdog=settings.watchdog, guard=False)
            stream.__enter__()
        except (sevenbot.PortError, sevenbot.Closed):
            raise
        except sevenbot.Error as error:
            self._give_up(error)
        else:
            self._stream, self._led = stream, lead
            self._next_point, self._last_number = 0.0, None

    def _send(self, stream: sevenbot.Stream, lead: Lead, clock: Clock) -> None:
        point = lead.next(self._steps(), self._measurement)
        if refusal := lead.refusal():
            self._events.refused(refusal)
        if point is None:
            self._drop(lead, "it has ended")
            return
        if all(angle is None for angle in point):
            self._next_point = clock.now() + self.settings.period
            return
        try:
            number = stream.send(point)
        except (sevenbot.PortError, sevenbot.Closed):
            raise
        except sevenbot.Error as error:
            self._give_up(error)
        else:
            self._skipped = 1 if self._last_number is None else max(number - self._last_number, 1)
            self._last_number = number
            self._next_point = clock.now() + self.settings.period

    def _steps(self) -> int:
        """How many periods after the last point the next one is."""
        return 0 if self._last_number is None else self._skipped

    def _give_up(self, error: sevenbot.Error) -> None:
        with self._lock:
            if self._halted is None:
                # The lines after the first are hints.
                self._halted = str(error).partition("\n")[0]
                self._events.changed(f"the arm holds: {error}")
        self._drop(self._lead, str(error))

    def _drop(self, lead: Lead | None, reason: str) -> None:
        """Ends what leads the arm, and the stream if nothing else leads it meanwhile."""
        if lead is not None:
            lead.end(reason)
        with self._lock:
            if self._lead is lead:
                self._lead = None
            is_led = self._lead is not None
        if not is_led and not self._stops:
            self._close_stream()

    def _close_stream(self) -> None:
        stream = self._stream
        if stream is None:
            return
        try:
            # The kind of an exception: do not wait until the joints stand.
            stream.__exit__(sevenbot.Interrupted, None, None)
        finally:
            with self._idle:
                self._stream = None
                self._idle.notify_all()

    def _measure(self, arm: sevenbot.Arm, clock: Clock) -> None:
        seen = arm.observe()
        positions, velocities, loads = (
            tuple(float(value) for value in row) for row in (seen.positions, seen.velocities, seen.loads)
        )
        self._measurement = Measurement(positions, velocities, loads, seen.age, clock.now())
        self._events.measured(self._measurement)

    def _examine(self, arm: sevenbot.Arm) -> None:
        """Reads one block of the health, and tells it after the last one: a longer read would delay a point of the stream."""
        self._blocks.append(arm.get(health.BLOCKS[len(self._blocks)]))
        if len(self._blocks) < len(health.BLOCKS):
            return
        motor, protection, status = self._blocks
        errors = health.bus_errors(status)
        before = errors if self._errors_before is None else self._errors_before
        self._events.diagnosed(health.of_registers(motor, protection, status, before))
        self._blocks, self._errors_before = [], errors


def _until_hold(reason: str) -> str:
    return f"{reason}: call the service `hold` to move again"


def _next(due: float, period: float, now: float) -> float:
    """The next time on the grid that is not past."""
    due += period
    return due if due > now else now
