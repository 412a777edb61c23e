"""The page's programs of blocks, as the page writes them in Python: the arm ends where it does in the page.

The tests of the page compare the same files with what the page writes, and the angles with where its arm ends.
"""

from __future__ import annotations

import contextlib
import functools
import os
import runpy
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

import sevenbot

EXAMPLES = Path(__file__).parents[2] / "web/block-programs/examples"
PROGRAMS = os.environ.get("SEVENBOT_PROGRAMS")
#: The largest difference between an angle here and in the page, in degrees.
TOLERANCE = 0.5
#: The timeout of waits in seconds. It is long, because the machine may be busy.
ENOUGH = 120.0
#: The reply timeout in seconds. On a busy machine an answer of the emulator may take longer than the default timeout.
ANSWER_TIME = 20.0
#: The time in seconds in which an arm at its targets comes to rest, on a busy machine.
TIME_TO_REST = 10.0
#: Parts of the errors on a machine that is too busy for an emulator: the arm stopped on its way, or a servo answered late.
BUSY = ("this program paused", "does not answer", "no servo answers")


def end_of(program: Path) -> list[float]:
    """Where the arm of the page ends."""
    return [float(word) for word in program.with_suffix(".end.txt").read_text().split()]


def run_here(
    program: Path, arm: Callable[..., object], monkeypatch: pytest.MonkeyPatch, arguments: Sequence[str] = ()
) -> None:
    """Runs a program in this process. `arm` stands for `sevenbot.Arm`."""
    monkeypatch.setattr(sevenbot, "Arm", arm)
    monkeypatch.setattr(sys, "argv", [str(program), *arguments])
    runpy.run_path(str(program))


each_program = pytest.mark.parametrize("program", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.stem)


@each_program
def test_a_program_ends_where_it_does_in_the_page(
    program: Path, simulated_arm: sevenbot.SimulatedArm, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_here(program, lambda: contextlib.nullcontext(simulated_arm), monkeypatch)
    simulated_arm.sleep(0.5)
    assert list(simulated_arm.simulation.angles) == pytest.approx(end_of(program), abs=TOLERANCE)


def test_there_are_examples() -> None:
    assert len(list(EXAMPLES.glob("*.py"))) >= 6


@contextlib.contextmanager
def started(words: list[str], link: Path) -> Iterator[Path]:
    """Starts one of the project's programs, which makes an arm at this link, and ends it again."""
    process = subprocess.Popen([*words, "--link", str(link)], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert any(line.startswith("ready") for line in process.stdout)
        yield link
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(timeout=ENOUGH)


def assert_at_end(program: Path, link: Path) -> None:
    """Checks where the arm comes to rest. On a busy machine the controller makes up for the load of a joint later."""
    expected = pytest.approx(end_of(program), abs=TOLERANCE)
    with sevenbot.Arm(link, timeout=ANSWER_TIME) as arm:
        end = time.monotonic() + TIME_TO_REST
        while list(arm.angles) != expected and time.monotonic() < end:
            time.sleep(0.1)
        assert list(arm.angles) == expected


needs_programs = pytest.mark.skipif(PROGRAMS is None, reason="SEVENBOT_PROGRAMS names no folder with programs")


@needs_programs
def test_a_program_runs_unchanged_with_the_name_of_a_port(tmp_path: Path) -> None:
    words = [f"{PROGRAMS}/host-sim", "--quiet", "--control", "none", "--eeprom", "none"]
    program = EXAMPLES / "functions.py"
    with started(words, tmp_path / "arm") as link:
        subprocess.run([sys.executable, program, link], check=True, timeout=ENOUGH)
        assert_at_end(program, link)


@needs_programs
@each_program
def test_a_program_ends_on_the_image_for_the_arm_where_it_does_in_the_page(
    program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    patient_arm = functools.partial(sevenbot.Arm, timeout=ANSWER_TIME)
    with started([f"{PROGRAMS}/xtask", "emulate", "--no-build"], tmp_path / "arm") as link:
        end = time.monotonic() + ENOUGH
        while True:
            try:
                run_here(program, patient_arm, monkeypatch, [str(link)])
                break
            except sevenbot.NotReached as failure:
                # Then run the program again from its beginning.
                if time.monotonic() >= end or not any(text in str(failure) for text in BUSY):
                    raise
                time.sleep(1.0)
        assert_at_end(program, link)
