"""What leads the arm: commands as they come, or a trajectory. The streamer asks for each point of the stream.

Knows neither ROS nor the arm. Angles are degrees of the arm.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from enum import Enum
from typing import Protocol

from sevenbot_ros.commands import Refusal, Targets
from sevenbot_ros.events import Measurement
from sevenbot_ros.follower import Follower
from sevenbot_ros.joints import NAMES
from sevenbot_ros.settings import Settings
from sevenbot_ros.trajectory import Trajectory

# The longest time from the sending of a point to a measurement of the joint there: two periods, a cycle of the controller (10 ms),
# and the age of the measurement (a cycle). `LAG` is the two cycles, in seconds.
LAG_PERIODS = 2
LAG = 0.02
# The most commands that are kept while the stream opens, which takes about 0.1 s. Older ones are dropped.
LONGEST_QUEUE = 100


class Lead(Protocol):
    """Tells the points of a stream."""

    @property
    def point(self) -> tuple[float, ...] | None:
        """The angles of all joints at the last point; `None` before the beginning."""

    def begin(self, standing: Sequence[float]) -> None:
        """Called when this begins to lead. `standing` is where the joints stand, or the last point of a stream that is open."""

    def next(self, steps: int, measurement: Measurement | None) -> list[float | None] | None:
        """The point this many periods after the last one, 0 for the first. `None` ends the stream."""

    def refusal(self) -> Refusal | None:
        """What was refused since the last call."""

    def end(self, reason: str) -> None:
        """Called when this leads no more, for this reason. Has no effect if the lead has ended by itself."""

    def gives_way_to(self, other: Lead) -> bool:
        """May this one end so that the other leads the arm?"""


class CommandLead:
    """Follows commands, and ends after a while without one."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._lock = threading.Lock()
        self._pending: list[Targets] = []
        self._follower: Follower | None = None
        self._refusal: Refusal | None = None
        self._silence = 0
        self.point: tuple[float, ...] | None = None

    def command(self, targets: Targets) -> None:
        """Queues these targets. The next point takes all queued targets in turn, because each is compared with the one before."""
        with self._lock:
            self._pending = [*self._pending, targets][-LONGEST_QUEUE:]

    def begin(self, standing: Sequence[float]) -> None:
        settings = self._settings
        self.point = tuple(standing)
        self._follower = Follower(
            standing, jump=settings.jump, max_jump=settings.max_jump, approach_speed=settings.approach_speed
        )

    def next(self, steps: int, measurement: Measurement | None) -> list[float | None] | None:
        if self._follower is None or self.point is None:
            return None
        with self._lock:
            pending, self._pending = self._pending, []
        self._silence = 0 if pending else self._silence + max(steps, 1)
        for targets in pending:
            self._refusal = self._follower.take(targets) or self._refusal
        is_silent = self._silence * self._settings.period >= max(self._settings.watchdog, 2 * self._settings.period)
        if is_silent and not self._follower.is_approaching:
            return None
        point = self._follower.advance(steps * self._settings.period)
        self.point = tuple(at if angle is None else angle for at, angle in zip(self.point, point, strict=True))
        return point

    def refusal(self) -> Refusal | None:
        refusal, self._refusal = self._refusal, None
        return refusal

    def end(self, reason: str) -> None:
        pass

    def gives_way_to(self, other: Lead) -> bool:
        return True


class Outcome(Enum):
    """How a trajectory ended."""

    REACHED = "reached"
    PATH = "path tolerance"
    GOAL = "goal tolerance"
    STOPPED = "stopped"


class TrajectoryLead:
    """Follows a trajectory, and waits until the joints arrive."""

    def __init__(
        self,
        trajectory: Trajectory,
        period: float,
        *,
        path_tolerance: dict[int, float],
        goal_tolerance: dict[int, float],
        goal_time: float,
    ) -> None:
        self.trajectory = trajectory
        self._period = period
        self._path_tolerance, self._goal_tolerance = path_tolerance, goal_tolerance
        self._goal_time = goal_time
        self._steps = 0
        self._is_cancelled = False
        self.point: tuple[float, ...] | None = None
        self.ended = threading.Event()
        self.outcome = Outcome.STOPPED
        self.reason = ""

    @property
    def time(self) -> float:
        """The time of the last point."""
        return self._steps * self._period

    def cancel(self) -> None:
        """End at the next point."""
        self._is_cancelled = True

    def begin(self, standing: Sequence[float]) -> None:
        self.point = self.trajectory.pose(0.0)

    def next(self, steps: int, measurement: Measurement | None) -> list[float | None] | None:
        if self._is_cancelled:
            self._finish(Outcome.STOPPED, "it was cancelled")
        self._steps += steps
        if measurement is not None:
            self._compare(measurement)
        if self.ended.is_set():
            return None
        self.point = self.trajectory.pose(self.time)
        return self.trajectory.at(self.time)

    def _compare(self, measurement: Measurement) -> None:
        behind = self.trajectory.pose(self.time - LAG_PERIODS * self._period - LAG)
        if self.time <= self.trajectory.duration:
            if late := self._outside(measurement, behind, self._path_tolerance):
                self._finish(Outcome.PATH, late)
            return
        late = self._outside(measurement, self.trajectory.pose(self.time), self._goal_tolerance)
        if not late:
            self._finish(Outcome.REACHED, "")
        elif self.time > self.trajectory.duration + self._goal_time:
            self._finish(Outcome.GOAL, late)

    def _outside(self, measurement: Measurement, pose: Sequence[float], tolerance: dict[int, float]) -> str:
        far = [
            f"{NAMES[joint]} is {abs(measurement.positions[joint] - pose[joint]):.2f} degrees off"
            for joint in self.trajectory.joints
            if abs(measurement.positions[joint] - pose[joint]) > tolerance.get(joint, float("inf"))
        ]
        return ", ".join(far)

    def refusal(self) -> Refusal | None:
        return None

    def end(self, reason: str) -> None:
        if not self.ended.is_set():
            self._finish(Outcome.STOPPED, reason)

    def gives_way_to(self, other: Lead) -> bool:
        # The controllers of arm and claw do not replace each other's trajectories.
        is_apart = isinstance(other, TrajectoryLead) and not {*self.trajectory.joints} & {*other.trajectory.joints}
        return self.ended.is_set() or not is_apart

    def _finish(self, outcome: Outcome, reason: str) -> None:
        self.outcome, self.reason = outcome, reason
        self.ended.set()
