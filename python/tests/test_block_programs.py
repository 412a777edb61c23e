"""The page's programs of blocks, as the page writes them in Python: the arm ends where it does in the page.

The tests of the page compare the same files with what the page writes, and the angles with where its arm ends.
"""

from __future__ import annotations

import contextlib
import os
import runpy
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import sevenbot

EXAMPLES = Path(__file__).parents[2] / "web/block-programs/examples"
PROGRAMS = os.environ.get("SEVENBOT_PROGRAMS")
#: Degrees.
TOLERANCE = 0.5
#: Seconds. No test fails because a machine is slow.
ENOUGH = 120.0


def end_of(program: Path) -> list[float]:
    """Where the arm of the page ends."""
    return [float(word) for word in program.with_suffix(".end.txt").read_text().split()]


@pytest.mark.parametrize("program", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.stem)
def test_a_program_ends_where_it_does_in_the_page(
    program: Path, simulated_arm: sevenbot.SimulatedArm, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sevenbot, "Arm", lambda: contextlib.nullcontext(simulated_arm))
    monkeypatch.setattr(sys, "argv", [str(program)])
    runpy.run_path(str(program))
    simulated_arm.sleep(0.5)
    assert list(simulated_arm.simulation.angles) == pytest.approx(end_of(program), abs=TOLERANCE)


def test_there_are_examples() -> None:
    assert len(list(EXAMPLES.glob("*.py"))) >= 6


@pytest.mark.skipif(PROGRAMS is None, reason="SEVENBOT_PROGRAMS names no folder with host-sim")
def test_a_program_runs_unchanged_with_the_name_of_a_port(tmp_path: Path) -> None:
    link = tmp_path / "arm"
    words = [f"{PROGRAMS}/host-sim", "--quiet", "--control", "none", "--eeprom", "none", "--link", str(link)]
    simulator = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    try:
        assert simulator.stdout is not None
        assert any(line.startswith("ready") for line in simulator.stdout)
        program = EXAMPLES / "functions.py"
        subprocess.run([sys.executable, program, link], check=True, timeout=ENOUGH)
        with sevenbot.Arm(link) as arm:
            assert list(arm.angles) == pytest.approx(end_of(program), abs=TOLERANCE)
    finally:
        simulator.send_signal(signal.SIGTERM)
        simulator.wait(timeout=ENOUGH)
