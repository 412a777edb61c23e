"""What the tests share: nodes and simulators as processes, and a client. `cargo xtask ros` runs the tests with loopback only."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import rclpy
from client import Client
from rclpy.signals import SignalHandlerOptions

# The longest wait for a condition in seconds, on a busy machine.
TIMEOUT = 60.0


class Program:
    """A process that a test starts, and that does not outlive it."""

    def __init__(self, words: list[str], log: Path, environment: dict[str, str]) -> None:
        self._log = log
        with log.open("w") as errors:
            self.process = subprocess.Popen(
                words, stdout=subprocess.PIPE, stderr=errors, text=True, start_new_session=True, env=environment
            )

    def line(self) -> str:
        """The next line of its output."""
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line, self.text()
        return line

    def text(self) -> str:
        """What it wrote to its standard error."""
        return self._log.read_text()

    def memory(self) -> int:
        """Its memory in kB."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS")))

    def end(self, how: signal.Signals = signal.SIGKILL) -> int:
        """Ends the process and its children, waits, and returns its exit status."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, how)
        return self.process.wait(TIMEOUT)


class Start:
    """Starts programs for one test."""

    def __init__(self, folder: Path, stack: ExitStack, domain: int) -> None:
        self._folder, self._stack, self._count = folder, stack, 0
        # The node with the stand-in of an action is a module of the tests.
        paths = [str(Path(__file__).parent), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
        path = os.pathsep.join(filter(None, paths))
        self._environment = os.environ | {"ROS_DOMAIN_ID": str(domain), "PYTHONPATH": path}

    def program(self, words: list[str]) -> Program:
        """Any program, in the domain of the test."""
        self._count += 1
        program = Program(words, self._folder / f"{self._count}.log", self._environment)
        self._stack.callback(program.end)
        return program

    def node(self, port: str = "sim", *, namespace: str = "", module: str = "sevenbot_ros", **parameters: object) -> Program:
        """A node of the arm."""
        words = [sys.executable, "-m", module, "--ros-args", "-p", f"port:={port}"]
        if namespace:
            words += ["-r", f"__ns:=/{namespace}"]
        for name, value in parameters.items():
            words += ["-p", f"{name.replace('__', '.')}:={value}"]
        return self.program(words)

    def simulator(self, *options: str, link: Path | None = None) -> Program:
        """`host-sim` behind a link, ready."""
        where = ["--link", str(link or self._folder / "arm")]
        words = [os.environ["HOST_SIM"], "--eeprom", "none", "--control", "none", *where, *options]
        simulator = self.program(words)
        assert simulator.line().startswith("ready ")
        return simulator

    def emulator(self) -> Program:
        """The image for the arm in an emulator behind the link, ready."""
        emulator = self.program([os.environ["XTASK"], "emulate", "--no-build", "--link", self.link])
        # The emulator has child processes, which it ends when it is terminated.
        self._stack.callback(lambda: emulator.end(signal.SIGTERM))
        emulator.line()
        return emulator

    def arm(self, kind: str) -> Program:
        """A controller behind the link: "simulator", or the "image" in an emulator, which runs in real time."""
        return self.emulator() if kind == "image" else self.simulator()

    @property
    def link(self) -> str:
        """The port of the simulator or of the emulator."""
        return str(self._folder / "arm")


# Tests run in several processes: pytest-xdist numbers them.
_DOMAINS = itertools.count(1 + 50 * int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")))


@pytest.fixture
def domain() -> int:
    """A domain of its own for each test, in which no node of another test is left."""
    return next(_DOMAINS)


@pytest.fixture
def start(tmp_path: Path, domain: int) -> Iterator[Start]:
    with ExitStack() as stack:
        yield Start(tmp_path, stack, domain)
        for log in sorted(tmp_path.glob("*.log")):
            print(f"--- {log.name}\n{log.read_text()[-4000:]}")


@pytest.fixture
def client(domain: int) -> Iterator[Callable[..., Client]]:
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    with ExitStack() as stack:
        stack.callback(context.try_shutdown)

        def make(namespace: str = "", **options: Any) -> Client:
            made = Client(context, namespace, TIMEOUT, **options)
            stack.callback(made.close)
            return made

        yield make


@pytest.fixture
def report(record_property: Callable[[str, object], None]) -> Callable[[str], None]:
    """Measured values, for the end of the run."""
    return lambda text: record_property("figure", text)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    for outcome in ("passed", "failed"):
        for test in terminalreporter.getreports(outcome):
            for _, text in test.user_properties:
                terminalreporter.write_line(f"{text}")
