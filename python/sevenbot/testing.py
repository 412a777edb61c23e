"""A pytest plugin: the fixture `simulated_arm`, an arm in virtual time.

    def test_it_waves(simulated_arm: sevenbot.SimulatedArm) -> None:
        simulated_arm.simulation.fault("3=missing")
        ...

The plugin is active wherever this package and pytest are installed.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from sevenbot import Arm, SimulatedArm

__all__ = ["simulated_arm"]


@pytest.fixture
def simulated_arm() -> Iterator[SimulatedArm]:
    """An arm in virtual time, at rest in its standard pose. Each test gets a new one."""
    arm = Arm.simulated()
    arm.sleep(1.0)
    yield arm
    arm.close()
