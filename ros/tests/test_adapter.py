"""The adapter of the published action: its type is not on PyPI, so classes with its fields stand for it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import pytest
from builtin_interfaces.msg import Duration
from sevenbot_ros.trajectory_action import PublishedAdapter, published_type
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint


@dataclass
class Tolerance:
    name: str
    position: float


@dataclass
class Request:
    trajectory: JointTrajectory = field(default_factory=lambda: JointTrajectory(joint_names=["joint_1"]))
    path_tolerance: list[Tolerance] = field(default_factory=list)
    goal_tolerance: list[Tolerance] = field(default_factory=list)
    goal_time_tolerance: Duration = field(default_factory=Duration)


@dataclass
class Feedback:
    joint_names: list[str] = field(default_factory=list)
    desired: JointTrajectoryPoint = field(default_factory=JointTrajectoryPoint)
    actual: JointTrajectoryPoint = field(default_factory=JointTrajectoryPoint)
    error: JointTrajectoryPoint = field(default_factory=JointTrajectoryPoint)


@dataclass
class Result:
    error_code: int
    error_string: str


class Action:
    Feedback: Any = Feedback
    Result: Any = Result


def test_a_goal_is_read() -> None:
    request = Request(
        path_tolerance=[Tolerance("joint_1", 0.1), Tolerance("joint_2", -1.0)],
        goal_tolerance=[Tolerance("joint_1", 0.0)],
        goal_time_tolerance=Duration(sec=1, nanosec=500_000_000),
    )
    goal = PublishedAdapter(Action()).goal(request)
    # 0 selects the default of the server, and a negative number means no limit.
    assert goal.path_tolerance == {"joint_1": 0.1, "joint_2": math.inf} and goal.goal_tolerance == {}
    assert goal.goal_time == 1.5 and goal.trajectory.joint_names == ["joint_1"]


def test_feedback_and_results_are_written() -> None:
    adapter = PublishedAdapter(Action())
    feedback = adapter.feedback(["joint_1"], [0.5], [0.4], 1.25)
    assert feedback.joint_names == ["joint_1"]
    assert list(feedback.error.positions) == pytest.approx([0.1])
    assert feedback.desired.time_from_start == Duration(sec=1, nanosec=250_000_000)
    assert adapter.result(-4, "late") == Result(-4, "late")


def test_without_control_msgs_there_is_no_action() -> None:
    assert published_type() is None
