"""The action FollowJointTrajectory for the arm and for its claw, for users without ros2_control.

Its type is that of `control_msgs`, which is not on PyPI. So the server reads goals and writes results through an adapter: the published
type has one here, and tests have one for a type that can be installed.
"""

from __future__ import annotations

import importlib
import math
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import sevenbot
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.time import Duration
from trajectory_msgs.msg import JointTrajectory

from sevenbot_ros import messages
from sevenbot_ros.commands import Refusal
from sevenbot_ros.joints import NAMES, ZEROS
from sevenbot_ros.lead import Outcome, TrajectoryLead
from sevenbot_ros.node import ArmNode
from sevenbot_ros.trajectory import RawPoint, plan

# The tolerances of a goal that names none: an angle in degrees, because a loaded joint bends, and a time in seconds.
GOAL_TOLERANCE = 3.0
GOAL_TIME = 2.0
FEEDBACK_PERIOD = 0.1
# Goals at a time: each controller's, and those that replace them or wait for their start.
TRAJECTORIES = 4
# The longest wait of a goal for its start, in seconds.
LONGEST_WAIT = 30.0
# The parameters with the names of the controllers, and the joints that each of them takes.
CONTROLLERS = (("controller_name", NAMES), ("claw_controller_name", NAMES[6:]))
# The codes of `control_msgs/action/FollowJointTrajectory`.
SUCCESSFUL, INVALID_GOAL, INVALID_JOINTS, OLD_HEADER, PATH_VIOLATED, GOAL_VIOLATED = 0, -1, -2, -3, -4, -5
CODES = {Outcome.REACHED: SUCCESSFUL, Outcome.PATH: PATH_VIOLATED, Outcome.GOAL: GOAL_VIOLATED, Outcome.STOPPED: INVALID_GOAL}


@dataclass(frozen=True)
class Goal:
    """What a goal says. Tolerances are radians by joint, times seconds."""

    trajectory: JointTrajectory
    path_tolerance: dict[str, float]
    goal_tolerance: dict[str, float]
    goal_time: float


class GoalAdapter(Protocol):
    """Reads goals of an action type, and writes its feedback and results."""

    def goal(self, request: Any) -> Goal:
        """What the goal says."""

    def feedback(self, names: Sequence[str], desired: Sequence[float], actual: Sequence[float], seconds: float) -> Any:
        """The feedback, positions in radians."""

    def result(self, code: int, text: str) -> Any:
        """The result with one of the codes of FollowJointTrajectory, and a text for the user."""


class PublishedAdapter:
    """The type of `control_msgs`."""

    def __init__(self, action: Any) -> None:
        self._action = action

    def goal(self, request: Any) -> Goal:
        def tolerances(rows: Any) -> dict[str, float]:
            # 0 selects the tolerance of the server, and a negative value means no limit.
            return {row.name: math.inf if row.position < 0.0 else row.position for row in rows if row.position}

        return Goal(
            request.trajectory,
            tolerances(request.path_tolerance),
            tolerances(request.goal_tolerance),
            messages.seconds(request.goal_time_tolerance),
        )

    def feedback(self, names: Sequence[str], desired: Sequence[float], actual: Sequence[float], seconds: float) -> Any:
        message = self._action.Feedback()
        message.joint_names = list(names)
        message.desired.positions, message.actual.positions = list(desired), list(actual)
        message.error.positions = [wanted - found for wanted, found in zip(desired, actual, strict=True)]
        time_from_start = Duration(seconds=seconds).to_msg()
        message.desired.time_from_start = message.actual.time_from_start = time_from_start
        return message

    def result(self, code: int, text: str) -> Any:
        return self._action.Result(error_code=code, error_string=text)


def published_type() -> TrajectoryAction | None:
    """The action with the type of `control_msgs`; `None` if that is not installed."""
    try:
        action = importlib.import_module("control_msgs.action").FollowJointTrajectory
    except ImportError:
        return None
    return TrajectoryAction(action, PublishedAdapter(action))


class TrajectoryAction:
    """Action servers that let the driver follow a trajectory: one for each controller."""

    def __init__(self, action: Any, adapter: GoalAdapter) -> None:
        self._type, self._adapter = action, adapter
        self._lock = threading.Lock()
        self._goals = 0

    def serve(self, node: ArmNode) -> None:
        """Opens the servers."""
        self._node = node
        self._servers = [self._open(str(node.get_parameter(name).value), joints) for name, joints in CONTROLLERS]

    def _open(self, controller: str, joints: Sequence[str]) -> ActionServer:
        return ActionServer(
            self._node,
            self._type,
            f"{controller}/follow_joint_trajectory",
            execute_callback=lambda handle: self._execute(handle, joints),
            goal_callback=lambda _: self._accept(),
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup(),
        )

    def _accept(self) -> GoalResponse:
        """Accepts a goal if fewer than `TRAJECTORIES` are at work: each takes a thread of the executor until it ends."""
        with self._lock:
            if self._goals == TRAJECTORIES:
                self._node.refused(Refusal("goals", f"{TRAJECTORIES} goals are running or wait: cancel one first"))
                return GoalResponse.REJECT
            self._goals += 1
            return GoalResponse.ACCEPT

    def _execute(self, handle: ServerGoalHandle, joints: Sequence[str]) -> Any:
        try:
            return self._follow(handle, joints)
        finally:
            with self._lock:
                self._goals -= 1

    def _follow(self, handle: ServerGoalHandle, joints: Sequence[str]) -> Any:
        lead = self._begin(handle, joints)
        if isinstance(lead, Refusal):
            if handle.is_cancel_requested:
                handle.canceled()
            else:
                handle.abort()
            code = INVALID_JOINTS if lead.key == "unknown joint" else OLD_HEADER if lead.key == "old" else INVALID_GOAL
            return self._adapter.result(code, lead.text)
        while not lead.ended.wait(FEEDBACK_PERIOD):
            if handle.is_cancel_requested:
                lead.cancel()
            self._tell(handle, lead)
        if lead.outcome is Outcome.REACHED:
            handle.succeed()
        elif handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        return self._adapter.result(CODES[lead.outcome], lead.reason)

    def _begin(self, handle: ServerGoalHandle, joints: Sequence[str]) -> TrajectoryLead | Refusal:
        goal = self._adapter.goal(handle.request)
        message, driver, settings = goal.trajectory, self._node.driver, self._node.driver.settings
        if others := [name for name in message.joint_names if name not in joints]:
            text = f"this controller has no joint {', '.join(others)}: its joints are {', '.join(joints)}"
            return Refusal("unknown joint", text)
        if refusal := self._wait_for(messages.seconds(message.header.stamp), handle):
            return refusal
        try:
            standing = driver.standing()
        except sevenbot.Error as error:
            return Refusal("no arm", str(error))
        points = [
            RawPoint(messages.seconds(point.time_from_start), point.positions, point.velocities) for point in message.points
        ]
        trajectory = plan(settings.rules, message.joint_names, points, standing)
        if isinstance(trajectory, Refusal):
            return trajectory
        first = max(abs(trajectory.pose(0.0)[joint] - standing[joint]) for joint in trajectory.joints)
        if first > settings.max_jump:
            return Refusal("jump", f"the trajectory begins {first:.1f} degrees from where the arm stands")
        lead = TrajectoryLead(
            trajectory,
            settings.period,
            path_tolerance=_degrees(goal.path_tolerance),
            goal_tolerance={joint: GOAL_TOLERANCE for joint in trajectory.joints} | _degrees(goal.goal_tolerance),
            goal_time=math.inf if goal.goal_time < 0.0 else goal.goal_time or GOAL_TIME,
        )
        return driver.leads.lead(lead) or lead

    def _wait_for(self, start: float, handle: ServerGoalHandle) -> Refusal | None:
        """Waits until the start of a goal, because the trajectory has to begin where the joints stand then. A start of 0 is now.

        Returns the reason if the goal is refused.
        """
        driver = self._node.driver
        if start and self._node.seconds() - start > driver.settings.rules.max_age:
            return Refusal("old", f"the trajectory began {self._node.seconds() - start:.2f} s ago")
        if start - self._node.seconds() > LONGEST_WAIT:
            text = f"the trajectory begins in {start - self._node.seconds():.0f} s, and {LONGEST_WAIT:g} s is the limit"
            return Refusal("future", f"{text}: do both programs have the same clock (use_sim_time)?")
        while (left := start - self._node.seconds()) > 0.0:
            if handle.is_cancel_requested or driver.is_closing:
                return Refusal("cancelled", "it was cancelled before it began")
            if refusal := driver.interlock.refusal():
                return refusal
            time.sleep(min(left, 0.05))
        return None

    def _tell(self, handle: ServerGoalHandle, lead: TrajectoryLead) -> None:
        measurement, joints = self._node.driver.measurement, lead.trajectory.joints
        if measurement is None:
            return
        desired = lead.trajectory.pose(lead.time)
        handle.publish_feedback(
            self._adapter.feedback(
                [NAMES[joint] for joint in joints],
                [math.radians(desired[joint] - ZEROS[joint]) for joint in joints],
                [math.radians(measurement.positions[joint] - ZEROS[joint]) for joint in joints],
                lead.time,
            )
        )


def _degrees(tolerances: dict[str, float]) -> dict[int, float]:
    return {NAMES.index(name): math.degrees(angle) for name, angle in tolerances.items() if name in NAMES}
