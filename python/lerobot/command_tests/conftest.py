"""LeRobot's own commands in processes of their own, on simulated arms and on the emulated image."""

import csv
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import sevenbot
from numpy.typing import NDArray

Rows = NDArray[np.float64]
"""Angles of joints 1 to 7 in degrees, a row for each moment."""

TIMEOUT = 300
"""The longest time of a command in seconds. The machine may be busy."""
START_UP = 120
"""The longest time until the emulated arm answers, in seconds."""


@dataclass(frozen=True)
class Log:
    """What `--robot.log` wrote: what was sent, what was measured before, and the true angles of a simulated arm."""

    times: NDArray[np.float64]
    sent: Rows
    measured: Rows
    true: Rows

    @classmethod
    def read(cls, path: Path) -> "Log":
        """Reads the file. Missing angles are NaN."""
        with path.open() as file:
            lines = list(csv.reader(file))[1:]
        table = np.array([[float(cell or "nan") for cell in line] for line in lines])
        return cls(table[:, 0], table[:, 1:8], table[:, 8:15], table[:, 15:22])

    def loop_times(self) -> str:
        """The durations of the turns of the loop, as text. The first turn is left out: it does not wait after the approach."""
        turns = np.diff(self.times[1:]) * 1000
        late = int((turns > 40).sum())
        return (
            f"{len(turns)} turns of median {np.median(turns):.1f} ms, 99 % below {np.percentile(turns, 99):.1f} ms, "
            f"longest {turns.max():.1f} ms, {late} longer than 40 ms"
        )


@dataclass(frozen=True)
class LeRobot:
    """Runs LeRobot's commands with files in one folder."""

    folder: Path

    def start(self, command: str, *options: str) -> subprocess.Popen[str]:
        """Starts a command."""
        program = Path(sys.executable).with_name(command)
        environment = os.environ | {"HF_HOME": str(self.folder / "home"), "HF_HUB_OFFLINE": "1"}
        return subprocess.Popen(
            [program, *options],
            cwd=self.folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def finish(self, process: subprocess.Popen[str]) -> str:
        """What a command printed. Fails if the command failed."""
        printed, _ = process.communicate(timeout=TIMEOUT)
        assert process.returncode == 0, printed
        return printed

    def run(self, command: str, *options: str) -> str:
        """Starts and finishes a command."""
        return self.finish(self.start(command, *options))


@pytest.fixture
def lerobot(tmp_path: Path) -> LeRobot:
    """LeRobot's commands."""
    return LeRobot(tmp_path)


def led(path: Path, speed: float) -> Path:
    """A movement of the joints in six rhythms: a path that does not repeat itself.

    The hand waits first, as a person does, until the follower has come.
    """
    middle = np.array([90.0, 90.0, 70.0, 90.0, 90.0, 90.0, 42.0])
    way = np.array([40.0, 18.0, 18.0, 30.0, 25.0, 45.0, 35.0])
    rhythm = speed * np.array([1.0, 2.0, 3.0, 1.5, 2.5, 0.5, 2.0])
    times = np.arange(0, 16, 0.05)
    moved = np.maximum(times - 4, 0)[:, None]
    angles = middle + way * np.sin(moved * rhythm * 2 * math.pi / 12)
    sevenbot.Recording.from_points(times, angles).save(path)
    return path


@pytest.fixture
def hand(tmp_path: Path) -> Path:
    """A hand that moves joints at up to 37 degrees a second."""
    return led(tmp_path / "hand.txt", 1.0)


@pytest.fixture
def slow_hand(tmp_path: Path) -> Path:
    """A hand that moves joints at up to 7 degrees a second.

    The emulator runs in real time. A busy computer stops it for 0.1 to 0.3 s, and then the joints catch up at different speeds.
    They leave the path by no more than the distance that they missed, so a slow hand keeps the error small.
    """
    return led(tmp_path / "hand.txt", 1 / 5)


@dataclass(frozen=True)
class EmulatedArm:
    """The image for the arm in an emulator: its port, and a file of the true angles of its simulated servos."""

    port: Path
    angles: Path

    def true_path(self, log: Log, rows: slice, more: float = 0.0) -> tuple[NDArray[np.float64], Rows]:
        """Times by the log's clock, and true angles, from the first to the last of these rows of a log.

        The result begins `more` seconds before the first row, and ends `more` seconds after the last one.
        """
        table = np.loadtxt(self.angles, delimiter=",")
        # The file has the time since 1970.
        times = table[:, 0] - (time.time() - time.monotonic())
        begin, *_, end = log.times[rows]
        inside = (times >= begin - more) & (times <= end + more)
        return times[inside], table[inside, 1:]


@pytest.fixture
def emulated_arm(tmp_path: Path) -> Iterator[EmulatedArm]:
    """`cargo xtask emulate`."""
    arm = EmulatedArm(tmp_path / "arm", tmp_path / "angles.csv")
    options: list[str | Path] = ["--no-build", "--link", arm.port, "--angles", arm.angles]
    emulator = subprocess.Popen([os.environ["XTASK"], "emulate", *options])
    try:
        deadline = time.monotonic() + START_UP
        while not answers(arm.port):
            assert time.monotonic() < deadline and emulator.poll() is None, "the emulated arm does not start"
            time.sleep(0.2)
        yield arm
    finally:
        emulator.send_signal(signal.SIGTERM)
        emulator.wait(timeout=TIMEOUT)


def answers(link: Path) -> bool:
    """Is there an arm behind the link?"""
    if not link.exists():
        return False
    try:
        sevenbot.Arm(link).close()
    except sevenbot.Error:
        return False
    return True
