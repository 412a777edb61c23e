"""Many simulated arms in a step."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable

import numpy
import pytest
from numpy.typing import NDArray

import sevenbot

REST = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0]
Arms = sevenbot.SimulatedArms
#: The timeout of waits in seconds. It is long, because the machine may be busy.
ENOUGH = 120.0


def actions(n: int, step: int) -> NDArray[numpy.float64]:
    """Angles near the pose of rest, which differ between neighbouring arms and steps."""
    turns = numpy.add.outer(numpy.arange(n) * 7 + step * 3, numpy.arange(7) * 5) % 11
    angles: NDArray[numpy.float64] = numpy.array(REST) + turns - 6.0
    return angles


def run(threads: int) -> NDArray[numpy.float64]:
    """All observations of 30 steps of 70 arms with faults and loads."""
    arms = Arms(70, seed=5, threads=threads)
    number = numpy.arange(70)
    arms.set_load(number % 5 * 60)
    arms.fault(number % 3 == 0, "line=corruption=1%")
    arms.fault(number % 4 == 1, "2=wall=88")
    arms.fault(number % 7 == 2, "3=late=20", 0.3)
    return numpy.array([arms.step(actions(70, step)) for step in range(30)])


def test_the_number_of_threads_changes_nothing() -> None:
    alone = run(1)
    assert not numpy.isnan(alone).any() and (alone[:, :, Arms.AGE] > 0).any()
    assert alone.tobytes() == run(2).tobytes() == run(7).tobytes()


def test_a_seed_determines_the_faults_of_the_line() -> None:
    arms = Arms(4, seeds=[3, 4, 3, 2**64 - 1], threads=1)
    arms.fault(None, "line=loss=0.5%")
    seen = numpy.array([arms.step(numpy.tile(REST, (4, 1)))[:, Arms.AGE] for _ in range(100)])
    assert (seen[:, 0] == seen[:, 2]).all()
    assert (seen[:, 0] != seen[:, 1]).any()
    arms.reset(seeds=[4, 4, 4, 4])
    arms.fault(None, "line=loss=0.5%")
    again = numpy.array([arms.step(numpy.tile(REST, (4, 1)))[:, Arms.AGE] for _ in range(100)])
    assert (again == seen[:, 1:2]).all()


def test_an_arm_of_many_goes_as_the_simulation_alone_goes() -> None:
    arms = Arms(3, threads=2)
    for step in range(20):
        seen = arms.step(actions(3, step))
    with sevenbot.Arm.simulated() as arm:
        arm.simulation.restore(arms.snapshot(1))
        assert arm.simulation.angles == tuple(arms.angles[1])
        assert arm.simulation.now == arms.time[1] == pytest.approx(1.4)
        assert arm.observe().positions == pytest.approx(seen[1, Arms.POSITIONS], abs=0.5)
        # Both go on without another action.
        before = arm.simulation.now
        arms.step(None, 0.02)
        arm.simulation.restore(arms.snapshot(1))
        arm.simulation.advance(1)
        for _ in range(50):
            arms.step(None)
        assert arm.simulation.angles == tuple(arms.angles[1])
        assert arms.time[1] > before
    tip = sevenbot.forward(seen[2, Arms.POSITIONS]).tip
    assert seen[2, Arms.TIP] == pytest.approx(tip)


@pytest.mark.parametrize("kind", [numpy.float32, numpy.float64])
def test_arrays_are_read_and_filled_in_place(kind: type[numpy.float32]) -> None:
    arms = Arms(5)
    wanted = numpy.array(actions(5, 0), dtype=kind)
    out = numpy.empty((5, 32), dtype=kind)
    assert arms.step(wanted, 0.02, out) is out
    seen = arms.step(wanted)
    assert seen.dtype == kind and seen.shape == (5, 32)
    assert arms.observe(out) is out
    assert (out == seen).all()
    assert arms.observe() == pytest.approx(seen, rel=1e-5)
    # Arrays with gaps are copied, and so are lists.
    assert arms.step(numpy.zeros((5, 14), dtype=kind)[:, ::2] + 90).shape == (5, 32)
    arms.step(numpy.full((10, 7), 90, dtype=kind)[::2])
    arms.step([REST] * 5)


def test_masks_choose_arms() -> None:
    arms = Arms(3, threads=1)
    mask = numpy.array([False, True, False])
    arms.fault(mask, "1=missing")
    arms.set("push-limit", 30, [True, False, False])
    turned = numpy.tile([100.0, *REST[1:]], (3, 1))
    for _ in range(50):
        seen = arms.step(turned)
    assert seen[:, 0] == pytest.approx([100, 90, 100], abs=1)
    arms.reset(numpy.array([True, False, False]))
    assert arms.time == pytest.approx([1, 2, 2])
    assert arms.observe()[:, 0] == pytest.approx([90, 90, 100], abs=1)
    arms.clear(mask, "1")
    for _ in range(100):
        seen = arms.step(turned)
    assert seen[:, 0] == pytest.approx([100, 100, 100], abs=1)
    arms.reset(None, arms.snapshot(2))
    assert (arms.observe()[0] == arms.observe()[1]).all()


def seen_from(snapshot: sevenbot.SimulationSnapshot) -> NDArray[numpy.float64]:
    """All observations of ten steps of two arms that begin as this snapshot."""
    arms = Arms(2, threads=1)
    arms.reset(snapshot=snapshot)
    return numpy.array([arms.step(actions(2, step)) for step in range(10)])


def test_arms_of_another_process_begin_with_a_snapshot() -> None:
    arms = Arms(3)
    arms.fault(None, "line=corruption=5%")
    arms.set_load(200)
    for step in range(20):
        arms.step(actions(3, step))
    snapshot = arms.snapshot(1)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        there = pool.apply(seen_from, (snapshot,))
    assert there.tobytes() == seen_from(snapshot).tobytes()


def test_a_wall_blocks_and_a_load_is_felt() -> None:
    arms = Arms(2)
    arms.set_load([0, 300])
    arms.fault([True, False], "1=wall=95")
    turned = numpy.tile([110.0, *REST[1:]], (2, 1))
    for _ in range(200):
        seen = arms.step(turned)
    assert seen[:, Arms.BLOCKED].tolist() == [[1, 0, 0, 0, 0, 0, 0], [0] * 7]
    assert abs(seen[1, 16]) > abs(seen[0, 16])


def test_servos_differ_from_arm_to_arm() -> None:
    arms = Arms(3)
    arms.set_load(300)
    arms.scale_servos([0.5, 1, 2], 1)
    for _ in range(100):
        seen = arms.step(numpy.tile(REST, (3, 1)))
    loads = numpy.abs(seen[:, 16])
    # The weakest one pushes as hard as its limit lets it.
    assert loads[0] > 1.2 * loads[1] > 1.2 * 1.2 * loads[2] > 10
    # The weight turns a weaker joint further off its target.
    assert seen[0, 2] - 65 > 1.5 * (seen[1, 2] - 65) > 0
    arms.reset()
    arms.set_load(300)
    for _ in range(100):
        seen = arms.step(numpy.tile(REST, (3, 1)))
    assert (seen[0, :31] == seen[1, :31]).all()
    for torque, friction, word in [(0.05, 1, "torque"), (1, 20, "friction"), (numpy.nan, 1, "torque")]:
        with pytest.raises(ValueError, match=f"{word}: .* 0.1 to 10"):
            arms.scale_servos(torque, friction)


WRONG: dict[str, tuple[type[Exception], str, Callable[[], object]]] = {
    "no number": (ValueError, "arm 1, joint 2: NaN", lambda: Arms(2).step([REST, [90, numpy.nan, *REST[2:]]])),
    "out of range": (ValueError, "arm 0, joint 1: 181", lambda: Arms(1).step([[181, *REST[1:]]])),
    "shape": (ValueError, r"\(3, 7\): use \(2, 7\)", lambda: Arms(2).step([REST] * 3)),
    "dimensions": (ValueError, r"\(7,\): use \(2, 7\)", lambda: Arms(2).step(REST)),
    "text": (TypeError, "actions", lambda: Arms(1).step("seven")),
    "time": (ValueError, "0.005 to 1 s", lambda: Arms(1).step([REST], 0.0201)),
    "out": (ValueError, r"use \(1, 32\)", lambda: Arms(1).step([REST], out=numpy.zeros((2, 32)))),
    "out of ints": (TypeError, "out", lambda: Arms(1).observe(numpy.zeros((1, 32), dtype=int))),
    "mask": (TypeError, "2 truth values", lambda: Arms(2).reset([True])),
    "mask of numbers": (TypeError, "truth values", lambda: Arms(2).reset([0, 1])),
    "fault": (ValueError, "nonsense", lambda: Arms(1).fault(None, "nonsense")),
    "load": (ValueError, "grams: 1001", lambda: Arms(1).set_load(1001)),
    "measured": (ValueError, "arm 0, joint 2", lambda: Arms(1).exchange([[*REST, 0, numpy.nan, *[0] * 12]])),
    "measured shape": (ValueError, r"\(1, 21\)", lambda: Arms(1).exchange([REST])),
    "exchange time": (ValueError, "0.001 to 1 s", lambda: Arms(1).exchange([[0] * 21], 0.0005)),
    "period": (ValueError, "0.005 to 1 s", lambda: Arms(1).send([REST], 0.002)),
    "loads": (TypeError, "grams", lambda: Arms(2).set_load([1, 2, 3])),
    "register": (KeyError, "no register", lambda: Arms(1).set("nonsense", 1)),
    "no arms": (ValueError, "n: 0", lambda: Arms(0)),
    "threads": (ValueError, "threads", lambda: Arms(1, threads=0)),
    "seeds": (TypeError, "2 whole numbers", lambda: Arms(2, seeds=[1])),
    "arm": (ValueError, "arm: 2", lambda: Arms(2).snapshot(2)),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_said(name: str) -> None:
    kind, words, call = WRONG[name]
    with pytest.raises(kind, match=words) as caught:
        call()
    assert isinstance(caught.value, sevenbot.Error)


def test_an_array_is_not_read_while_it_is_written() -> None:
    arms = Arms(1)
    numbers = numpy.zeros((1, 39))
    fixed = numpy.zeros((1, 32))
    fixed.flags.writeable = False
    with pytest.raises(ValueError, match="read-only"):
        arms.step([REST], out=fixed)
    with pytest.raises(ValueError, match="both"):
        arms.step(numbers[:, :7], out=numbers[:, :32])


def test_ctrl_c_ends_steps(ctrl_c: None) -> None:
    arms = Arms(50)
    threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        while True:
            arms.step(numpy.tile(REST, (50, 1)), 1.0)
    assert len(set(arms.time)) == 1, "no arm is ahead of the others"


def test_other_threads_run_during_a_step() -> None:
    arms = Arms(200, threads=1)
    times: list[float] = []

    def step() -> None:
        times.append(time.monotonic())
        arms.step(None, 1.0)
        times.append(time.monotonic())

    def runs_during_a_step() -> bool:
        """Does this thread run in the middle of a step? At both ends of it another thread has its turn in any case."""
        times.clear()
        seen = []
        thread = threading.Thread(target=step)
        thread.start()
        while thread.is_alive():
            seen.append(time.monotonic())
            time.sleep(0.001)
        begin, end = times
        quarter = (end - begin) / 4
        return any(begin + quarter < seen_at < end - quarter for seen_at in seen)

    # A busy machine may run the threads in turn for a while.
    deadline = time.monotonic() + ENOUGH
    while not runs_during_a_step():
        assert time.monotonic() < deadline


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
