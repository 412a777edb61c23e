"""What a user meets within an hour: wrong arguments, other threads, forks, Ctrl-C, and the ways of Python."""

from __future__ import annotations

import _thread
import copy
import multiprocessing
import os
import pickle
import pty
import subprocess
import sys
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy
import pytest

import sevenbot

REST = (90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0)
#: The timeout of waits in seconds. It is long, because the machine may be busy.
ENOUGH = 120.0


def in_a_process(program: str) -> str:
    """Runs a program in a process of its own, and returns what it prints. Fails if the program fails or does not end."""
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, timeout=ENOUGH)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize("speed", [0, 1e-3, -5, float("nan"), float("inf"), 501])
def test_a_straight_line_has_a_range_of_speeds(simulated_arm: sevenbot.Arm, speed: float) -> None:
    with pytest.raises(ValueError, match="1 to 500"):
        simulated_arm.move_to(0, 185, 60, straight=True, speed=speed)
    assert simulated_arm.get("fine-target.1") == 9000


def test_a_straight_line_takes_its_duration(simulated_arm: sevenbot.SimulatedArm) -> None:
    simulated_arm.move_to(-50, 185, 60)
    start = simulated_arm.simulation.now
    simulated_arm.move_to(50, 185, 60, straight=True, duration=8)
    assert 8 <= simulated_arm.simulation.now - start < 11
    for wrong in [0, -1, float("nan"), 601]:
        with pytest.raises(ValueError, match="0.1 to 600"):
            simulated_arm.move_to(-50, 185, 60, straight=True, duration=wrong)
    with pytest.raises(ValueError, match="100 mm in 0.1 s"):
        simulated_arm.move_to(-50, 185, 60, straight=True, duration=0.1)
    with pytest.raises(TypeError, match="not both"):
        simulated_arm.move_to(-50, 185, 60, straight=True, duration=2, speed=40)
    with pytest.raises(TypeError, match="wait=True"):
        simulated_arm.move_to(-50, 185, 60, straight=True, wait=False)
    assert simulated_arm.where().tip[0] == pytest.approx(50, abs=6), "nothing moved it since"


@pytest.mark.parametrize("watchdog", [0.004, -0.3, -0.001, 2.56, float("nan")])
def test_a_watchdog_is_never_rounded_to_none(simulated_arm: sevenbot.Arm, watchdog: float) -> None:
    with pytest.raises(ValueError, match="0.01 to 2.55"):
        simulated_arm.stream(0.02, watchdog=watchdog)
    with pytest.raises(ValueError, match="0.005 to 1"):
        simulated_arm.stream(0.0046)
    with simulated_arm.stream(0.02, watchdog=0):
        assert simulated_arm.get("watchdog") == 0


# The first lines of the scripts that fork.
FORKED = """
import os, signal, threading, time, sevenbot

def check_refused(*calls):
    for call in calls:
        try:
            call()
            os._exit(1)
        except sevenbot.Closed as error:
            if "forked" not in str(error):
                os._exit(2)
"""

FORK = FORKED + """
arm = sevenbot.Arm.simulated()
child = os.fork()
if child == 0:
    signal.alarm(60)
    check_refused(lambda: arm.get("speed"), lambda: arm.angles, arm.stop, lambda: arm.simulation.now)
    arm.close()
    with arm:
        pass
    if "closed" not in repr(arm) or hasattr(arm, "angles"):
        os._exit(3)
    own = sevenbot.Arm.simulated()
    own.get("speed")
    del arm
    os._exit(0)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), arm.get("speed.1"))
"""


def test_a_forked_process_is_told_so() -> None:
    assert in_a_process(FORK).split()[0] == "0"


FORK_OF_MANY = FORKED + """
arms = sevenbot.SimulatedArms(2000, threads=2)
snapshot = arms.snapshot(0)
is_over = threading.Event()

def make_steps():
    while not is_over.is_set():
        arms.step(None, 1.0)

steps = threading.Thread(target=make_steps)
steps.start()
time.sleep(0.05)
child = os.fork()
if child == 0:
    signal.alarm(60)
    check_refused(
        lambda: arms.step(None), arms.read, arms.observe, arms.reset, arms.clear, lambda: arms.snapshot(0),
        lambda: arms.set("speed", 50), lambda: arms.set_load(10), lambda: arms.scale_servos(1, 1),
    )
    if hasattr(arms, "angles") or hasattr(arms, "time") or len(arms) != 2000:
        os._exit(3)
    own = sevenbot.SimulatedArms(2, threads=2)
    own.reset(snapshot=snapshot)
    own.step(None)
    del arms
    os._exit(0)
is_over.set()
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
steps.join()
print(len(arms.read()))
"""


def test_a_process_forked_off_during_a_step_of_many_arms_is_told_so() -> None:
    assert in_a_process(FORK_OF_MANY).split() == ["0", "2000"]


NO_THREAD = """
import os
# More than a process can have: no thread begins.
os.environ["RUST_MIN_STACK"] = str(2**50)
import sevenbot
try:
    sevenbot.Arm.simulated()
except sevenbot.PortError as error:
    print("no thread" in str(error), "close" in error.hints[0])
"""


def test_an_arm_without_a_thread_raises_an_exception_of_the_package() -> None:
    assert in_a_process(NO_THREAD) == "True True\n"


def test_restore_inside_a_stream_keeps_its_period(simulated_arm: sevenbot.SimulatedArm) -> None:
    world = simulated_arm.simulation
    before = world.snapshot()
    world.advance(10)
    with simulated_arm.stream(0.02) as stream:
        for step in range(20):
            stream.send([90 + step * 0.1, *REST[1:]])
        during = world.snapshot()
        stream.send(REST)
        for snapshot in [before, during]:
            world.restore(snapshot)
            start = world.now
            for step in range(50):
                stream.send([90.1 + step * 0.1, *REST[1:]])
            assert world.now - start < 2
            assert simulated_arm.get("set-point-period") == 20
        world.restore(before)
        with pytest.raises(sevenbot.TooFar):
            stream.send([120, *REST[1:]])


def test_a_lost_reply_after_a_restore_costs_as_much_as_before(simulated_arm: sevenbot.SimulatedArm) -> None:
    world = simulated_arm.simulation
    before = world.snapshot()
    simulated_arm.sleep(100)
    simulated_arm.get("speed.1")
    world.restore(before)
    start = world.now
    world.fault("line=corruption=100%", 0.01)
    simulated_arm.get("speed.1")
    assert world.now - start < 1


def test_a_pose_returns_where_the_arm_rests(simulated_arm: sevenbot.SimulatedArm) -> None:
    for goal in [(120.0, 70.0, 90.0), (60.5, 110.25, 60.0)]:
        returned = simulated_arm.pose(*goal, *REST[3:], speed=190)
        simulated_arm.sleep(3)
        assert returned == pytest.approx(simulated_arm.angles, abs=0.15)
    assert any(angle != round(angle) for angle in returned), "hundredths"


def test_the_registers_are_a_mapping(simulated_arm: sevenbot.Arm) -> None:
    registers = simulated_arm.registers
    keys = registers.keys()
    assert len(keys) == len(set(keys)) == len(registers)
    values = dict(registers)
    assert list(values) == keys == list(registers)
    assert values["speed"] == registers.get("speed")
    assert registers.get("nonsense") is None and registers.get("nonsense", 5) == 5
    assert len(registers.values()) == len(keys)
    assert dict(registers.items())["speed"] == values["speed"]
    assert registers._ipython_key_completions_() == keys
    with sevenbot.Arm.simulated(map="2.1") as other:
        assert len(dict(other.registers)) > 20


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_ends_advance(simulated_arm: sevenbot.SimulatedArm) -> None:
    world = simulated_arm.simulation
    start = world.now
    timer = threading.Timer(0.05, _thread.interrupt_main)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        world.advance(86_400)
    timer.join()
    assert world.now - start < 86_400, "not to the end"


SILENT_PORT = """
import os, pty, signal, sys, threading, _thread
import sevenbot
signal.signal(signal.SIGINT, signal.default_int_handler)
master, slave = pty.openpty()
timer = threading.Timer(0.2, _thread.interrupt_main)
timer.start()
try:
    sevenbot.Arm(os.ttyname(slave), timeout=3000)
except KeyboardInterrupt:
    print("interrupted")
"""


def test_ctrl_c_ends_the_opening_of_a_silent_port() -> None:
    assert in_a_process(SILENT_PORT) == "interrupted\n"


@pytest.mark.parametrize("angles", [b"1234567", bytearray(7), "1234567", {1, 2, 3, 4, 5, 6, 7}, dict.fromkeys(range(7))])
def test_what_is_no_list_of_angles_is_refused(simulated_arm: sevenbot.Arm, angles: object) -> None:
    before = simulated_arm.get("fine-target")
    with pytest.raises(TypeError, match="seven numbers") as refused:
        simulated_arm.pose(angles)  # type: ignore[call-overload]
    assert "Goals" not in str(refused.value)
    assert simulated_arm.get("fine-target") == before


def test_arrays_lists_and_paths_are_taken(simulated_arm: sevenbot.Arm, tmp_path: Path) -> None:
    simulated_arm.pose(numpy.array([100, *REST[1:]], dtype=numpy.float32))
    simulated_arm.pose(angle for angle in REST)
    simulated_arm.move_to(0, 185, 60, tool=[0, 0, -1])
    simulated_arm.move_to(0, 185, 60, tool=numpy.array([0, 0, -2.0]))
    simulated_arm.set("speed", numpy.full(7, 20))
    assert simulated_arm.get("speed") == [20] * 7
    simulated_arm.set("speed.1", numpy.int64(5))
    with simulated_arm.stream() as stream:
        stream.send(numpy.array(simulated_arm.angles))
    recording = sevenbot.Recording.from_points(
        numpy.array([0, 1]), numpy.array([REST, REST]), numpy.array([True, False])
    )
    assert recording.vacuum == [True, False]
    with pytest.raises(sevenbot.PortError, match="no such port"):
        sevenbot.Arm(tmp_path / "no-port")


@pytest.mark.parametrize("failure", [KeyboardInterrupt, RuntimeError, TypeError])
def test_an_exception_of_a_generator_is_not_replaced(
    simulated_arm: sevenbot.Arm, failure: type[BaseException]
) -> None:
    def numbers() -> Iterator[int]:
        yield 90
        raise failure("mine")

    calls: list[Callable[[], object]] = [
        lambda: simulated_arm.pose(numbers()),
        lambda: simulated_arm.set("speed", numbers()),
        lambda: simulated_arm.move_to(0, 185, 60, tool=numbers()),
        lambda: sevenbot.Recording.from_points(numbers(), [REST]),
        lambda: sevenbot.Recording.from_points([0], [numbers()]),
        lambda: sevenbot.Recording.from_points([0], [REST], map(bool, numbers())),
        lambda: sevenbot.SimulatedArms(2, seeds=numbers()),
    ]
    for call in calls:
        with pytest.raises(failure, match="mine") as raised:
            call()
        assert not isinstance(raised.value, sevenbot.Error)


Wrong = Callable[[sevenbot.SimulatedArm], object]
WRONG: dict[str, tuple[type[Exception], Wrong]] = {
    "six angles": (TypeError, lambda arm: arm.pose([1, 2, 3, 4, 5, 6])),
    "a text among angles": (TypeError, lambda arm: arm.pose(["x", 2, 3, 4, 5, 6, 7])),  # type: ignore[list-item]
    "not a number": (ValueError, lambda arm: arm.pose([float("nan"), 2, 3, 4, 5, 6, 7])),
    "a tool of two": (TypeError, lambda arm: arm.move_to(0, 185, 60, tool=(0, 1))),
    "no position": (sevenbot.OutOfReach, lambda arm: arm.move_to(float("nan"), 185, 60)),
    "a text in a register": (TypeError, lambda arm: arm.set("speed", "x")),  # type: ignore[arg-type]
    "a fraction in a register": (TypeError, lambda arm: arm.set("speed", 1.5)),  # type: ignore[arg-type]
    "a huge number": (ValueError, lambda arm: arm.set("speed", 2**70)),
    "no name": (KeyError, lambda arm: arm.get("nonsense")),
    "hz": (ValueError, lambda arm: arm.record(1, hz=300)),
    "times": (ValueError, lambda arm: arm.play(arm.record(0.1), times=-1)),
    "a speed of play": (ValueError, lambda arm: arm.play(arm.record(0.1), speed=float("nan"))),
    "count": (ValueError, lambda arm: arm.sample(-1)),
    "seconds": (ValueError, lambda arm: arm.sleep(-1)),
    "a joint": (ValueError, lambda arm: arm.simulation.trip(300)),
    "grams": (ValueError, lambda arm: setattr(arm.simulation, "load_grams", -1)),
    "seed": (ValueError, lambda arm: sevenbot.Arm.simulated(-1)),
    "attempts": (ValueError, lambda arm: sevenbot.Arm.simulated(attempts=-1)),
    "baud": (ValueError, lambda arm: sevenbot.Arm("x", baud=-1)),
    "baud of ports": (ValueError, lambda arm: sevenbot.ports(1)),
    "a port": (TypeError, lambda arm: sevenbot.Arm(5)),  # type: ignore[arg-type]
    "rows": (TypeError, lambda arm: sevenbot.Recording.from_points([0], [[1, 2]])),
    "a file": (FileNotFoundError, lambda arm: sevenbot.Recording.load("/no/such/file")),
    "a folder": (OSError, lambda arm: arm.record(0.1).save("/no/such/file")),
    "park": (TypeError, lambda arm: arm.park(keep=True)),
}


@pytest.mark.parametrize("name", WRONG)
def test_every_exception_is_one_of_the_package_in_words_of_python(
    simulated_arm: sevenbot.SimulatedArm, name: str
) -> None:
    kind, call = WRONG[name]
    with pytest.raises(sevenbot.Error) as raised:
        call(simulated_arm)
    assert isinstance(raised.value, kind)
    for word in ["Goals", "field", "enum", "Values", "u8", "i32", "Vec", "--"]:
        assert word not in str(raised.value)
    assert raised.value.hints == () or all("--baud" not in hint for hint in raised.value.hints)


def test_a_missing_file_has_the_attributes_of_python() -> None:
    with pytest.raises(FileNotFoundError) as missing:
        sevenbot.Recording.load(Path("/no/such/file"))
    assert missing.value.filename in ["/no/such/file", Path("/no/such/file")] and missing.value.errno == 2


def test_the_hints_name_arguments_of_python() -> None:
    master, slave = pty.openpty()
    try:
        with pytest.raises(sevenbot.NoAnswer) as silent:
            sevenbot.Arm(os.ttyname(slave), timeout=0.01, attempts=1)
        assert any("baud=" in hint for hint in silent.value.hints)
        assert all("--baud)" not in hint for hint in silent.value.hints)
    finally:
        os.close(master)
        os.close(slave)


def test_a_closed_arm_has_no_angles(simulated_arm: sevenbot.Arm) -> None:
    assert hasattr(simulated_arm, "angles")
    simulated_arm.close()
    assert not hasattr(simulated_arm, "angles")
    with pytest.raises(sevenbot.Closed):
        simulated_arm.angles


def stopped(arm: sevenbot.Arm, call: Callable[[], object]) -> BaseException | None:
    """Runs a call in another thread, and stops the arm until the call ends. Returns the exception of the call."""
    raised: list[BaseException] = []
    begun, ended = threading.Event(), threading.Event()

    def run() -> None:
        begun.set()
        try:
            call()
        except sevenbot.Error as error:
            raised.append(error)
        ended.set()

    thread = threading.Thread(target=run)
    thread.start()
    begun.wait()
    while not ended.is_set():
        arm.stop()
    thread.join()
    return raised[0] if raised else None


def test_a_stopped_sample_and_a_stopped_recording_say_so(simulated_arm: sevenbot.Arm) -> None:
    sampled = stopped(simulated_arm, lambda: simulated_arm.sample(100_000_000))
    assert isinstance(sampled, sevenbot.Interrupted)
    recorded = stopped(simulated_arm, lambda: simulated_arm.record(80_000))
    assert isinstance(recorded, sevenbot.Interrupted)


def test_a_recording_that_fails_late_keeps_what_it_has(simulated_arm: sevenbot.SimulatedArm) -> None:
    simulated_arm.simulation.later(2, "fault 3=missing")
    with pytest.raises(sevenbot.ArmProblem, match="joint 3") as failed:
        simulated_arm.record(10, hz=50)
    assert failed.value.recording is not None
    assert 1.5 < failed.value.recording.duration < 5


def test_an_arm_can_be_read_while_another_thread_waits_for_it(simulated_arm: sevenbot.SimulatedArm) -> None:
    done = threading.Event()

    def wave() -> None:
        while not done.is_set():
            simulated_arm.pose([150, *REST[1:]], speed=1.9)
            simulated_arm.pose([30, *REST[1:]], speed=1.9)

    thread = threading.Thread(target=wave)
    thread.start()
    try:
        # Only a read during the call shows an angle between the ends of the way.
        while not 60 < simulated_arm.angles[0] < 85:
            pass
        assert simulated_arm.get("speed.1") == 1
        assert simulated_arm.status() is not None and simulated_arm.where() is not None
    finally:
        done.set()
    thread.join()


def test_a_write_waits_for_the_call_before(simulated_arm: sevenbot.SimulatedArm) -> None:
    world = simulated_arm.simulation
    start = world.now
    thread = threading.Thread(target=lambda: simulated_arm.sleep(400))
    thread.start()
    while world.now < start + 20:
        pass
    simulated_arm.set("speed.1", 7)
    assert world.now >= start + 400
    thread.join()


def test_values_are_equal_and_can_be_pickled(simulated_arm: sevenbot.Arm) -> None:
    status, tip, recording = simulated_arm.status(), simulated_arm.where(), simulated_arm.record(0.5)
    for value in [status, tip, recording]:
        other = pickle.loads(pickle.dumps(value))
        assert other == value and other is not value and hash(other) == hash(value)
        assert value != 5 and not value == "x"
        assert str(other) == str(value) and repr(other) == repr(value)
    simulated_arm.pose([120, *REST[1:]])
    assert simulated_arm.where() != tip and simulated_arm.status() != status
    assert simulated_arm.record(0.5) != recording


def test_what_an_arm_tells_can_be_pickled(simulated_arm: sevenbot.SimulatedArm) -> None:
    simulated_arm.simulation.fault("3=missing")
    simulated_arm.sleep(1)
    status, seen = simulated_arm.status(), simulated_arm.observe()
    assert status is not None and status.problems
    for value in [*status.problems, *status.joints]:
        other = pickle.loads(pickle.dumps(value))
        names = [name for name in dir(value) if not name.startswith("_")]
        assert [getattr(other, name) for name in names] == [getattr(value, name) for name in names]
        assert repr(other) == repr(value) and str(other) == str(value)
    other = pickle.loads(pickle.dumps(seen))
    assert (other.time, other.age) == (seen.time, seen.age) and repr(other) == repr(seen)
    for name in ["positions", "velocities", "loads"]:
        assert getattr(other, name).tolist() == getattr(seen, name).tolist()
    assert other.monotonic == seen.monotonic
    assert pickle.loads(pickle.dumps(other)).monotonic == other.monotonic
    simulated_arm.simulation.clear()
    simulated_arm.sleep(1)
    with simulated_arm.stream(guard=False) as stream:
        stream.latest(simulated_arm.angles)
        simulated_arm.sleep(0.2)
        counts = stream.counts
    assert counts.sent > 1 and pickle.loads(pickle.dumps(counts)) == counts


def test_a_pickled_snapshot_is_the_same_arm(simulated_arm: sevenbot.SimulatedArm) -> None:
    world = simulated_arm.simulation
    world.scene = "cube red 30 40 0 200; cube blue 30 40 -80 190"
    world.load_grams = 100
    world.fault("1=wall=105/500")
    world.fault("line=corruption=1%")
    world.later(1, "fault 3=garbled=5")
    simulated_arm.pose([120, *REST[1:]], wait=False)
    simulated_arm.sleep(0.5)
    snapshot = world.snapshot()
    for other in [pickle.loads(pickle.dumps(snapshot)), copy.deepcopy(snapshot), copy.copy(snapshot)]:
        assert other == snapshot and hash(other) == hash(snapshot) and repr(other) == repr(snapshot)
    assert snapshot != 5 and snapshot is not other

    def rest(snapshot: sevenbot.SimulationSnapshot) -> tuple[list[object], sevenbot.SimulationSnapshot]:
        world.restore(snapshot)
        seen: list[object] = []
        for _ in range(10):
            world.advance(0.2)
            seen += [world.angles, world.faults, world.things]
        return seen, world.snapshot()

    assert rest(snapshot) == rest(other)
    assert world.snapshot() != snapshot


def test_bytes_that_are_no_snapshot_are_refused(simulated_arm: sevenbot.SimulatedArm) -> None:
    reduced = simulated_arm.simulation.snapshot().__reduce__()
    assert isinstance(reduced, tuple)
    make, (content,) = reduced
    assert isinstance(content, bytes) and isinstance(make(content), sevenbot.SimulationSnapshot)
    middle = len(content) // 2
    wrong = [
        (b"", "not a snapshot"),
        (b"x" + content, "not a snapshot"),
        (content[:-1], "damaged"),
        (content + b"\0", "damaged"),
        (content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :], "damaged"),
    ]
    for other, words in wrong:
        with pytest.raises(sevenbot.InvalidValue, match=words):
            make(other)
    # Another version, with the checksum that it would have.
    text = len(b"7BotSim") + 1
    part = content[text - 1 : text] + b"9" + content[text + 1 : -4]
    with pytest.raises(ValueError, match=r"made by version 9\S+, and this is version \d"):
        make(b"7BotSim" + part + zlib.crc32(part).to_bytes(4, "little"))


def raise_of_file(path: str) -> None:
    sevenbot.Recording.load(path)


def raise_of_arm(fault: str) -> None:
    with sevenbot.Arm.simulated() as arm:
        arm.sleep(1)
        arm.simulation.fault(fault)
        arm.sleep(1)
        arm.angles


def raise_of_closed(what: str) -> None:
    arm = sevenbot.Arm.simulated()
    arm.close()
    getattr(arm, what)


@pytest.mark.parametrize(
    ("call", "argument", "kinds"),
    [
        (raise_of_file, "/no/such/file", [sevenbot.FileError, FileNotFoundError]),
        (raise_of_file, "/", [sevenbot.FileError, IsADirectoryError]),
        (raise_of_arm, "3=missing", [sevenbot.ArmProblem]),
        (raise_of_arm, "no fault", [sevenbot.InvalidValue]),
        (raise_of_closed, "angles", [sevenbot.Closed, AttributeError]),
    ],
)
def test_an_exception_goes_through_a_process(
    call: Callable[[str], None], argument: str, kinds: list[type[Exception]]
) -> None:
    with pytest.raises(sevenbot.Error) as here:
        call(argument)
    with multiprocessing.get_context("spawn").Pool(1) as pool, pytest.raises(sevenbot.Error) as there:
        pool.apply(call, (argument,))
    for error in [there.value, pickle.loads(pickle.dumps(there.value)), copy.copy(here.value)]:
        assert all(isinstance(error, kind) for kind in kinds)
        assert type(error).__name__ == type(here.value).__name__ and str(error) == str(here.value)
        assert error.args == here.value.args and error.hints == here.value.hints
        assert getattr(error, "filename", None) == getattr(here.value, "filename", None)
        if isinstance(error, sevenbot.ArmProblem):
            assert error.joints == (3,) and error.problems[0].kind == "no answer"


def test_a_recording_can_be_indexed(simulated_arm: sevenbot.Arm) -> None:
    recording = sevenbot.Recording.from_points([0, 1, 2], [REST, [100, *REST[1:]], REST], [False, True, False])
    assert recording[1] == (1.0, (100.0, *REST[1:]), True)
    assert recording[-1] == (2.0, REST, False)
    assert len(recording[1:]) == 2 and recording[1:][0] == recording[1]
    assert recording[::2].duration == 2
    assert [moment[0] for moment in recording] == [0, 1, 2]
    with pytest.raises(IndexError):
        recording[3]
    with pytest.raises(sevenbot.BadRecording):
        recording[3:]
    with pytest.raises(ValueError, match="forward"):
        recording[::-1]
    with pytest.raises(TypeError):
        recording["x"]  # type: ignore[call-overload]


def test_a_recording_has_the_times_of_measurement_and_of_arrival(simulated_arm: sevenbot.SimulatedArm) -> None:
    simulated_arm.simulation.later(0.5, "fault line=delay=5")
    recording = simulated_arm.record(1, hz=50)
    assert recording.arrivals is not None
    assert len(recording.arrivals) == len(recording.times) == len(recording)
    late = [there - then for there, then in zip(recording.arrivals, recording.times)]
    assert max(abs(time) for time in late) < 0.02 and any(time != 0 for time in late), "not made of the times"
    part = recording[5:10].arrivals
    assert part is not None and list(part) == list(recording.arrivals[5:10])
    assert sevenbot.Recording.from_points([0], [REST]).arrivals is None


def test_the_progress_bar_can_be_switched_off(simulated_arm: sevenbot.Arm) -> None:
    assert simulated_arm.progress
    simulated_arm.progress = False
    assert not simulated_arm.progress


@pytest.fixture
def recording_arm(simulated_arm: sevenbot.SimulatedArm) -> Iterator[sevenbot.SimulatedArm]:
    """An arm that another thread records without end."""

    def record() -> None:
        with pytest.raises(sevenbot.Interrupted):
            simulated_arm.record()

    start = simulated_arm.simulation.now
    thread = threading.Thread(target=record, daemon=True)
    thread.start()
    while simulated_arm.simulation.now == start:
        time.sleep(0.001)
    yield simulated_arm
    thread.join(ENOUGH)
    assert not thread.is_alive()


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize(
    "call",
    [
        lambda arm: arm.angles,
        lambda arm: arm.set("speed.1", 10),
        lambda arm: arm.sleep(1),
        lambda arm: arm.stream().__enter__(),
    ],
)
def test_ctrl_c_ends_a_call_that_waits_for_another_thread(
    recording_arm: sevenbot.SimulatedArm, call: Callable[[sevenbot.Arm], object]
) -> None:
    timer = threading.Timer(0.2, _thread.interrupt_main)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        call(recording_arm)
    timer.join()
    recording_arm.stop()
    assert recording_arm.get("speed.1") != 10 and recording_arm.get("set-point-period") == 0, "it does not run later"


@pytest.mark.parametrize("close", [sevenbot.Arm.close, sevenbot.Arm.__exit__])
def test_close_ends_the_call_of_another_thread(
    recording_arm: sevenbot.SimulatedArm, close: Callable[[sevenbot.Arm], object]
) -> None:
    close(recording_arm)
    assert not recording_arm.is_connected


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_and_stop_end_a_sample_between_its_reads() -> None:
    with sevenbot.Arm("sim") as arm:
        timer = threading.Timer(0.2, _thread.interrupt_main)
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            arm.sample(2, period=86_400)
        timer.join()
        done = threading.Event()

        def stop() -> None:
            while not done.is_set():
                arm.stop()

        thread = threading.Thread(target=stop)
        thread.start()
        with pytest.raises(sevenbot.Interrupted):
            arm.sample(2, period=86_400)
        done.set()
        thread.join()
