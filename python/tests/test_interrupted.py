"""Streams and calls that something ends early, and an arm that was not measured yet."""

from __future__ import annotations

import _thread
import asyncio
import contextlib
import gc
import math
import os
import pickle
import signal
import subprocess
import threading
import time
from pathlib import Path

import pytest

import sevenbot
from sevenbot import aio

REST = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0]
#: Seconds. No test fails because a machine is slow.
ENOUGH = 120.0


@pytest.mark.parametrize("ending", [KeyboardInterrupt, ValueError])
def test_an_exception_ends_the_way_to_the_first_action(ending: type[BaseException]) -> None:
    with sevenbot.Arm("sim") as arm:
        with pytest.raises(ending), arm.stream(0.02, approach=15) as stream:
            stream.latest([170, *REST[1:]])
            end = time.monotonic() + ENOUGH
            while arm.get("fine-position.1") < 9200:
                assert time.monotonic() < end
                time.sleep(0.05)
            raise ending
        assert arm.angles[0] < 150
        with arm.stream(0.02):
            pass


def opened_by(arm: sevenbot.SimulatedArm) -> None:
    with arm.stream(0.02):
        time.sleep(0.001)


def test_ctrl_c_while_a_stream_opens_leaves_none_open(simulated_arm: sevenbot.SimulatedArm) -> None:
    for tries in range(40):
        timer = threading.Timer(tries * 0.0002, _thread.interrupt_main)
        with contextlib.suppress(KeyboardInterrupt):
            timer.start()
            for _ in range(15):
                opened_by(simulated_arm)
        with contextlib.suppress(KeyboardInterrupt):
            timer.join()
        opened_by(simulated_arm)


def test_a_forgotten_stream_does_not_stay_open(simulated_arm: sevenbot.SimulatedArm) -> None:
    simulated_arm.stream(0.02).__enter__()
    gc.collect()
    opened_by(simulated_arm)
    assert simulated_arm.get("set-point-period") == 0


def test_a_cancelled_opening_leaves_no_stream_open() -> None:
    async def cancel(arm: aio.Arm, after: float) -> None:
        async def open_and_wait() -> None:
            async with arm.stream(0.02):
                await asyncio.sleep(ENOUGH)

        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(open_and_wait(), after)

    async def run() -> None:
        async with await aio.Arm.open("sim") as arm:
            for after in [0.0, 0.001, 0.003, 0.01]:
                await cancel(arm, after)
                async with arm.stream(0.02):
                    pass

    asyncio.run(run())


def test_only_ctrl_c_ends_a_recording_as_if_it_were_over(simulated_arm: sevenbot.SimulatedArm) -> None:
    class Ended(Exception):
        pass

    def end(*_: object) -> None:
        raise Ended

    before = signal.signal(signal.SIGTERM, end)
    try:
        threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGTERM)).start()
        with pytest.raises(Ended):
            simulated_arm.record()
    finally:
        signal.signal(signal.SIGTERM, before)


def test_samples_and_recordings_wait_for_the_first_measurement() -> None:
    with sevenbot.Arm.simulated() as arm:
        _, rows = arm.sample(3)
        assert rows[0] == pytest.approx(REST, abs=3)
    with sevenbot.Arm.simulated() as arm:
        recording = arm.record(1)
        assert recording.angles[0] == pytest.approx(REST, abs=3)


def test_an_arm_of_many_answers_at_once_whatever_its_snapshot_was() -> None:
    with sevenbot.Arm.simulated(3) as one:
        one.sleep(1)
        arms = sevenbot.SimulatedArms(1)
        arms.reset(None, one.simulation.snapshot())
        seen = arms.read()
        assert seen[0, arms.POSITIONS] == pytest.approx(one.simulation.angles, abs=1.0)
        assert seen[0, arms.AGE] == 0.0
        one.simulation.restore(arms.snapshot(0))
        before = one.simulation.now
        one.observe()
        assert one.simulation.now - before > 0.003, "its own line takes time"


def test_a_recording_from_mcap_equals_its_copy(tmp_path: Path) -> None:
    programs = os.environ.get("SEVENBOT_PROGRAMS")
    if programs is None:
        pytest.fail("SEVENBOT_PROGRAMS is the folder of the programs")
    text, mcap = tmp_path / "a.txt", tmp_path / "a.mcap"
    words = [f"{programs}/sevenbot", "--port", "sim", "record", str(text), "--driven", "--yes", "--seconds", "1"]
    subprocess.run([*words, "--mcap", str(mcap)], check=True, timeout=ENOUGH)
    loaded = sevenbot.Recording.load(mcap)
    assert loaded == pickle.loads(pickle.dumps(loaded)) == loaded[:] == sevenbot.Recording.load(text)
    same = subprocess.run([*words, "--mcap", str(text)], capture_output=True, text=True, timeout=ENOUGH)
    assert same.returncode != 0 and "two files" in same.stderr
    assert sevenbot.Recording.load(text) == loaded, "nothing is lost"


@pytest.mark.parametrize("goal", [(1, 2, math.nan), 5, (0, 185), "near"])
def test_a_goal_has_three_finite_numbers(goal: object) -> None:
    gym = pytest.importorskip("sevenbot.gym")
    with contextlib.closing(gym.ReachEnv()) as env:
        with pytest.raises(ValueError, match=r"goal: .*\(3,\)"):
            env.reset(options={"goal": goal})
    with contextlib.closing(gym.ReachVectorEnv(num_envs=2)) as envs:
        with pytest.raises(ValueError, match=r"goals: .*\(2, 3\)"):
            envs.reset(options={"goals": [goal, goal]})
