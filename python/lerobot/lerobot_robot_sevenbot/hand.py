"""The hand that leads a simulated leader: along a recording, or in a wave."""

import math
import time
from collections.abc import Sequence
from pathlib import Path

import sevenbot

from .joints import Angles, within_limits

WAVE_PERIOD = 6.0
"""The time of a wave in seconds."""
WAVE = (25.0, 10.0, 10.0, 20.0, 20.0, 30.0, 30.0)
"""How far the wave leads each joint from where it was, in degrees."""


def between(times: Sequence[float], rows: Sequence[Sequence[float]], moment: float) -> Angles:
    """The angles at a moment, on straight lines between the rows; the first row before them, and the last one after."""
    later = next((index for index, time_of in enumerate(times) if time_of >= moment), len(times) - 1)
    earlier = max(later - 1, 0)
    span = times[later] - times[earlier]
    share = min(max((moment - times[earlier]) / span, 0.0), 1.0) if span > 0 else 1.0
    return [low + share * (high - low) for low, high in zip(rows[earlier], rows[later], strict=True)]


class Hand:
    """Moves all joints of a simulated arm without torque, by the wall clock. The movement begins with the first call."""

    def __init__(self, simulation: sevenbot.Simulation, recording: Path | None) -> None:
        """Takes hold of the arm where it is."""
        self._simulation = simulation
        self._start: float | None = None
        self._middle = list(simulation.angles)
        self._times: list[float] = []
        self._rows: list[list[float]] = []
        if recording is not None:
            loaded = sevenbot.Recording.load(recording)
            self._times = [float(moment) for moment in loaded.times]
            self._rows = [[float(angle) for angle in row] for row in loaded.angles]
        for joint in range(1, 8):
            simulation.hold_by_hand(joint)

    def lead(self) -> None:
        """Moves the joints to the angles of the hand at this time."""
        now = time.monotonic()
        self._start = self._start or now
        for joint, angle in enumerate(self.angles(now - self._start), start=1):
            self._simulation.move_by_hand(joint, round(angle, 2))

    def angles(self, moment: float) -> Angles:
        """Where the hand is at a moment after the start, in seconds."""
        if self._rows:
            return between(self._times, self._rows, moment)
        phase = math.sin(2 * math.pi * moment / WAVE_PERIOD)
        return within_limits(middle + phase * way for middle, way in zip(self._middle, WAVE, strict=True))
