"""What a control loop needs: one read with its time, torque, kinematics, and whether the arm is there."""

from __future__ import annotations

import pickle
import time

import pytest

import sevenbot

REST = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0]


def test_an_observation_has_all_of_one_read(simulated_arm: sevenbot.SimulatedArm) -> None:
    simulated_arm.pose([150, *REST[1:]], speed=38, wait=False)
    simulated_arm.sleep(0.8)
    before = time.monotonic()
    observed = simulated_arm.observe()
    assert before <= observed.monotonic <= time.monotonic()
    assert observed.positions.shape == observed.velocities.shape == observed.loads.shape == (7,)
    assert observed.velocities[0] == pytest.approx(38, abs=8)
    assert observed.positions[0] == pytest.approx(simulated_arm.simulation.angles[0], abs=2)
    assert 0.01 < observed.age < 0.03
    simulated_arm.sleep(1)
    assert simulated_arm.observe().time == pytest.approx(observed.time + 1, abs=0.1)
    assert "Observation" in repr(observed)
    with sevenbot.Arm.simulated(map="2.1") as other:
        with pytest.raises(sevenbot.NotServed):
            other.observe()


def test_an_arm_says_whether_it_is_connected(simulated_arm: sevenbot.SimulatedArm) -> None:
    assert simulated_arm.is_connected
    simulated_arm.simulation.power_off()
    assert not simulated_arm.is_connected
    simulated_arm.simulation.power_cycle()
    assert simulated_arm.is_connected
    simulated_arm.simulation.unplug()
    assert not simulated_arm.is_connected
    simulated_arm.close()
    assert not simulated_arm.is_connected


def test_torque_goes_off_and_on_for_a_leader(simulated_arm: sevenbot.SimulatedArm) -> None:
    for joint in range(1, 8):
        simulated_arm.simulation.hold_by_hand(joint)
    simulated_arm.torque_off()
    simulated_arm.simulation.move_by_hand(1, 120)
    simulated_arm.sleep(0.5)
    assert simulated_arm.observe().positions[0] == pytest.approx(120, abs=1)
    simulated_arm.torque_on()
    assert simulated_arm.get("motor-state") == 1
    assert simulated_arm.get("target-position.1") == pytest.approx(120, abs=1)


def test_kinematics_need_no_arm(simulated_arm: sevenbot.SimulatedArm) -> None:
    tip = sevenbot.forward(simulated_arm.angles)
    assert tip == simulated_arm.where() == sevenbot.Tip.of(*simulated_arm.angles)
    assert pickle.loads(pickle.dumps(tip)) == tip
    angles = sevenbot.inverse(50, 185, 60, tool=[0, 0, -1])
    assert angles.shape == (5,)
    there = sevenbot.forward([*angles, 90, 80])
    assert there.tip == pytest.approx((50, 185, 60), abs=0.1)
    assert there.tool == pytest.approx((0, 0, -1), abs=0.001)
    with pytest.raises(sevenbot.OutOfReach, match="nearest"):
        sevenbot.inverse(0, 900, 0)
    low, high = sevenbot.limits()
    assert list(low) == [0] * 7 and list(high) == [180] * 6 + [84]
    with pytest.raises(TypeError, match="None is not allowed"):
        sevenbot.forward([None, *REST[1:]])  # type: ignore[list-item]


def test_an_arm_is_wanted_by_its_number_or_its_chip() -> None:
    with pytest.raises(sevenbot.PortError, match="id 77"):
        sevenbot.Arm(id=77)
    with pytest.raises(sevenbot.PortError, match="chip 0000"):
        sevenbot.Arm(chip="0000")
    with pytest.raises(TypeError, match="not both"):
        sevenbot.Arm("x", id=5)
    with pytest.raises(ValueError, match="0 to 255"):
        sevenbot.Arm(id=256)

