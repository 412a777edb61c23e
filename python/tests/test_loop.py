"""A control loop of 50 Hz on a line that damages bytes, in virtual time.

`python test_loop.py` prints the table of docs/python.md.
"""

from __future__ import annotations

import math

import numpy
import pytest

import sevenbot

REST = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0]
TURNS = 1000


def turns_on_time(damaged_percent: float, seed: int) -> int:
    """The number of turns of 20 ms, out of 1,000, in which one read and one point are done in time."""
    with sevenbot.Arm.simulated(seed) as arm:
        arm.sleep(1)
        made, last = 0, -1
        with arm.stream(0.02) as stream:
            if damaged_percent:
                arm.simulation.fault(f"line=corruption={damaged_percent}%")
            while last < TURNS - 1:
                observed = arm.observe()
                assert not numpy.isnan(observed.positions).any()
                # After a late turn, the number of the point grows by more than one.
                last = stream.send([90 + math.sin(last / 50), *REST[1:]])
                made += 1
            arm.simulation.clear()
    return made


@pytest.mark.parametrize(("damaged_percent", "share"), [(0, 1.0), (0.05, 0.995), (0.5, 0.97)])
def test_damaged_bytes_cost_a_loop_few_turns(damaged_percent: float, share: float) -> None:
    made = [turns_on_time(damaged_percent, seed) for seed in (1, 2, 3)]
    assert min(made) >= share * TURNS, made


if __name__ == "__main__":
    for percent in [0, 0.05, 0.5]:
        print(percent, sorted(turns_on_time(percent, seed) for seed in range(1, 10)))
