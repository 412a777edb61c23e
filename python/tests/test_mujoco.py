"""The controller in MuJoCo: both worlds agree in free motion, and contacts of MuJoCo reach the firmware.

MuJoCo has no wheel for every Python; `cargo xtask test` installs it where there is one.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy
import pytest
from numpy.typing import NDArray

import sevenbot

pytest.importorskip("mujoco")

EXAMPLE = Path(__file__).parents[1] / "examples" / "mujoco_arm.py"


@pytest.fixture(scope="module")
def example() -> ModuleType:
    """The example as a module."""
    spec = importlib.util.spec_from_file_location("mujoco_arm", EXAMPLE)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def path(rest: NDArray[Any], time: float) -> NDArray[numpy.float64]:
    """A movement of joints 1 to 6 in four rhythms, at up to 60 degrees per second."""
    way = numpy.array([40, 15, 15, 30, 30, 40, 0])
    rhythm = numpy.array([1, 2, 2.5, 1.5, 2, 1, 0])
    angles: NDArray[numpy.float64] = rest + way * numpy.sin(rhythm * time)
    return angles


def test_both_worlds_agree_in_free_motion_within_a_degree(example: ModuleType) -> None:
    outside, inside = example.MujocoArm(sevenbot.model("mjcf")), sevenbot.SimulatedArms(1)
    worst = numpy.zeros(6)
    moved = []
    for step in range(400):
        action = path(example.REST, step * example.PERIOD)
        there, here = outside.step(action), inside.step(action[None], example.PERIOD)[0]
        worst = numpy.maximum(worst, numpy.abs(there - here)[:6])
        moved.append(there[:7])
    print("largest differences in degrees:", worst.round(2))
    assert worst.max() < 1
    assert (numpy.ptp(moved, axis=0)[:6] > 25).all(), "all joints moved"
    # Joint 7 is not in the model.
    assert moved[-1][6] == pytest.approx(80, abs=1)


def test_what_the_arm_meets_in_mujoco_blocks_its_joint_in_the_firmware(example: ModuleType) -> None:
    post = example.POST.strip()
    arm = example.MujocoArm(sevenbot.model("mjcf").replace("</worldbody>", post))
    target = example.REST.copy()
    for step in range(250):
        target[0] = min(90 + step * 0.4, 130)
        seen = arm.step(target)
    assert arm.data.ncon > 0
    assert seen[arm.arms.BLOCKED].tolist() == [1, 0, 0, 0, 0, 0, 0]
    assert seen[0] < 120
    # The firmware limits the push of a joint that is blocked.
    assert abs(seen[arm.arms.LOADS][0]) < 70


def test_a_servo_without_torque_lets_the_arm_fall_in_mujoco(example: ModuleType) -> None:
    arm = example.MujocoArm(sevenbot.model("mjcf"))
    arm.step(example.REST)
    arm.arms.fault(None, "supply=off")
    for _ in range(100):
        arm.arms.exchange(arm.measured(), 0.002)
    wanted = arm.arms.exchange(arm.measured(), 0.002)[0]
    assert wanted[arm.arms.DRIVES][:6].tolist() == [0] * 6
    for _ in range(100):
        arm.step(example.REST)
    assert arm.measured()[0, 2] > 75, "the forearm has fallen"


def test_the_models_are_texts() -> None:
    assert "<robot" in sevenbot.model("urdf") and "<mujoco" in sevenbot.model("mjcf")
    with pytest.raises(ValueError, match="mjcf"):
        sevenbot.model("gltf")  # type: ignore[arg-type]
