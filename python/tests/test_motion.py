"""Streams, recordings and samples, on an arm in virtual time."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from itertools import groupby
from pathlib import Path

import pytest

import sevenbot

REST = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0]


def test_a_stream_leads_the_arm_and_puts_its_registers_back(simulated_arm: sevenbot.Arm) -> None:
    world = simulated_arm.simulation
    assert world is not None
    start = world.now
    with simulated_arm.stream(0.02) as stream:
        assert simulated_arm.get("set-point-period") == 20
        for step in range(100):
            stream.send([90 + step * 0.2, *[None] * 6])
    assert world.now - start == pytest.approx(2, abs=0.2)
    assert simulated_arm.get("set-point-period") == 0
    assert simulated_arm.get("fine-target.1") == 10980


def test_a_stream_that_begins_elsewhere_is_refused_or_approached(simulated_arm: sevenbot.Arm) -> None:
    world = simulated_arm.simulation
    assert world is not None
    simulated_arm.set("speed", 0)
    with pytest.raises(sevenbot.TooFar, match="joint 1") as refused:
        with simulated_arm.stream() as stream:
            stream.send([150, *[None] * 6])
    assert any("approach=" in hint for hint in refused.value.hints)
    assert simulated_arm.get("fine-target.1") == 9000
    # Also before the arm has measured its joints.
    with sevenbot.Arm.simulated() as early, pytest.raises(sevenbot.TooFar, match="joint 1"), early.stream() as stream:
        stream.send([120, *REST[1:]])
    start = world.now
    with simulated_arm.stream(approach=1.5) as stream:
        assert stream.send([150, *[None] * 6]) == 0
        assert world.now - start > 1.5
        assert stream.send([150.2, *[None] * 6]) == 1
    simulated_arm.sleep(1)
    assert world.angles[0] == pytest.approx(150, abs=1.5)
    with pytest.raises(ValueError, match="approach"):
        simulated_arm.stream(approach=0)
    with pytest.warns(sevenbot.GuardWarning, match="below the table"):
        with simulated_arm.stream(approach=1) as stream:
            stream.send([90, 20, 140, 90, 90, 90, 80])


def test_a_silent_stream_holds_and_a_slow_one_does_not(simulated_arm: sevenbot.Arm) -> None:
    with simulated_arm.stream(1.0) as stream:
        for angle in (90, 91, 92):
            stream.send([angle, *[None] * 6])
        status = simulated_arm.status()
        assert status is not None and "silent" not in status.faults
    with simulated_arm.stream(0.02) as stream:
        stream.send(REST)
        assert simulated_arm.simulation is not None
        simulated_arm.simulation.advance(1)
        status = simulated_arm.status()
        assert status is not None and "silent" in status.faults


def test_an_arm_has_one_stream_at_a_time(simulated_arm: sevenbot.Arm) -> None:
    one, two = simulated_arm.stream(0.02), simulated_arm.stream(0.05)
    with one:
        one.send(REST)
        for stream in (one, two):
            with pytest.raises(sevenbot.Closed, match="has an open stream already"):
                stream.__enter__()
        with pytest.raises(sevenbot.Closed, match="stream is not open"):
            two.send(REST)
        with pytest.raises(sevenbot.Closed, match="stream is not open"):
            two.__exit__()
        assert one.send(REST) == 1 and simulated_arm.get("set-point-period") == 20
    with two:
        assert two.send(REST) == 0
    simulated_arm.close()
    with pytest.raises(sevenbot.Closed, match="arm is closed"):
        two.__enter__()


def test_a_stream_ends_after_an_exception_and_refuses_wrong_values(simulated_arm: sevenbot.Arm) -> None:
    with pytest.raises(RuntimeError, match="mine"):
        with simulated_arm.stream() as stream:
            raise RuntimeError("mine")
    assert simulated_arm.get("set-point-period") == 0
    with pytest.raises(sevenbot.Closed):
        stream.send(REST)
    with pytest.raises(ValueError, match="0.005 to 1"):
        simulated_arm.stream(0.001)
    with pytest.raises(ValueError, match="watchdog"):
        simulated_arm.stream(0.02, watchdog=9)


def test_a_recording_is_played_and_saved(simulated_arm: sevenbot.Arm, tmp_path: Path) -> None:
    simulated_arm.pose([130, *REST[1:]], speed=40, wait=False)
    recorded = simulated_arm.record(2, hz=50)
    assert 90 <= len(recorded) <= 102
    assert recorded.duration == pytest.approx(2, abs=0.1)
    angles = [row[0] for row in recorded.angles]
    assert angles[0] < 95 and angles[-1] > 125
    recorded.save(tmp_path / "wave.txt")
    loaded = sevenbot.Recording.load(tmp_path / "wave.txt")
    assert list(loaded.times) == list(recorded.times)
    with pytest.raises(sevenbot.TooFar, match="joint 1 is at .* from"):
        simulated_arm.play(loaded)
    measured = simulated_arm.play(loaded, approach=2)
    assert measured.angles[-1][0] == pytest.approx(130, abs=2)
    assert "moments" in repr(measured) and not any(measured.vacuum)
    sucking = sevenbot.Recording.from_points([0, 0.5, 1], [measured.angles[-1]] * 3, vacuum=[False, True, False])
    assert [state for state, _ in groupby(simulated_arm.play(sucking, approach=1).vacuum)] == [False, True, False]


def test_a_guided_arm_is_recorded_and_holds_at_the_end(simulated_arm: sevenbot.Arm) -> None:
    assert simulated_arm.simulation is not None
    for joint in range(1, 8):
        simulated_arm.simulation.hold_by_hand(joint)
    recorded = simulated_arm.record(1, guided=True)
    assert len(recorded) > 20
    assert simulated_arm.get("motor-state") == 1


def test_points_make_a_recording_that_is_checked() -> None:
    recording = sevenbot.Recording.from_points([0, 2], [REST, [120, *REST[1:]]])
    assert recording.duration == 2 and recording.vacuum == [False, False]
    recording.check()
    with pytest.raises(sevenbot.BadRecording):
        recording.check(100)
    with pytest.raises(ValueError, match="lengths"):
        sevenbot.Recording.from_points([0], [])
    with pytest.raises(sevenbot.BadRecording):
        sevenbot.Recording.from_points([1, 0], [REST, REST])


def test_a_sample_is_evenly_spaced(simulated_arm: sevenbot.Arm) -> None:
    times, angles = simulated_arm.sample(50, period=0.02)
    assert len(times) == len(angles) == 50
    assert times[-1] == pytest.approx(0.98, abs=0.01)
    assert list(angles[-1]) == pytest.approx(REST, abs=1.5)


def test_bulk_numbers_are_numpy_arrays(simulated_arm: sevenbot.Arm) -> None:
    numpy = pytest.importorskip("numpy")
    times, angles = simulated_arm.sample(10)
    assert times.shape == (10,) and angles.shape == (10, 7)
    assert angles.dtype == numpy.float64 and angles.flags.writeable


def test_without_numpy_there_are_tuples(tmp_path: Path) -> None:
    script = (
        "import sys; sys.modules['numpy'] = None\n"
        "import sevenbot\n"
        "times, angles = sevenbot.Arm.simulated().sample(3)\n"
        "assert isinstance(times, tuple) and isinstance(angles, tuple) and len(angles[0]) == 7\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, cwd=tmp_path)


def test_a_recording_has_no_moments_of_the_move_before(simulated_arm: sevenbot.Arm) -> None:
    points = [REST, [100, *REST[1:]]]
    simulated_arm.play(sevenbot.Recording.from_points([0, 2], points))
    simulated_arm.pose([30, *REST[1:]])
    recorded = simulated_arm.record(2, hz=50)
    assert len(recorded) == 101
    assert set(recorded.angles[:, 0]) == {simulated_arm.angles[0]}


def test_many_frames_are_no_restart_and_a_restart_after_them_is_told(simulated_arm: sevenbot.SimulatedArm) -> None:
    points = [REST, [92, *REST[1:]]]
    # The arm accepts 50 points a second, and its counter of frames has 16 bits.
    simulated_arm.play(sevenbot.Recording.from_points([0, 700], points), approach=1)
    simulated_arm.simulation.later(0.2, "restart")
    with pytest.raises(sevenbot.ArmProblem, match="restarted"):
        simulated_arm.torque_on()
    simulated_arm.sample(40_000)
    simulated_arm.simulation.later(0.5, "restart")
    with pytest.raises(sevenbot.ArmProblem, match="restarted"):
        simulated_arm.sample(2_000)


@pytest.mark.parametrize("hold", [sevenbot.Arm.stop, sevenbot.Arm.torque_on])
def test_a_joint_that_is_dragged_away_does_not_hold(
    simulated_arm: sevenbot.SimulatedArm, hold: Callable[[sevenbot.Arm], object]
) -> None:
    simulated_arm.simulation.fault("2=push=-3000")
    simulated_arm.sleep(0.2)
    with pytest.raises(sevenbot.MayMove, match="joint 2 is at 0"):
        hold(simulated_arm)


def test_samples_and_recordings_wait_for_the_first_measurement() -> None:
    with sevenbot.Arm.simulated() as arm:
        _, rows = arm.sample(3)
        assert rows[0] == pytest.approx(REST, abs=3)
    with sevenbot.Arm.simulated() as arm:
        recording = arm.record(1)
        assert recording.angles[0] == pytest.approx(REST, abs=3)


def test_a_park_pose_that_cannot_be_kept_is_told(
    simulated_arm: sevenbot.SimulatedArm, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ["HOME", "XDG_CONFIG_HOME"]:
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(OSError, match="parked, but the pose is not kept"):
        simulated_arm.park(None, 90, 0, 90, 48, None, None, keep=True)
