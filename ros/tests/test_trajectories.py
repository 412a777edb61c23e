"""Trajectories of a planner: as an action, and as the commands of ros2_control's topic interface."""

from __future__ import annotations

import math
import signal
from collections.abc import Callable
from typing import Any

import pytest
from client import Client, seconds_of
from conftest import Start
from rclpy.action import ActionClient
from sensor_msgs.msg import JointState
from sevenbot_ros.joints import NAMES
from stand_in import BEGIN, JOINTS, POINTS, STEP, planned
from test_msgs.action import Fibonacci

Clients = Callable[..., Client]
Report = Callable[[str], None]


def distance_to_path(state: JointState, times: list[float]) -> float:
    """The distance of the furthest joint from the nearest pose of the path, in degrees."""
    angles = dict(zip(state.name, state.position, strict=True))
    found = [angles[name] for name in JOINTS]
    return min(
        max(abs(math.degrees(a - b)) for a, b in zip(planned(time)[0], found, strict=True)) for time in times
    )


TIMES = [number * STEP for number in range(POINTS + 1)]


def along_path(states: list[JointState]) -> str:
    """Checks how far from the path the joints were, and describes it. On a busy machine a late command makes the arm cut a corner
    of the path."""
    off = sorted(distance_to_path(state, TIMES) for state in states)
    usual, worst = off[len(off) * 95 // 100], off[-1]
    assert usual < 1.0 and worst < 3.0, (usual, worst)
    return f"95 of 100 states within {usual:.2f} degrees of the path, all within {worst:.2f}"


def arm_action(client: Clients) -> tuple[Client, ActionClient]:
    """A connected client, and its access to the action of the arm."""
    leading = client(simulated_time=True)
    leading.connect()
    server = ActionClient(leading.node, Fibonacci, "arm_controller/follow_joint_trajectory")
    leading.until(server.server_is_ready, "the action")
    return leading, server


def goal(client: Client, server: ActionClient, order: int, feedback: list[Any]) -> Any:
    """Sends a goal. Returns its handle, which tells whether the goal was accepted."""
    sent = server.send_goal_async(
        Fibonacci.Goal(order=order), feedback_callback=lambda message: feedback.append(message.feedback.sequence)
    )
    client.until(sent.done, "the goal")
    return sent.result()


def result(client: Client, handle: Any) -> tuple[int, int]:
    """The state of the goal, and the code of its result."""
    future = handle.get_result_async()
    client.until(future.done, "the result", timeout=90.0)
    return future.result().status, future.result().result.sequence[0]


def test_an_action_of_500_points(start: Start, client: Clients, report: Report) -> None:
    node = start.node(module="stand_in", rate=100, real_time_factor=2)
    leading, server = arm_action(client)
    for order, code in ((2, -2), (3, -1)):
        assert result(leading, goal(leading, server, order, [])) == (6, code)
    assert result(leading, goal(leading, server, 4, [])) == (4, 0), node.text()
    leading.until(lambda: distance_to_path(leading.states[-1], [0.0]) < 0.6, "rest at the begin of the path")
    feedback: list[Any] = []
    leading.states.clear()
    handle = goal(leading, server, 1, feedback)
    assert result(leading, handle) == (4, 0), node.text()
    report(f"a trajectory of {POINTS} points as an action: {along_path(leading.states)}")
    assert len(leading.states) > 100 and len(feedback) > 10
    # The arm stays where it was when the trajectory is cancelled.
    handle = goal(leading, server, 1, feedback)
    leading.until(lambda: abs(leading.degrees()[0]) > 10.0, "motion")
    cancelled = handle.cancel_goal_async()
    leading.until(cancelled.done, "the answer to the cancellation")
    assert result(leading, handle)[0] == 5
    settled = leading.seconds() + 1.0
    leading.until(lambda: leading.seconds() > settled, "time")
    standing = leading.degrees()[0]
    leading.until(lambda: leading.seconds() > settled + 1.0, "time")
    assert leading.degrees()[0] == pytest.approx(standing, abs=0.3)
    server.destroy()


def test_a_stop_is_served_while_goals_wait_for_their_start(start: Start, client: Clients) -> None:
    node = start.node(module="stand_in")
    leading, server = arm_action(client)
    begin = leading.seconds()
    waiting = [goal(leading, server, 7, []) for _ in range(4)]
    assert all(handle.accepted for handle in waiting)
    assert not goal(leading, server, 4, []).accepted, "each goal takes a thread"
    cancelled = waiting[0].cancel_goal_async()
    leading.until(cancelled.done, "the answer to the cancellation")
    assert result(leading, waiting[0])[0] == 5
    assert leading.call("stop")[0]
    assert leading.seconds() - begin < 20.0, "it did not wait for the start of the goals"
    assert [result(leading, handle) for handle in waiting[1:]] == [(6, -1)] * 3
    assert leading.call("hold")[0]
    goal(leading, server, 7, [])
    server.destroy()
    assert node.end(signal.SIGINT) == 0


def test_a_goal_begins_where_the_arm_stands_at_its_start(start: Start, client: Clients) -> None:
    node = start.node(module="stand_in")
    leading, server = arm_action(client)
    assert leading.call("home")[0]
    assert result(leading, goal(leading, server, 4, [])) == (4, 0), node.text()
    leading.states.clear()
    later, way = goal(leading, server, 6, []), goal(leading, server, 1, [])
    assert result(leading, way) == (6, -1) and "another one replaces it" in node.text()
    assert result(leading, later) == (4, 0), node.text()
    fastest = max(abs(math.degrees(speed)) for state in leading.states for speed in state.velocity[:6])
    assert 10.0 < fastest < 70.0, "it leaps at 114 degrees a second"
    server.destroy()


def test_the_claw_has_an_action_of_its_own(start: Start, client: Clients) -> None:
    node = start.node(module="stand_in", real_time_factor=2)
    leading = client(simulated_time=True)
    leading.connect()
    arm, claw = (
        ActionClient(leading.node, Fibonacci, f"{name}/follow_joint_trajectory")
        for name in ("arm_controller", "claw_controller")
    )
    leading.until(lambda: arm.server_is_ready() and claw.server_is_ready(), "the actions")
    assert result(leading, goal(leading, claw, 4, [])) == (6, -2)
    assert "this controller has no joint joint_1" in node.text()
    # A trajectory of the claw does not end one of the arm.
    way = goal(leading, arm, 4, [])
    leading.until(lambda: leading.degrees()[2] < -5.0, "motion of the arm")
    assert result(leading, goal(leading, claw, 5, [])) == (6, -1)
    assert "a trajectory of other joints is running" in node.text()
    assert result(leading, way) == (4, 0), node.text()
    assert result(leading, goal(leading, claw, 5, [])) == (4, 0), node.text()
    # The states that a busy client has heard may be older than the result.
    leading.until(lambda: leading.degrees()[6] == pytest.approx(60.0, abs=3.5), "the claw where the trajectory ends")
    arm.destroy()
    claw.destroy()


def test_the_topic_interface_of_ros2_control(start: Start, client: Clients, report: Report) -> None:
    """What the published plugin sends with a threshold of -1: all joints, in each cycle of 50 Hz, with NaN before a controller is
    active, and the last target while it rests."""
    # Slow motion, so that a busy machine does not make the client late.
    node = start.node(real_time_factor=0.5, publish_joint_states=False, jump="approach")
    leading = client(simulated_time=True)
    leading.connect()
    leading.each(0.02, 25, lambda _: leading.send([math.nan] * 7))
    leading.until(lambda: "is a controller active?" in node.text(), "a warning")
    # A controller that becomes active holds the measured positions.
    standing = leading.degrees()
    leading.each(0.02, 10, lambda _: leading.send(standing))

    def at_begin() -> bool:
        leading.send(dict(zip(JOINTS, BEGIN, strict=True)))
        return distance_to_path(leading.states[-1], [0.0]) < 0.6

    leading.until(at_begin, "the begin of the path")

    def send(index: int) -> None:
        if index == 25:
            leading.states.clear()
        number = min(index * 2, POINTS)
        positions = dict(zip(JOINTS, planned(number * STEP)[0], strict=True))
        targets = [math.degrees(positions.get(name, math.radians(at))) for name, at in zip(NAMES, standing, strict=True)]
        leading.send(targets)

    leading.each(0.02, POINTS // 2 + 50, send)
    report(f"the same path as commands of the topic interface, twice as fast: {along_path(leading.states)}")
    # The watchdog of the arm did not act while the controller rested, and the node did not complain.
    assert "the arm holds" not in node.text()
    assert leading.degrees()[0] == pytest.approx(math.degrees(planned(POINTS * STEP)[0][0]), abs=1.0)
    assert not leading.joint_states
    assert seconds_of(leading.states[-1]) > seconds_of(leading.states[0])
