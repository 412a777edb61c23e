"""Arms by their address, number and chip: behind a running `sevenbot serve`, in front of a running simulator.

`cargo xtask test` builds both programs, and names their folder in SEVENBOT_PROGRAMS.
"""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

import sevenbot

PROGRAMS = os.environ.get("SEVENBOT_PROGRAMS")
pytestmark = pytest.mark.skipif(PROGRAMS is None, reason="SEVENBOT_PROGRAMS names no folder with host-sim and sevenbot")
TOKEN = "correct-horse"
#: The timeout of waits in seconds. It is long, because the machine may be busy.
ENOUGH = 120.0


@dataclass
class Server:
    """A server of the user whose runtime directory is `folder`."""

    address: str
    folder: Path


def start(*words: str) -> subprocess.Popen[str]:
    return subprocess.Popen([f"{PROGRAMS}/{words[0]}", *words[1:]], stdout=subprocess.PIPE, text=True)


def ready(process: subprocess.Popen[str], word: str) -> str:
    """The rest of the first line `ready ...` of a program that contains `word`."""
    assert process.stdout is not None
    for line in process.stdout:
        kind, _, what = line.strip().partition(" ")
        if kind == "ready" and word in what:
            return what
    raise AssertionError(f"no {word}")


@pytest.fixture
def server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    """A simulated arm with the number 42, behind a server that wants a token over TCP."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    link = tmp_path / "arm"
    simulator = start("host-sim", "--quiet", "--control", "none", "--eeprom", "none", "--link", str(link))
    ready(simulator, "/")
    with sevenbot.Arm(link) as arm:
        arm.set("device-id", 42, unlock=True)
    words = ["--port", str(link), "serve", "--tcp", "0", "--token", TOKEN]
    served = start("sevenbot", *words)
    try:
        yield Server(ready(served, "socket://").replace("socket://", "tcp://"), tmp_path)
    finally:
        for process in [served, simulator]:
            process.send_signal(signal.SIGTERM)
            process.wait(timeout=ENOUGH)


def test_a_server_wants_its_token(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    with sevenbot.Arm(server.address, token=TOKEN) as arm:
        assert arm.get("device-id") == 42 and arm.port == server.address
    with pytest.raises(sevenbot.PortError):
        sevenbot.Arm(server.address, token="wrong-horse", timeout=0.2, attempts=1)
    # The argument has precedence over the environment variable.
    monkeypatch.setenv("SEVENBOT_TOKEN", "wrong-horse")
    with sevenbot.Arm(server.address, token=TOKEN) as arm:
        assert arm.is_connected
    monkeypatch.setenv("SEVENBOT_TOKEN", TOKEN)
    with sevenbot.Arm(server.address) as arm:
        assert arm.is_connected


def test_an_arm_is_found_by_its_number_and_its_chip(server: Server) -> None:
    with sevenbot.Arm(server.address, token=TOKEN) as arm:
        chip = arm.chip_id
    for found in [sevenbot.Arm(id=42), sevenbot.Arm(chip=chip.lower()), sevenbot.Arm(id=42, chip=chip)]:
        with found as arm:
            assert arm.get("device-id") == 42 and arm.chip_id == chip
    with pytest.raises(sevenbot.PortError, match="id 43"):
        sevenbot.Arm(id=43)
    listed = [arm for arm in sevenbot.ports() if arm[2] == 42]
    assert len(listed) == 1
    port, description, _, firmware, listed_chip = listed[0]
    assert port.startswith("unix:") and description.startswith("for /dev/")
    assert (firmware, listed_chip) == ("3.0", chip)
    printed = subprocess.run([f"{PROGRAMS}/sevenbot", "ports"], capture_output=True, text=True, timeout=ENOUGH).stdout
    assert f"id 42, firmware 3.0, chip {chip}" in printed


def test_a_token_goes_with_an_address() -> None:
    with pytest.raises(TypeError, match="tcp://"):
        sevenbot.Arm("/dev/ttyUSB0", token=TOKEN)
    with pytest.raises(TypeError, match="tcp://"):
        sevenbot.Arm("unix:/none", token=TOKEN)
    for wrong in ["short", "with a space in it", "a line\nfeed"]:
        with pytest.raises(ValueError, match="8 to 128"):
            sevenbot.Arm("tcp://127.0.0.1:1", token=wrong)
