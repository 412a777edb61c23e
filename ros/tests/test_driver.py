"""The thread of the arm: without ROS, with a simulated arm."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
import sevenbot
from conftest import Start
from sevenbot_ros import actions, opening
from sevenbot_ros.commands import Refusal, Targets
from sevenbot_ros.driver import Driver
from sevenbot_ros.events import Measurement
from sevenbot_ros.follower import Jump
from sevenbot_ros.health import Health
from sevenbot_ros.interlock import Halted
from sevenbot_ros.settings import Settings


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


def wait(driver: Driver, heard: Heard, seconds: float) -> None:
    """Waits in the time of the arm."""
    end = driver.now() + seconds
    heard.until(lambda: driver.now() > end)


@contextmanager
def running(port: str = "sim", **settings: object) -> Iterator[tuple[Driver, Heard]]:
    """A driver whose simulated arm answers."""
    heard = Heard()
    driver = Driver(Settings(port=port, **settings), heard)  # type: ignore[arg-type]
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
            # Again and again, because a stream ends soon without commands.
            target = Targets({0: 90.0 + number % 4})
            heard.until(lambda: driver.leads.command(target) is None and driver.streamer.is_open)
            actions.stop(driver)
            actions.hold(driver)
        assert driver.arm() is arm
        assert len(heard.told) == 1, heard.told


def test_nothing_moves_after_a_stop_without_a_hold() -> None:
    with running(real_time_factor=20.0) as (driver, _):
        with driver.action() as arm:
            arm.pose(110, None, None, None, None, None, None)
        actions.stop(driver)
        standing = opening.standing(driver.arm())
        for move in (actions.home, actions.park):
            with pytest.raises(Halted, match="the arm was stopped: call the service `hold` to move again"):
                move(driver)
        assert opening.standing(driver.arm()) == standing
        actions.hold(driver)
        assert actions.home(driver) == "the arm stands in the standard pose"


@pytest.mark.parametrize("move", [actions.home, actions.park])
def test_a_stop_between_the_check_and_the_motion_ends_the_motion(start: Start, move: Callable[[Driver], str]) -> None:
    # Use a simulator in real time: with a simulated arm in this process, a motion ends at once.
    start.simulator()
    with running(start.link) as (driver, heard):
        with driver.action() as arm:
            arm.pose(150, None, None, None, None, None, None)
        allowed = driver.motion
        stopping = threading.Thread(target=actions.stop, args=[driver])

        @contextmanager
        def stopped() -> Iterator[sevenbot.Arm]:
            with allowed() as arm:
                stopping.start()
                heard.until(lambda: driver.interlock.stop_count == 1)
                # The stop makes the arm hold, and watches it for half a second.
                wait(driver, heard, 1.0)
                yield arm

        driver.motion = stopped  # type: ignore[method-assign]
        with pytest.raises((Halted, sevenbot.Interrupted)):
            move(driver)
        stopping.join()
        standing = driver.arm().angles
        assert standing[0] > 100.0
        wait(driver, heard, 1.0)
        assert driver.arm().angles == pytest.approx(standing, abs=0.5)


def test_a_stop_whose_servo_answers_late_names_it_and_makes_the_arm_hold() -> None:
    # As with servos in an emulator on a busy machine: they obey, but their answers come too late for the arm.
    with running(jump=Jump.APPROACH) as (driver, heard):
        simulation = driver.arm().simulation
        assert isinstance(simulation, sevenbot.Simulation)
        assert driver.leads.command(Targets({0: 150.0})) is None
        heard.until(lambda: heard.last is not None and heard.last.positions[0] > 95.0)
        simulation.fault("3=late=20")
        with pytest.raises(sevenbot.ArmProblem, match="joint 3 does not answer"):
            actions.stop(driver)
        standing = simulation.angles
        assert standing[0] < 145.0
        with pytest.raises(sevenbot.ArmProblem, match="joint 3 does not answer"):
            actions.hold(driver)
        refusal = driver.leads.command(Targets({0: 150.0}))
        assert refusal is not None and refusal.key == "halted" and "the arm was stopped" in refusal.text
        wait(driver, heard, 1.0)
        assert simulation.angles == pytest.approx(standing, abs=1.0)
        simulation.clear()
        wait(driver, heard, 1.0)
        actions.hold(driver)
        assert driver.leads.command(Targets({0: 150.0})) is None
        heard.until(lambda: heard.last is not None and heard.last.positions[0] > standing[0] + 2.0)


def test_a_hold_on_the_way_home_does_not_count_as_home() -> None:
    # Slow, so that the hold comes in the middle of the motion.
    with running(real_time_factor=0.5) as (driver, heard):
        with driver.action() as arm:
            arm.pose(150, None, None, None, None, None, None)
        # Otherwise a measurement from before the pose could be taken for the way home.
        heard.until(lambda: heard.last is not None and heard.last.positions[0] > 149.0)
        raised: list[Exception] = []

        def go() -> None:
            try:
                actions.home(driver)
            except sevenbot.Error as error:
                raised.append(error)

        mover = threading.Thread(target=go)
        mover.start()
        heard.until(lambda: heard.last is not None and heard.last.positions[0] < 145.0)
        actions.hold(driver)
        mover.join()
        assert [type(error) for error in raised] == [sevenbot.Interrupted]


def test_a_stop_during_a_hold_is_not_undone() -> None:
    with running() as (driver, _):
        stop_count = driver.interlock.stop_count
        actions.stop(driver)
        with pytest.raises(Halted):
            driver.interlock.release(stop_count)
        refusal = driver.leads.command(Targets({0: 91.0}))
        assert refusal is not None and refusal.key == "halted"


def test_a_command_that_comes_while_the_arm_is_lost_does_not_lead_the_next_one() -> None:
    heard = Heard()
    driver = Driver(Settings(port="sim"), heard)
    answers: list[Refusal | None] = []
    close_stream = driver.streamer.close

    def close() -> None:
        if driver.streamer.is_open:
            # Imitates another thread, which receives a command while the stream of the lost arm is closed.
            answers.append(driver.leads.command(Targets({0: 94.0})))
        close_stream()

    driver.streamer.close = close  # type: ignore[method-assign]
    driver.start()
    heard.until(lambda: heard.last is not None)
    heard.until(lambda: driver.leads.command(Targets({0: 92.0})) is None and driver.streamer.is_open)
    simulation = driver.arm().simulation
    assert isinstance(simulation, sevenbot.Simulation)
    simulation.unplug()
    heard.until(lambda: sum(" answers at " in text for text in heard.told) == 2)
    heard.until(lambda: driver.measurement is not None)
    wait(driver, heard, 1.0)
    assert [answer.key if answer else None for answer in answers] == ["no arm"]
    assert heard.last is not None and abs(heard.last.positions[0] - 90.0) < 0.5
    driver.close()
    assert not driver.has_failed
