"""`sevenbot.aio`: coroutines on an arm in virtual time."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import pytest

import sevenbot
from sevenbot import aio


def test_coroutines_do_what_the_methods_do() -> None:
    async def run() -> None:
        async with aio.Arm.simulated() as arm:
            await arm.sleep(1)
            await arm.pose(120, 90, 65, 90, 90, 90, 80)
            assert (await arm.angles())[0] == pytest.approx(120, abs=1.5)
            await arm.set("speed", 10)
            assert await arm.get("speed.7") == 10
            await arm.move_to(-50, 185, 50)
            assert (await arm.where()).tip[0] == pytest.approx(-50, abs=6)
            status = await arm.status()
            assert status is not None and status.is_healthy
            assert len(await arm.record(0.5)) > 10
            times, _ = await arm.sample(5)
            assert len(times) == 5
        with pytest.raises(sevenbot.Closed):
            arm.sync.get("speed")
        with pytest.raises(sevenbot.Closed):
            await arm.get("speed")
        await arm.close()

    asyncio.run(run())


def test_two_arms_run_at_the_same_time() -> None:
    async def run() -> None:
        async with aio.Arm.simulated() as one, aio.Arm.simulated() as other:
            await asyncio.gather(one.sleep(1), other.sleep(1))
            await asyncio.gather(
                one.pose(100, 90, 65, 90, 90, 90, 80), other.pose(80, 90, 65, 90, 90, 90, 80)
            )
            assert (await one.angles())[0] == pytest.approx(100, abs=1.5)
            assert (await other.angles())[0] == pytest.approx(80, abs=1.5)

    asyncio.run(run())


def test_a_cancelled_call_makes_the_arm_hold() -> None:
    async def forever(arm: aio.Arm) -> None:
        while True:
            await arm.sleep(86_400)

    async def run() -> None:
        async with aio.Arm.simulated() as arm:
            await arm.sleep(1)
            assert arm.simulation is not None
            arm.simulation.fault("1=stuck")
            await arm.pose(180, 90, 65, 90, 90, 90, 80, wait=False)
            task = asyncio.create_task(forever(arm))
            await asyncio.sleep(0)
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
            assert await arm.get("target-position.1") == pytest.approx(90, abs=2)

    asyncio.run(run())


async def ramp(to: float) -> AsyncIterator[list[float | None]]:
    for step in range(50):
        await asyncio.sleep(0)
        yield [90 + (to - 90) * step / 49, None, None, None, None, None, None]


def test_an_asynchronous_producer_is_streamed() -> None:
    async def run() -> None:
        async with aio.Arm.simulated() as arm:
            await arm.sleep(1)
            async with arm.stream(0.02) as stream:
                assert await stream.send_all(ramp(100)) == 50
                number = await stream.send([100, None, None, None, None, None, None])
                assert await stream.send_all([[100, *[None] * 6]] * 20) == 20
                assert number == 50 and stream.sync.period == 0.02
            assert (await arm.angles())[0] == pytest.approx(100, abs=1)
            assert await arm.get("set-point-period") == 0

    asyncio.run(run())


def test_a_cancelled_stream_holds_and_ends() -> None:
    async def forever(arm: aio.Arm) -> None:
        async with arm.stream(0.02) as stream:
            while True:
                await stream.send([None] * 7)

    async def run() -> None:
        async with aio.Arm.simulated() as arm:
            await arm.sleep(1)
            task = asyncio.create_task(forever(arm))
            while await arm.get("set-point-period") != 20:
                await asyncio.sleep(0)
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
            assert await arm.get("set-point-period") == 0

    asyncio.run(run())


def test_an_arm_is_asked_and_its_motors_are_switched() -> None:
    async def run() -> None:
        async with aio.Arm.simulated() as arm:
            await arm.sleep(1)
            assert await arm.is_connected()
            await arm.torque_off()
            assert await arm.get("motor-state") == 2
            await arm.torque_on()
            registers = await arm.registers()
            assert registers["motor-state"] == 1 and registers.keys() == set(arm.sync.registers.keys())
        assert not await arm.is_connected()

    asyncio.run(run())


def test_a_closed_arm_can_be_closed_again() -> None:
    async def run() -> None:
        async with aio.Arm.simulated() as arm:
            await arm.close()
        async with arm:
            pass
        await arm.close()

    asyncio.run(run())


def test_the_end_of_the_block_ends_a_call_that_runs() -> None:
    async def run() -> None:
        async with aio.Arm.simulated() as arm:
            waiting = asyncio.ensure_future(arm.sleep(80_000))
            await asyncio.sleep(0.1)
        with pytest.raises(sevenbot.Interrupted):
            await waiting

    asyncio.run(run())
