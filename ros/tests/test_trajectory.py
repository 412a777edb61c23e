"""Trajectories: without ROS and without an arm."""

from __future__ import annotations

import math

import pytest
from sevenbot_ros.commands import Refusal, Rules
from sevenbot_ros.joints import NAMES
from sevenbot_ros.trajectory import RawPoint, Trajectory, plan

STANDING = (90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0)
ONE = ["joint_1"]


def made(points: list[RawPoint], names: list[str] = ONE) -> Trajectory:
    trajectory = plan(Rules(), names, points, STANDING)
    assert isinstance(trajectory, Trajectory), trajectory
    return trajectory


def refused(points: list[RawPoint], names: list[str] = ONE) -> Refusal:
    answer = plan(Rules(), names, points, STANDING)
    assert isinstance(answer, Refusal)
    return answer


def test_it_begins_where_the_joints_stand() -> None:
    trajectory = made([RawPoint(1.0, [0.2], [])])
    assert trajectory.at(0.0)[0] == 90.0
    assert trajectory.at(0.5)[0] == pytest.approx(90 + math.degrees(0.1))
    assert trajectory.at(9.0)[0] == pytest.approx(90 + math.degrees(0.2))
    assert trajectory.at(0.5)[1:] == [None] * 6


def test_speeds_make_it_smooth() -> None:
    def position(time: float) -> float:
        return 0.5 - 0.5 * math.cos(time)

    points = [RawPoint(k * 0.1, [position(k * 0.1)], [0.5 * math.sin(k * 0.1)]) for k in range(1, 32)]
    trajectory = made(points)
    for step in range(310):
        angle = trajectory.at(step / 100)[0]
        assert angle is not None
        assert math.radians(angle - 90) == pytest.approx(position(step / 100), abs=1e-5)


def test_points_are_reached_at_their_times() -> None:
    points = [RawPoint(0.1 * (k + 1), [0.01 * k, -0.01 * k], [0.1, -0.1]) for k in range(50)]
    trajectory = made(points, ["joint_4", "joint_5"])
    for point in points:
        pose = trajectory.pose(point.time)
        assert pose[3] == pytest.approx(90 + math.degrees(point.positions[0]))
        assert pose[4] == pytest.approx(90 + math.degrees(point.positions[1]))
    assert trajectory.duration == pytest.approx(5.0)


def test_what_is_refused() -> None:
    assert refused([]).key == "empty"
    assert refused([RawPoint(1.0, [0.1], []), RawPoint(1.0, [0.2], [])]).key == "times"
    assert refused([RawPoint(math.nan, [0.1], [])]).key == "times"
    assert refused([RawPoint(1.0, [math.nan], [])]).key == "NaN"
    assert refused([RawPoint(1.0, [0.1, math.nan], [])], ["joint_1", "joint_2"]).key == "NaN joint_2"
    assert refused([RawPoint(1.0, [0.1], [math.nan])]).key == "velocities"
    assert refused([RawPoint(1.0, [0.1], [0.1, 0.2])]).key == "velocities"
    assert refused([RawPoint(1.0, [0.1], [])], ["elbow"]).key == "unknown joint"
    second = refused([RawPoint(1.0, [0.1], []), RawPoint(2.0, [3.0], [])])
    assert second.key == "range joint_1" and second.text.startswith("point 1:")
    assert refused([RawPoint(1.0, [1.0, 1.0], [])], list(NAMES[1:3])).key == "linkage"
