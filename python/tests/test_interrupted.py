"""Streams and calls that an exception, a signal, a cancellation or the garbage collector ends early."""

from __future__ import annotations

import _thread
import asyncio
import contextlib
import gc
import os
import signal
import threading
import time

import pytest

import sevenbot
from sevenbot import aio

REST = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0]
#: The timeout of waits in seconds. It is long, because the machine may be busy.
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
