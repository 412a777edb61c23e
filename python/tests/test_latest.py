"""Streams whose program does not wait: `Stream.latest`."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

import pytest

import sevenbot
from sevenbot import aio

REST = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0]
PERIOD = 0.02
#: The timeout of waits in seconds. It is long, because the machine may be busy.
ENOUGH = 120.0


def turned(degrees: float) -> list[float]:
    """The pose of rest with another angle of joint 1."""
    return [degrees, *REST[1:]]


def test_a_slow_program_moves_the_arm_and_the_sender_keeps_the_period(
    simulated_arm: sevenbot.SimulatedArm,
) -> None:
    with simulated_arm.stream(PERIOD) as stream:
        for step in range(30):
            counts = stream.latest(turned(90 + step * 0.5))
            simulated_arm.sleep(0.075)
        assert (counts.skipped, counts.missed, counts.watchdog) == (0, 0, 0)
        assert stream.counts.sent == pytest.approx(30 * 0.075 / PERIOD, abs=2)
        assert stream.counts.sent - stream.counts.repeated == 30
    assert simulated_arm.get("set-point-period") == 0
    assert simulated_arm.get("fine-target.1") == 10450
    assert simulated_arm.simulation.angles[0] == pytest.approx(104.5, abs=1.5)
    assert "repeated" in repr(counts) and counts != stream.counts


def test_the_newest_action_is_sent_and_the_others_are_skipped(simulated_arm: sevenbot.SimulatedArm) -> None:
    with simulated_arm.stream(PERIOD) as stream:
        before = simulated_arm.simulation.now
        for step in range(50):
            stream.latest(turned(90 + step * 0.1))
        assert simulated_arm.simulation.now == before, "it does not wait"
        assert stream.counts.skipped == 49
        simulated_arm.sleep(0.1)
        # A joint without an angle keeps its angle of the action before.
        stream.latest([None, 91, *[None] * 5])
        stream.latest([95.5, *[None] * 6])
    assert simulated_arm.get("fine-target") == [9550, 9100, 6500, 9000, 9000, 9000, 8000]


def test_reads_go_on_and_let_the_sender_send(simulated_arm: sevenbot.SimulatedArm) -> None:
    start = simulated_arm.simulation.now
    with simulated_arm.stream(PERIOD) as stream:
        for step in range(300):
            stream.latest(turned(90 + step * 0.02))
            simulated_arm.observe()
        passed = simulated_arm.simulation.now - start
        assert stream.counts.sent == pytest.approx(passed / PERIOD, rel=0.15)
        assert stream.counts.missed == 0


def test_the_watchdog_acts_if_the_program_is_silent_and_the_program_is_told(
    simulated_arm: sevenbot.SimulatedArm,
) -> None:
    with simulated_arm.stream(PERIOD, watchdog=0.2) as stream:
        for step in range(20):
            stream.latest(turned(90 + step * 0.4))
            simulated_arm.sleep(PERIOD)
        simulated_arm.sleep(0.15)
        assert stream.counts.watchdog == 0
        simulated_arm.sleep(2)
        assert stream.counts.watchdog == 1
        sent = stream.counts.sent
        status = simulated_arm.status()
        assert status is not None and "silent" in status.faults
        simulated_arm.sleep(2)
        assert stream.counts.sent == sent, "nothing is repeated to an arm that holds"
        # The next action is a first one again.
        assert stream.latest(turned(120)).watchdog == 1
        simulated_arm.sleep(PERIOD)
        with pytest.raises(sevenbot.TooFar):
            stream.latest(turned(98))
        assert simulated_arm.get("fine-target.1") == 9760
        for _ in range(20):
            stream.latest(turned(98))
            simulated_arm.sleep(PERIOD)
        assert simulated_arm.get("fine-target.1") == 9800


def test_damping_is_told_as_motors_that_do_not_drive(simulated_arm: sevenbot.SimulatedArm) -> None:
    with pytest.raises(sevenbot.NotDriven):
        with simulated_arm.stream(PERIOD, watchdog=0.1, damping=True) as stream:
            stream.latest(REST)
            simulated_arm.sleep(1)
            assert stream.counts.watchdog == 1
            for _ in range(20):
                stream.latest(REST)
                simulated_arm.sleep(PERIOD)


def test_a_long_silence_of_the_computer_is_seen_afterwards(simulated_arm: sevenbot.SimulatedArm) -> None:
    with simulated_arm.stream(PERIOD) as stream:
        stream.latest(REST)
        simulated_arm.sleep(0.1)
        simulated_arm.simulation.advance(3)
        stream.latest(REST)
        simulated_arm.sleep(0.1)
        assert stream.counts.watchdog == 1


def test_the_way_to_a_first_action(simulated_arm: sevenbot.SimulatedArm) -> None:
    with simulated_arm.stream(PERIOD) as stream:
        stream.latest(turned(150))
        simulated_arm.sleep(PERIOD)
        with pytest.raises(sevenbot.TooFar, match="joint 1"):
            stream.latest(turned(91))
        assert stream.counts.sent == 1 and simulated_arm.get("fine-target.1") == 9000
    start = simulated_arm.simulation.now
    with simulated_arm.stream(PERIOD, approach=1.5) as stream:
        stream.latest(turned(150))
        simulated_arm.sleep(PERIOD)
        assert simulated_arm.simulation.now - start > 1.5
        stream.latest(turned(150.2))
    assert simulated_arm.get("fine-target.1") == 15020
    with pytest.warns(sevenbot.GuardWarning, match="below the table"):
        with simulated_arm.stream(PERIOD, approach=1) as stream:
            stream.latest([90, 20, 140, 90, 90, 90, 80])


def test_a_blocked_joint_is_told_and_takes_the_stream_up_again(simulated_arm: sevenbot.SimulatedArm) -> None:
    told = 0
    with simulated_arm.stream(PERIOD) as stream:
        for step in range(500):
            if step == 10:
                simulated_arm.simulation.fault("1=stuck", 6)
            try:
                stream.latest(turned(90 + min(step, 80) * 0.4))
            except sevenbot.ArmProblem as problem:
                assert problem.joints == (1,)
                told += 1
            simulated_arm.sleep(PERIOD)
    assert told > 5
    assert simulated_arm.simulation.angles[0] == pytest.approx(122, abs=1.5)


def test_stop_ends_the_sender_until_the_program_knows(simulated_arm: sevenbot.SimulatedArm) -> None:
    with simulated_arm.stream(PERIOD) as stream:
        for step in range(50):
            stream.latest(turned(90 + step))
            simulated_arm.sleep(PERIOD)
        simulated_arm.stop()
        held = simulated_arm.get("fine-target.1")
        simulated_arm.sleep(1)
        assert simulated_arm.get("fine-target.1") == held
        with pytest.raises(sevenbot.Interrupted):
            stream.latest(turned(140))
        stream.latest(turned(held / 100 + 1))
    assert simulated_arm.get("fine-target.1") == held + 100


def test_without_a_stream_there_is_no_latest(simulated_arm: sevenbot.SimulatedArm) -> None:
    stream = simulated_arm.stream(PERIOD)
    with pytest.raises(sevenbot.Closed):
        stream.latest(REST)
    with stream:
        with pytest.raises(ValueError, match="joint 1"):
            stream.latest(turned(190))
        stream.latest(REST)
    with pytest.raises(sevenbot.Closed):
        stream.latest(REST)
    stream.__enter__()
    stream.latest(REST)
    simulated_arm.close()
    with pytest.raises(sevenbot.Closed):
        stream.latest(REST)


def test_a_lost_port_ends_the_sender_and_is_told(simulated_arm: sevenbot.SimulatedArm) -> None:
    with pytest.raises(sevenbot.PortError):
        with simulated_arm.stream(PERIOD) as stream:
            stream.latest(REST)
            simulated_arm.simulation.unplug()
            simulated_arm.sleep(1)
            with pytest.raises(sevenbot.PortError):
                stream.latest(REST)
            sent = stream.counts.sent
            simulated_arm.sleep(1)
            assert stream.counts.sent == sent


def test_restore_makes_the_next_action_a_first_one(simulated_arm: sevenbot.SimulatedArm) -> None:
    world = simulated_arm.simulation
    before = world.snapshot()
    with simulated_arm.stream(PERIOD) as stream:
        for step in range(60):
            stream.latest(turned(90 + step * 0.4))
            simulated_arm.sleep(PERIOD)
        world.restore(before)
        stream.latest(turned(113))
        simulated_arm.sleep(PERIOD)
        with pytest.raises(sevenbot.TooFar):
            stream.latest(REST)
        for _ in range(10):
            stream.latest(turned(91))
            simulated_arm.sleep(PERIOD)
        assert simulated_arm.get("set-point-period") == 20
    assert simulated_arm.get("fine-target.1") == 9100


def test_send_takes_the_stream_over(simulated_arm: sevenbot.SimulatedArm) -> None:
    with simulated_arm.stream(PERIOD) as stream:
        stream.latest(turned(91))
        simulated_arm.sleep(PERIOD)
        for step in range(20):
            stream.send(turned(91 + step * 0.2))
        assert stream.counts.sent <= 2
    assert simulated_arm.get("fine-target.1") == 9480


def test_the_same_calls_give_the_same_values() -> None:
    def run() -> list[object]:
        with sevenbot.Arm.simulated(3) as arm:
            arm.sleep(1)
            arm.simulation.fault("line=loss=1%")
            seen: list[object] = []
            with arm.stream(PERIOD) as stream:
                for step in range(100):
                    seen.append(stream.latest(turned(90 + step * 0.2)))
                    arm.sleep(0.013)
                    seen.append(arm.simulation.angles)
                arm.simulation.clear()
            return seen

    assert run() == run() == run()


def test_asyncio_has_it_too() -> None:
    async def wave() -> sevenbot.StreamCounts:
        async with aio.Arm.simulated() as arm:
            await arm.sleep(1)
            async with arm.stream(PERIOD) as stream:
                for step in range(20):
                    stream.latest(turned(90 + step * 0.2))
                    await arm.sleep(PERIOD)
                return stream.sync.counts

    assert asyncio.run(wave()).sent >= 19


def test_the_sender_of_an_arm_in_real_time_needs_no_call() -> None:
    with sevenbot.Arm("sim") as arm:
        with arm.stream(PERIOD, watchdog=1, approach=0.1) as stream:
            stream.latest(turned(91))
            end, acted = time.monotonic() + ENOUGH, 0
            while stream.counts.repeated < 10:
                assert time.monotonic() < end, stream.counts
                time.sleep(0.01)
                if stream.counts.watchdog > acted:
                    # The machine was too busy to send for a second.
                    acted = stream.counts.watchdog
                    stream.latest(turned(91))
            while stream.counts.watchdog == acted:
                assert time.monotonic() < end, stream.counts
                time.sleep(0.01)
        assert arm.get("fine-target.1") == 9100


def test_latest_does_not_wait_for_the_way_to_the_first_action() -> None:
    with sevenbot.Arm("sim") as arm:
        with arm.stream(PERIOD, approach=3) as stream:
            for _ in range(50):
                assert stream.latest(turned(100)).sent <= 1


def let_go(arm: sevenbot.SimulatedArm) -> None:
    arm.set("motor-state", 2)


def restart(arm: sevenbot.SimulatedArm) -> None:
    arm.simulation.power_cycle()


@pytest.mark.parametrize("method", ["latest", "send"])
@pytest.mark.parametrize("fail, failure", [(let_go, sevenbot.NotDriven), (restart, sevenbot.ArmProblem)])
def test_after_a_failure_of_the_whole_arm_the_next_point_is_a_first_one(
    simulated_arm: sevenbot.SimulatedArm,
    method: str,
    fail: Callable[[sevenbot.SimulatedArm], None],
    failure: type[sevenbot.Error],
) -> None:
    with simulated_arm.stream(PERIOD, guard=False) as stream:

        def send(angles: list[float]) -> None:
            for _ in range(20):
                getattr(stream, method)(angles)
                simulated_arm.sleep(PERIOD)

        send(REST)
        fail(simulated_arm)
        with pytest.raises(failure):
            send(REST)
        simulated_arm.sleep(1)
        simulated_arm.torque_on()
        here = list(simulated_arm.angles)
        with pytest.raises(sevenbot.TooFar, match="joint 1"):
            send([here[0] + 50, *here[1:]])
        send(here)
        assert simulated_arm.get("set-point-period") == 20 and simulated_arm.get("host-watchdog") == 30
        # The program has received the failure, so the end of the stream does not raise it again.
        fail(simulated_arm)
        with pytest.raises(failure):
            send(here)
    assert simulated_arm.get("set-point-period") == 0


def test_a_failure_that_the_program_does_not_know_is_told_at_the_end(simulated_arm: sevenbot.SimulatedArm) -> None:
    with pytest.raises(sevenbot.NotDriven):
        with simulated_arm.stream(PERIOD) as stream:
            stream.latest(REST)
            simulated_arm.sleep(0.1)
            simulated_arm.set("motor-state", 2)
            simulated_arm.sleep(0.15)
