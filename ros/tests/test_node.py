"""The node with real rclpy: states, commands, services and faults."""

from __future__ import annotations

import math
import os
import signal
import statistics
import time
from collections.abc import Callable

import pytest
import sevenbot
from client import Client, seconds_of
from conftest import Start
from leading import HOME, healthy, hold, level, moving, values
from sevenbot_ros.joints import NAMES, PASSIVE

Report = Callable[[str], None]
Clients = Callable[..., Client]
KINDS = pytest.mark.parametrize("kind", ["simulator", "image"])


def stamp_gaps(client: Client) -> list[float]:
    """The seconds from stamp to stamp of the states."""
    stamps = [seconds_of(state) for state in client.states]
    return [later - earlier for earlier, later in zip(stamps, stamps[1:], strict=False)]


@pytest.mark.parametrize("rate", [50, 100])
def test_states_come_at_their_rate_in_simulated_time(start: Start, client: Clients, rate: int) -> None:
    # Slow motion, so that a busy client misses none.
    start.node(rate=float(rate), real_time_factor=0.25)
    hearing = client(simulated_time=True)
    hearing.connect()
    hearing.states.clear()
    hearing.until(lambda: len(hearing.states) >= rate, "states")
    gaps = stamp_gaps(hearing)
    assert min(gaps) > 0.0
    # A busy machine slows the time of the arm, and may lose states on their way: neither changes the median.
    assert statistics.median(gaps) == pytest.approx(1.0 / rate, rel=0.01)


@pytest.mark.parametrize(("kind", "rate"), [("simulator", 50), ("simulator", 100), ("image", 50)])
def test_states_come_at_their_rate(start: Start, client: Clients, report: Report, kind: str, rate: int) -> None:
    start.arm(kind)
    start.node(start.link, rate=float(rate))
    hearing = client()
    hearing.connect()
    hearing.states.clear()
    arrivals: list[float] = []

    def heard() -> bool:
        while len(arrivals) < len(hearing.states):
            arrivals.append(hearing.seconds())
        return len(hearing.states) >= 4 * rate

    hearing.until(heard, "states")
    gaps = [(later - earlier) * 1000 for earlier, later in zip(arrivals, arrivals[1:], strict=False)]
    report(
        f"states of the {kind} at {rate} Hz: median {statistics.median(gaps):.1f} ms, worst {max(gaps):.1f} ms between two, "
        f"{len(gaps)} of them on this machine as busy as it was"
    )
    between = stamp_gaps(hearing)
    assert min(between) >= 0.0
    # A busy machine makes states late, never early.
    assert statistics.fmean(between) > 0.9 / rate
    assert hearing.degrees() == pytest.approx(HOME, abs=2.0)


def test_what_a_client_sees(start: Start, client: Clients) -> None:
    start.node()
    hearing = client(simulated_time=True)
    hearing.connect()
    hearing.until(lambda: hearing.tips and hearing.joint_states and hearing.diagnostics and hearing.descriptions)
    state = hearing.joint_states[-1]
    assert state.name == [*NAMES, *(name for name, _, _ in PASSIVE)]
    angles = dict(zip(state.name, state.position, strict=True))
    assert angles["elbow"] == pytest.approx(-angles["joint_2"])
    assert len(state.velocity) == len(state.effort) == len(state.name)
    assert hearing.states[-1].name == list(NAMES)
    tip = hearing.tips[-1]
    assert tip.header.frame_id == "base_link"
    # The straight pose: the disc in front of the arm.
    assert [tip.pose.position.x, tip.pose.position.y] == pytest.approx([0.250, 0.0], abs=0.01)
    assert tip.pose.orientation.w == pytest.approx(1.0, abs=0.01)
    assert "<param name=\"joint_commands_topic\">/robot_joint_command</param>" in hearing.descriptions[-1]
    assert level(hearing) == (0, "healthy")
    # The client uses the clock of the simulated arm.
    assert abs(hearing.seconds() - seconds_of(hearing.states[-1])) < 1.0


def test_a_sine_is_followed_and_a_stop_ends_it(start: Start, client: Clients, report: Report) -> None:
    # Slow motion, so that a busy machine does not make the client late.
    start.node(real_time_factor=0.25)
    leading = client(simulated_time=True)
    leading.connect()
    begin = leading.seconds()
    lag = 0.055

    def wanted(seconds: float) -> float:
        return 8.0 * (1.0 - math.cos(seconds * math.pi))

    leading.states.clear()
    leading.each(0.02, 150, lambda _: leading.send([wanted(leading.seconds() - begin), *HOME[1:]]))
    errors = [
        math.degrees(state.position[0]) - wanted(seconds_of(state) - begin - lag)
        for state in leading.states
        if seconds_of(state) > begin + 0.5
    ]
    rms = math.sqrt(statistics.fmean(error**2 for error in errors))
    report(f"a sine of 8 degrees and 0.5 Hz as commands of 50 Hz: rms error {rms:.2f} degrees behind {lag * 1000:.0f} ms")
    assert len(errors) > 100
    assert rms < 1.5
    stopping, future = leading.begin("stop")
    leading.each(0.02, 50, lambda _: leading.send([wanted(leading.seconds() - begin), *HOME[1:]]))
    assert leading.finish(stopping, future)[0]
    standing = leading.degrees()[0]
    leading.each(0.02, 50, lambda _: leading.send([wanted(leading.seconds() - begin), *HOME[1:]]))
    assert leading.degrees()[0] == pytest.approx(standing, abs=0.3)
    assert leading.call("hold")[0]
    leading.each(0.02, 50, lambda _: leading.send([standing + 2.0, *HOME[1:]]))
    leading.until(lambda: leading.degrees()[0] == pytest.approx(standing + 2.0, abs=0.5), "motion after hold")


@KINDS
def test_a_killed_node_leaves_the_arm_to_its_watchdog(start: Start, client: Clients, kind: str) -> None:
    for _ in range(6):
        controller = start.arm(kind)
        node = start.node(start.link, jump="approach", max_age=30.0)
        leading = client()
        leading.connect()
        moving(leading, node)
        node.end()
        if "the arm holds" not in node.text():
            break
        # Servos miss answers on a busy machine, and the node made the arm hold before it was killed.
        controller.end(signal.SIGTERM)
    # Wait without a connection: a program that asks the arm would end the silence.
    time.sleep(1.0)
    arm = sevenbot.Arm(start.link)
    # Bit 6 of the faults: the watchdog of the host acted.
    assert arm.get("faults") & 1 << 6
    standing = arm.angles[0]
    arm.sleep(0.5)
    assert arm.angles[0] == pytest.approx(standing, abs=0.3)
    assert arm.get("motor-state") == 1
    assert 5.0 < standing - 90.0 < 65.0
    arm.close()


@KINDS
def test_a_controller_that_is_killed_and_started_again_as_an_unplugged_arm(start: Start, client: Clients, kind: str) -> None:
    controller = start.arm(kind)
    node = start.node(start.link, jump="approach", max_age=30.0)
    leading = client()
    leading.connect()
    moving(leading, node)
    controller.end(signal.SIGTERM if kind == "image" else signal.SIGKILL)
    leading.diagnostics.clear()
    leading.until(lambda: leading.diagnostics and level(leading)[0] == 2 and level(leading)[1].startswith("no arm"))
    leading.send({"joint_1": 10.0})
    leading.until(lambda: "no arm answers" in node.text(), "a warning")
    start.arm(kind)
    leading.states.clear()
    leading.until(lambda: leading.states, "states after the restart")
    leading.until(lambda: leading.diagnostics and level(leading)[0] < 2, "health after the restart")
    moving(leading, node)


def test_services(start: Start, client: Clients) -> None:
    node = start.node(real_time_factor=4.0)
    calling = client(simulated_time=True)
    calling.connect()
    calling.send({"joint_1": 0.0}, stamp=-1.0)
    calling.until(lambda: "s old" in node.text(), "the refusal of a command from before 1970")
    assert calling.call("vacuum", True) == (True, "the pump sucks")
    calling.diagnostics.clear()
    calling.until(lambda: any(value.value == "sucks" for value in values(calling)), "diagnosis of the pump")
    assert calling.call("vacuum", False)[0]
    assert calling.call("torque", False)[0]
    calling.until(lambda: "do not drive" in level(calling)[1], "diagnosis of the motors")
    assert calling.call("hold")[0]
    calling.until(lambda: level(calling)[0] == 0, "health")
    assert calling.call("home") == (True, "the arm stands in the standard pose")
    assert calling.degrees() == pytest.approx(HOME, abs=3.0)
    parked, text = calling.call("park")
    assert parked, text
    # Rear arm upright, forearm folded up. Commands are refused until `hold`.
    calling.until(lambda: calling.degrees()[2] < -30.0, "the park pose")
    assert calling.call("hold")[0]
    home, future = calling.begin("home")
    calling.until(lambda: calling.degrees()[2] > -25.0, "motion")
    assert calling.call("stop")[0]
    assert not calling.finish(home, future)[0]


def test_two_arms_in_two_namespaces(start: Start, client: Clients) -> None:
    start.node(namespace="left", real_time_factor=0.5)
    start.node(namespace="right", real_time_factor=0.5, clock=False, seed=2)
    left, right = client("left", simulated_time=True), client("right")
    left.connect()
    right.connect()

    def has_moved() -> bool:
        left.send({"joint_1": min(left.degrees()[0] + 3.0, 20.0)})
        right.spin(0.0)
        return left.degrees()[0] > 18.0

    left.until(has_moved, "motion of the left arm")
    right.states.clear()
    right.until(lambda: len(right.states) > 5)
    assert right.degrees()[0] == pytest.approx(0.0, abs=0.5)
    left.until(lambda: left.descriptions)
    assert "/left/robot_joint_command" in left.descriptions[-1]


def test_a_wrong_parameter_ends_the_program(start: Start) -> None:
    node = start.node(rate=1000)
    assert node.process.wait(60.0) == 2
    assert "rate is 1000: it has to be 1 to 200" in node.text()


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_program_without_a_complaint(start: Start, client: Clients, how: signal.Signals) -> None:
    hearing = client(simulated_time=True)
    # The signal comes at any point of the cycle of the arm's thread.
    for _ in range(3):
        node = start.node(rate=200)
        # Wait for text of this node, because a state may come from the previous node.
        hearing.until(lambda node=node: "answers at" in node.text(), "arm")
        assert node.end(how) == 0, node.text()
        assert not any(word in node.text() for word in ("Traceback", "Exception", "ERROR")), node.text()


def test_memory_does_not_grow(start: Start, client: Clients, report: Report) -> None:
    """Each stretch lasts `MEMORY_SECONDS`, by default 10 s. There are at least two."""
    seconds = float(os.environ.get("MEMORY_SECONDS", "10"))
    node = start.node(real_time_factor=2.0)
    leading = client(simulated_time=True)
    leading.connect()

    def run(period: float) -> None:
        begin = time.monotonic()
        while (passed := time.monotonic() - begin) < period:
            leading.send({"joint_1": 3.0 * math.sin(passed)})
            leading.spin(0.02)
            del leading.states[:-1], leading.joint_states[:-1], leading.tips[:-1], leading.diagnostics[:-1]

    # A memory pool of the middleware or of Python grows once and then keeps its size. A leak grows in every period.
    kilobytes: list[int] = []
    while len(kilobytes) < 2 or kilobytes[-1] - kilobytes[-2] > 256 + 4 * seconds:
        assert len(kilobytes) < 6, f"the memory of the node grows: {kilobytes} kB"
        run(seconds)
        kilobytes.append(node.memory())
    report(f"memory of the node after each stretch of {seconds:.0f} s: {kilobytes} kB")
