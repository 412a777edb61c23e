"""An arm for asyncio: the methods of `sevenbot.Arm` as coroutines.

    async with sevenbot.aio.Arm.simulated() as arm:
        await arm.pose(120, 90, 65, 90, 90, 90, 80)

One thread of each arm waits for its calls, so that they run in order, except `stop`, `close` and `is_connected`. If a call of
this thread is cancelled, the arm holds.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterable, Awaitable, Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, Literal, SupportsIndex, TypeAlias, TypeVar, overload

import sevenbot

if TYPE_CHECKING:
    from numpy import float64
    from numpy.typing import NDArray

__all__ = ["Arm", "Stream"]

_Result = TypeVar("_Result")
_Goal: TypeAlias = float | None
_Angles: TypeAlias = tuple[float, float, float, float, float, float, float]


class Arm:
    """As `sevenbot.Arm`. Methods that talk to the arm are coroutines; `arm.sync` is the arm itself."""

    def __init__(self, arm: sevenbot.Arm) -> None:
        """Wraps an open arm, which no other code may use meanwhile."""
        self.sync = arm
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="sevenbot")
        self._is_closed = False

    @classmethod
    async def open(cls, port: str | None = None, **options: Any) -> Arm:
        """Opens a port, as `sevenbot.Arm(port, **options)` does."""
        return cls(await asyncio.to_thread(lambda: sevenbot.Arm(port, **options)))

    @classmethod
    def simulated(cls, seed: int = 1, **options: Any) -> Arm:
        """An arm in virtual time."""
        return cls(sevenbot.Arm.simulated(seed, **options))

    @property
    def simulation(self) -> sevenbot.Simulation | None:
        """The simulation behind this arm; `None` for a real one."""
        return self.sync.simulation

    async def _call(self, method: Callable[..., _Result], *arguments: Any, **options: Any) -> _Result:
        try:
            call = self._thread.submit(lambda: method(*arguments, **options))
        except RuntimeError as error:
            # The thread ends when the arm is closed.
            raise sevenbot.Closed("the arm is closed") from error
        future = asyncio.wrap_future(call)
        # Fetch the exception of a cancelled call, so that asyncio does not report it as never retrieved.
        future.add_done_callback(lambda done: done.cancelled() or done.exception())
        try:
            return await asyncio.shield(future)
        except asyncio.CancelledError:
            # The arm holds before the cancellation goes on. A move ends with `Interrupted`, or does not begin.
            call.cancel()
            await asyncio.to_thread(self.sync.stop)
            while not call.done():
                await asyncio.to_thread(self.sync.stop)
            raise

    async def angles(self) -> _Angles:
        """The measured angles in degrees."""
        return await self._call(lambda: self.sync.angles)

    async def is_connected(self) -> bool:
        """As `sevenbot.Arm.is_connected`. Does not wait for an earlier call that waits for joints."""
        return await asyncio.to_thread(lambda: self.sync.is_connected)

    def registers(self) -> Awaitable[dict[str, Any]]:
        """The names and the values of all registers, as `dict(sevenbot.Arm.registers)`."""
        return self._call(lambda: dict(self.sync.registers))

    def torque_on(self) -> Awaitable[None]:
        """As `sevenbot.Arm.torque_on`."""
        return self._call(self.sync.torque_on)

    def torque_off(self) -> Awaitable[None]:
        """As `sevenbot.Arm.torque_off`."""
        return self._call(self.sync.torque_off)

    def get(self, name: str) -> Awaitable[Any]:
        """As `sevenbot.Arm.get`."""
        return self._call(self.sync.get, name)

    def set(self, name: str, values: SupportsIndex | Iterable[SupportsIndex], *, unlock: bool = False) -> Awaitable[None]:
        """As `sevenbot.Arm.set`."""
        return self._call(self.sync.set, name, values, unlock=unlock)

    def observe(self) -> Awaitable[sevenbot.Observation]:
        """As `sevenbot.Arm.observe`."""
        return self._call(self.sync.observe)

    def where(self) -> Awaitable[sevenbot.Tip]:
        """As `sevenbot.Arm.where`."""
        return self._call(self.sync.where)

    @overload
    def pose(
        self, *angles: _Goal | Iterable[_Goal],
        speed: float | None = ..., duration: float | None = ..., wait: Literal[True] = ...,
        table: float | None = ..., guard: bool = ...,
    ) -> Awaitable[_Angles]: ...

    @overload
    def pose(
        self, *angles: _Goal | Iterable[_Goal],
        speed: float | None = ..., duration: float | None = ..., wait: Literal[False],
        table: float | None = ..., guard: bool = ...,
    ) -> Awaitable[None]: ...

    def pose(self, *angles: Any, **options: Any) -> Awaitable[_Angles | None]:
        """As `sevenbot.Arm.pose`."""
        return self._call(self.sync.pose, *angles, **options)

    @overload
    def move_to(
        self, x: float, y: float, z: float, *,
        speed: float | None = ..., duration: float | None = ..., wait: Literal[True] = ...,
        table: float | None = ..., guard: bool = ..., tool: Iterable[float] | None = ..., straight: bool = ...,
    ) -> Awaitable[_Angles]: ...

    @overload
    def move_to(
        self, x: float, y: float, z: float, *,
        speed: float | None = ..., duration: float | None = ..., wait: Literal[False],
        table: float | None = ..., guard: bool = ..., tool: Iterable[float] | None = ..., straight: bool = ...,
    ) -> Awaitable[None]: ...

    def move_to(self, x: float, y: float, z: float, **options: Any) -> Awaitable[_Angles | None]:
        """As `sevenbot.Arm.move_to`."""
        return self._call(self.sync.move_to, x, y, z, **options)

    def wait(self) -> Awaitable[_Angles | None]:
        """As `sevenbot.Arm.wait`."""
        return self._call(self.sync.wait)

    def sleep(self, seconds: float) -> Awaitable[None]:
        """As `sevenbot.Arm.sleep`: on the clock of the arm."""
        return self._call(self.sync.sleep, seconds)

    def status(self) -> Awaitable[sevenbot.Status | None]:
        """As `sevenbot.Arm.status`."""
        return self._call(self.sync.status)

    def park(self, *angles: _Goal | Iterable[_Goal], keep: bool = False) -> Awaitable[_Angles]:
        """As `sevenbot.Arm.park`."""
        return self._call(self.sync.park, *angles, keep=keep)

    def record(self, seconds: float, **options: Any) -> Awaitable[sevenbot.Recording]:
        """As `sevenbot.Arm.record`."""
        return self._call(self.sync.record, seconds, **options)

    def play(self, recording: sevenbot.Recording, **options: Any) -> Awaitable[sevenbot.Recording]:
        """As `sevenbot.Arm.play`."""
        return self._call(self.sync.play, recording, **options)

    def sample(self, count: int, *, period: float = 0.0) -> Awaitable[tuple[NDArray[float64], NDArray[float64]]]:
        """As `sevenbot.Arm.sample`."""
        return self._call(self.sync.sample, count, period=period)

    def stream(self, period: float = 0.02, **options: Any) -> Stream:
        """As `sevenbot.Arm.stream`: `async with arm.stream(0.02) as stream: await stream.send(...)`."""
        return Stream(self, self.sync.stream(period, **options))

    async def stop(self) -> list[int]:
        """As `sevenbot.Arm.stop`: does not wait for the call before it, but interrupts it."""
        return await asyncio.to_thread(self.sync.stop)

    async def close(self) -> None:
        """Closes the port. The arm goes on with its move."""
        await asyncio.to_thread(self.sync.close)
        self._is_closed = True
        self._thread.shutdown(wait=False)

    async def __aenter__(self) -> Arm:
        return self

    async def __aexit__(self, *exception: Any) -> None:
        """Stops what moves, also in a task that waits for it, and closes the port."""
        if not self._is_closed:
            # Not in the queue behind the running call, because `__exit__` ends that call.
            await asyncio.to_thread(self.sync.__exit__, *exception)
            await self.close()


class Stream:
    """As `sevenbot.Stream`, a context manager of `async with`."""

    def __init__(self, arm: Arm, stream: sevenbot.Stream) -> None:
        """A stream of this arm; `Arm.stream` makes it."""
        self._arm = arm
        self.sync = stream

    async def __aenter__(self) -> Stream:
        try:
            await self._arm._call(self.sync.__enter__)
        except asyncio.CancelledError as cancelled:
            # The stream may have been opened before the cancellation reached the thread.
            with contextlib.suppress(sevenbot.Closed):
                await asyncio.to_thread(self.sync.__exit__, type(cancelled), cancelled, None)
            raise
        return self

    async def __aexit__(self, *exception: Any) -> None:
        await self._arm._call(self.sync.__exit__, *exception)

    def send(self, angles: Iterable[_Goal]) -> Awaitable[int]:
        """As `sevenbot.Stream.send`: waits until the point is due, and returns its number."""
        return self._arm._call(self.sync.send, angles)

    def latest(self, angles: Iterable[_Goal]) -> sevenbot.StreamCounts:
        """As `sevenbot.Stream.latest`, which does not wait: no coroutine."""
        return self.sync.latest(angles)

    async def send_all(
        self, points: AsyncIterable[Iterable[_Goal]] | Iterable[Iterable[_Goal]]
    ) -> int:
        """Sends each point of an iterator, or of an asynchronous one. Returns how many it sent.

        If the next point takes longer than the watchdog's time, the watchdog of the arm acts.
        """
        count = 0
        if isinstance(points, AsyncIterable):
            async for point in points:
                await self.send(point)
                count += 1
        else:
            for point in points:
                await self.send(point)
                count += 1
        return count
