"""A program in a terminal: Ctrl-C, and progress bars."""

from __future__ import annotations

import os
import pty
import re
import select
import signal
import subprocess
import sys
import time

# The background jobs of some shells ignore SIGINT, and Python then keeps it ignored.
PROGRAM = """
import signal, threading
signal.signal(signal.SIGINT, signal.default_int_handler)
import sevenbot

def tell():
    # Virtual time passes only during a call.
    while arm.simulation.now < 10:
        pass
    print("in the call", flush=True)

arm = sevenbot.Arm.simulated()
arm.sleep(1)
arm.simulation.fault("1=stuck")
arm.pose(180, 90, 65, 90, 90, 90, 80, wait=False)
threading.Thread(target=tell).start()
try:
    {call}
except KeyboardInterrupt:
    print("interrupted", arm.get("target-position.1"))
"""
# The timeout of waits in seconds.
ENOUGH = 60.0


class Terminal:
    """A pseudo-terminal with a Python program. The end of the context kills the program."""

    def __init__(self, program: str) -> None:
        self.shown = ""
        self.pid, self._master = pty.fork()
        if self.pid == 0:
            environment = {**os.environ, "TERM": "xterm-256color"}
            os.execve(sys.executable, [sys.executable, "-c", program], environment)

    def __enter__(self) -> Terminal:
        return self

    def __exit__(self, *_exception: object) -> None:
        # Without the terminal the program gets SIGHUP, which it may ignore.
        os.close(self._master)
        os.kill(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)

    def wait_for(self, pattern: str) -> re.Match[str]:
        """Reads until the program has shown something that matches."""
        end = time.monotonic() + ENOUGH
        while not (found := re.search(pattern, self.shown)):
            ready, _, _ = select.select([self._master], [], [], max(end - time.monotonic(), 0))
            assert ready, f"no {pattern!r} in {self.shown!r}"
            try:
                self.shown += os.read(self._master, 4096).decode(errors="replace")
            except OSError as error:
                raise AssertionError(f"no {pattern!r} in {self.shown!r}") from error
        return found

    def key(self, key: bytes) -> None:
        """Types a key."""
        os.write(self._master, key)


def test_ctrl_c_ends_a_call_and_the_arm_holds() -> None:
    with Terminal(PROGRAM.format(call="arm.sleep(86_400)")) as terminal:
        terminal.wait_for("in the call")
        terminal.key(b"\x03")
        target = terminal.wait_for(r"interrupted (\d+)\s")
        # The stuck joint stands near 90 degrees, and its target was 180.
        assert abs(int(target[1]) - 90) <= 2


def test_a_long_call_shows_its_progress_on_a_terminal_and_clears_it() -> None:
    with Terminal(PROGRAM.format(call="arm.sample(10_000_000)")) as terminal:
        terminal.wait_for("/10000000")
        assert "interrupted" not in terminal.shown
        terminal.key(b"\x03")
        terminal.wait_for("interrupted")
        # "Erase the line" comes after the last drawing.
        assert "\x1b[2K" in terminal.shown.split("/10000000")[-1]


def test_without_a_terminal_there_is_no_progress() -> None:
    program = "import sevenbot; arm = sevenbot.Arm.simulated(); arm.sample(40_000)"
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, timeout=10 * ENOUGH)
    assert (result.returncode, result.stdout, result.stderr) == (0, b"", b"")
