"""A CSV file for what happened: what was sent and measured at each action, and where a simulated arm really was."""

import time
from collections.abc import Iterable
from pathlib import Path
from typing import SupportsFloat, TextIO

import sevenbot

from .joints import NAMES


class ActionLog:
    """One line for each action: the time, the sent angles, the measured ones before, and the true ones of a simulation.

    All angles are degrees, the claw's too. Without a file it does nothing.
    """

    def __init__(self, path: Path | str | None) -> None:
        """Creates the file, or replaces it."""
        self._file: TextIO | None = None if path is None else Path(path).open("w", encoding="utf-8")
        self._observed: list[SupportsFloat] = []
        self._write(["time", *(f"{kind}.{name}" for kind in ("sent", "measured", "true") for name in NAMES)])

    def observed(self, positions: Iterable[SupportsFloat]) -> None:
        """The last measured angles."""
        self._observed = list(positions)

    def sent(self, angles: Iterable[SupportsFloat], simulation: sevenbot.Simulation | None) -> None:
        """Writes the line of an action: the sent angles, the last observed ones, and the true ones of a simulation."""
        if self._file is None:
            return
        nothing = [""] * len(NAMES)
        true = nothing if simulation is None else [f"{angle:.3f}" for angle in simulation.angles]
        measured = [f"{float(angle):.2f}" for angle in self._observed] or nothing
        sent = [f"{float(angle):.2f}" for angle in angles]
        self._write([f"{time.monotonic():.4f}", *sent, *measured, *true])

    def _write(self, cells: list[str]) -> None:
        if self._file is not None:
            self._file.write(",".join(cells) + "\n")

    def close(self) -> None:
        """Closes the file."""
        if self._file is not None:
            self._file.close()
            self._file = None
