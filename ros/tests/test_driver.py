"""The thread of the arm: without ROS, with a simulated arm."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import sevenbot
from sevenbot_ros import actions
from sevenbot_ros.commands import Refusal, Targets
from sevenbot_ros.driver import Driver, Measurement, Settings
from sevenbot_ros.health import Health


class Heard:
    """Keeps what the driver tells."""

    def __init__(self) -> None:
        self.told: list[str] = []
        self.refusals: list[Refusal] = []
        self.last: Measurement | None = None
        self._news = threading.Condition()

    def _tell(self, act: Callable[[], None]) -> None:
        with self._news:
            act()
            self._news.notify_all()

    def until(self, condition: Callable[[], bool]) -> None:
        """Waits until the condition is true."""
        with self._news:
            assert self._news.wait_for(condition, timeout=60.0), self.told

    def measured(self, measurement: Measurement) -> None:
        self._tell(lambda: setattr(self, "last", measurement))

    def diagnosed(self, diagnosis: Health) -> None:
        pass

    def passed(self, simulated: float) -> None:
        pass

    def refused(self, refusal: Refusal) -> None:
        self._tell(lambda: self.refusals.append(refusal))

    def changed(self, text: str) -> None:
        self._tell(lambda: self.told.append(text))

    def ended(self) -> None:
        pass


@contextmanager
def running(**settings: float) -> Iterator[tuple[Driver, Heard]]:
    """A driver whose simulated arm answers."""
    heard = Heard()
    driver = Driver(Settings(port="sim", **settings), heard)  # type: ignore[arg-type]
    driver.start()
    try:
        heard.until(lambda: heard.last is not None)
        yield driver, heard
    finally:
        driver.close()
    assert not driver.has_failed


def test_thirty_stops_do_not_lose_the_arm() -> None:
    with running(real_time_factor=20.0) as (driver, heard):
        arm = driver.arm()
        for number in range(30):
            assert driver.command(Targets({0: 90.0 + number % 4})) is None
            heard.until(lambda: driver._stream is not None)
            actions.stop(driver)
            actions.hold(driver)
        assert driver.arm() is arm
        assert len(heard.told) == 1, heard.told


def test_a_command_that_comes_while_the_arm_is_lost_does_not_lead_the_next_one() -> None:
    heard = Heard()
    driver = Driver(Settings(port="sim"), heard)
    answers: list[Refusal | None] = []
    close_stream = driver._close_stream

    def close() -> None:
        if driver._stream is not None:
            # Another thread hears a command while the stream of the lost arm is closed.
            answers.append(driver.command(Targets({0: 94.0})))
        close_stream()

    driver._close_stream = close  # type: ignore[method-assign]
    driver.start()
    heard.until(lambda: heard.last is not None)
    assert driver.command(Targets({0: 92.0})) is None
    heard.until(lambda: driver._stream is not None)
    simulation = driver.arm().simulation
    assert isinstance(simulation, sevenbot.Simulation)
    simulation.unplug()
    heard.until(lambda: sum(" answers at " in text for text in heard.told) == 2)
    heard.until(lambda: driver.measurement is not None)
    end = driver.now() + 1.0
    heard.until(lambda: driver.now() > end)
    assert [answer.key if answer else None for answer in answers] == ["no arm"]
    assert heard.last is not None and abs(heard.last.positions[0] - 90.0) < 0.5
    driver.close()
    assert not driver.has_failed
