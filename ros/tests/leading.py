"""Leads the arm through a node by commands, and reads what the node tells of the arm."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from client import Client, seconds_of
from conftest import Program
from diagnostic_msgs.msg import KeyValue

# The standard pose, in degrees of the model.
HOME = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 80.0]


def values(client: Client) -> list[KeyValue]:
    """The values of the newest diagnosis; none before the first one."""
    return client.diagnostics[-1].status[0].values if client.diagnostics else []


def level(client: Client) -> tuple[int, str]:
    """The level and the message of the newest diagnosis."""
    status = client.diagnostics[-1].status[0]
    return status.level[0], status.message


def healthy(client: Client) -> None:
    """Waits until a new diagnosis tells of no error."""
    client.diagnostics.clear()
    client.until(lambda: client.diagnostics and level(client)[0] < 2, "health")


def lead(client: Client, node: Program, send: Callable[[], None], is_there: Callable[[], bool]) -> None:
    """Sends commands until the joints are there. The servos of the emulator answer late on a busy machine: then the arm holds,
    and this function calls `hold`, so that commands are taken again."""
    held = 0

    def go() -> bool:
        nonlocal held
        send()
        if (count := node.text().count("the arm holds")) > held:
            held = count
            hold(client)
        return is_there()

    client.until(go, "motion")


def hold(client: Client) -> None:
    """Calls `hold` until all servos answer it."""

    def holds() -> bool:
        healthy(client)
        success, text = client.call("hold")
        assert success or is_silence(text), text
        return success

    client.until(holds, "hold")


def is_silence(text: str) -> bool:
    """Does this tell of servos that do not answer, and of nothing else?"""
    problem = text.splitlines()[0]
    return "does not answer" in problem or "no servo answers" in problem


def bus_errors(client: Client) -> int:
    """The errors of the servo bus in the newest diagnosis."""
    return next(int(value.value) for value in values(client) if value.key == "errors of the servo bus")


def state_now(client: Client) -> list[float]:
    """The positions of a state that was measured after this call, in degrees of the model."""
    now = client.seconds()
    client.until(lambda: seconds_of(client.states[-1]) > now, "a new state")
    return client.degrees()


def moving(client: Client, node: Program) -> None:
    """Sends commands that move joint 1, until it has left its place."""
    begin = client.seconds()
    client.until(lambda: client.degrees()[0] == pytest.approx(0.0, abs=1.0))

    def send() -> None:
        client.send({"joint_1": min((client.seconds() - begin) * 8.0, 60.0)})

    lead(client, node, send, lambda: client.degrees()[0] > 10.0)
