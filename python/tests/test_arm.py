"""Behaviour of `sevenbot.Arm`, on an arm in virtual time."""

from __future__ import annotations

import _thread
import threading
import warnings

import pytest

import sevenbot

REST = (90, 90, 65, 90, 90, 90, 80)


def simulation(arm: sevenbot.Arm) -> sevenbot.Simulation:
    assert arm.simulation is not None
    return arm.simulation


def test_a_pose_is_reached_in_hundredths_of_a_degree(simulated_arm: sevenbot.Arm) -> None:
    reached = simulated_arm.pose(120.25, 90, 65, 90, 90, 90, 80)
    assert reached is not None
    assert reached[0] == pytest.approx(120.25, abs=2)
    assert simulated_arm.get("fine-target.1") == 12025
    assert simulation(simulated_arm).angles[0] == pytest.approx(120.25, abs=2)


def test_none_leaves_a_joint_and_speed_is_in_degrees_per_second(simulated_arm: sevenbot.Arm) -> None:
    before = simulated_arm.get("speed.1")
    simulated_arm.pose([None] * 6 + [60], speed=19)
    assert simulated_arm.get("speed.7") == 10
    assert simulated_arm.get("speed.1") == before
    assert simulated_arm.angles == pytest.approx([90, 90, 65, 90, 90, 90, 60], abs=1.5)


def test_a_move_takes_virtual_time_only(simulated_arm: sevenbot.Arm) -> None:
    start = simulation(simulated_arm).now
    simulated_arm.pose([150, *REST[1:]], duration=6)
    assert 6 <= simulation(simulated_arm).now - start < 8


def test_a_move_without_waiting_goes_on_until_it_is_stopped(simulated_arm: sevenbot.Arm) -> None:
    assert simulated_arm.pose([180, *REST[1:]], speed=10, wait=False) is None
    simulated_arm.sleep(1)
    status = simulated_arm.status()
    assert status is not None and status.moving == [1]
    held = simulated_arm.stop()
    assert 95 <= held[0] <= 110
    simulated_arm.sleep(1)
    assert simulated_arm.angles[0] == pytest.approx(held[0], abs=1.5)
    assert simulated_arm.wait() is None, "the move is over"


def test_wait_waits_for_the_last_move(simulated_arm: sevenbot.Arm) -> None:
    simulated_arm.pose([100, *REST[1:]], speed=10, wait=False)
    reached = simulated_arm.wait()
    assert reached is not None and reached[0] == pytest.approx(100, abs=1.5)


def test_the_end_of_a_with_block_stops_what_moves() -> None:
    with sevenbot.Arm.simulated() as arm:
        arm.sleep(1)
        arm.pose([180, *REST[1:]], speed=10, wait=False)
        arm.sleep(1)
        world = simulation(arm)
    there = world.angles[0]
    assert there < 115
    world.advance(5)
    assert world.angles[0] == pytest.approx(there, abs=1.5)
    with pytest.raises(sevenbot.Closed):
        arm.get("speed")
    assert "closed" in repr(arm)


def test_registers_have_the_numbers_of_the_table(simulated_arm: sevenbot.Arm) -> None:
    registers = simulated_arm.registers
    registers["speed.1"] = 30
    assert registers["speed.1"] == 30
    registers["SPEED"] = [1, 2, 3, 4, 5, 6, 7]
    assert registers["speed"] == [1, 2, 3, 4, 5, 6, 7]
    assert registers["chip-id"] == simulated_arm.chip_id
    assert "offset" in registers and "nonsense" not in registers
    assert "target-position" in list(registers)
    assert len(registers) == len(list(registers)) > 40
    assert "0 to 180" in registers.describe("target-position")


def test_settings_are_locked_and_the_hint_says_how_to_open_them(simulated_arm: sevenbot.Arm) -> None:
    with pytest.raises(sevenbot.NotTaken, match="EEPROM lock") as raised:
        simulated_arm.set("offset.2", -5)
    assert "unlock=True" in raised.value.hints[0]
    simulated_arm.set("offset.2", -5, unlock=True)
    assert simulated_arm.get("offset") == [0, -5, 0, 0, 0, 0, 0]
    assert simulated_arm.get("eeprom-lock") == 1


def test_wrong_arguments_raise_and_change_nothing(simulated_arm: sevenbot.Arm) -> None:
    with pytest.raises(KeyError, match="no register"):
        simulated_arm.get("nonsense")
    with pytest.raises(ValueError, match="0 to 100"):
        simulated_arm.set("speed.1", 101)
    with pytest.raises(ValueError, match="joint 2: 181"):
        simulated_arm.pose([90, 181, 65, 90, 90, 90, 80])
    with pytest.raises(TypeError, match="seven"):
        simulated_arm.pose(90, 90)  # type: ignore[call-overload]
    with pytest.raises(TypeError, match="not both"):
        simulated_arm.pose(REST, speed=10, duration=1)
    with pytest.raises(ValueError, match="1.9 to 190"):
        simulated_arm.pose(REST, speed=400)
    with pytest.raises(ValueError, match="map"):
        sevenbot.Arm.simulated(map="3.0")  # type: ignore[arg-type]
    assert simulated_arm.get("target-position") == list(REST)


def test_the_tip_moves_to_millimetres(simulated_arm: sevenbot.Arm) -> None:
    simulated_arm.move_to(-50, 185, 50)
    where = simulated_arm.where()
    assert where.tip == pytest.approx((-50, 185, 50), abs=6)
    assert where.tool[2] == pytest.approx(-1, abs=0.05)
    assert "mm" in str(where) and "<table>" in where._repr_html_()
    with pytest.raises(sevenbot.OutOfReach, match="nearest point"):
        simulated_arm.move_to(0, 900, 0)


def test_the_guard_keeps_the_arm_above_the_table_and_out_of_its_base(simulated_arm: sevenbot.Arm) -> None:
    before = simulated_arm.get("fine-target")
    with pytest.raises(sevenbot.OutsideGuard, match="40.0 mm below the table at z = -60 mm") as refused:
        simulated_arm.move_to(0, 185, -100)
    assert any("guard=False" in hint for hint in refused.value.hints)
    with pytest.raises(sevenbot.OutsideGuard, match="space of the base"):
        simulated_arm.move_to(0, 100, -40)
    with pytest.raises(sevenbot.OutsideGuard, match="below the table at z = 100 mm"):
        simulated_arm.move_to(0, 250, 50, straight=True, table=100)
    with pytest.raises(TypeError):
        simulated_arm.move_to(0, 185, 50, table=0, guard=False)
    assert simulated_arm.get("fine-target") == before
    simulated_arm.move_to(0, 185, -70, table=-80)


def test_joints_below_the_table_are_warned_of(simulated_arm: sevenbot.Arm) -> None:
    below = [90, 20, 140, 90, 90, 90, 80]
    with pytest.warns(sevenbot.GuardWarning, match="below the table"):
        simulated_arm.pose(below)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        simulated_arm.pose(90, 90, 65, 90, 90, 90, 80, guard=False)
    recording = sevenbot.Recording.from_points([0, 3], [[90, 90, 65, 90, 90, 90, 80], below])
    with pytest.warns(sevenbot.GuardWarning, match="at 3.00 s"):
        simulated_arm.play(recording)


def test_the_tip_moves_on_a_straight_line(simulated_arm: sevenbot.Arm) -> None:
    simulated_arm.move_to(-50, 185, 60)
    simulated_arm.move_to(50, 185, 60, straight=True, speed=40)
    assert simulated_arm.where().tip == pytest.approx((50, 185, 60), abs=6)


def test_a_missing_servo_is_in_the_status_and_ends_a_move(simulated_arm: sevenbot.Arm) -> None:
    simulation(simulated_arm).fault("3=missing")
    simulated_arm.sleep(1)
    status = simulated_arm.status()
    assert status is not None and status.missing == [3] and not status.is_healthy
    assert "joint 3" in repr(status) and "joint 3" in status._repr_html_()
    with pytest.raises(sevenbot.NotReached, match="joint 3"):
        simulated_arm.pose(90, 90, 100, 90, 90, 90, 80)
    assert simulation(simulated_arm).faults
    assert simulation(simulated_arm).clear("3")
    assert not simulation(simulated_arm).faults


def test_an_arm_without_supply_or_line_raises_its_own_exception(simulated_arm: sevenbot.Arm) -> None:
    with pytest.raises(ValueError, match="use"):
        simulation(simulated_arm).fault("nonsense")
    simulated_arm.set("motor-state", 2)
    with pytest.raises(sevenbot.NotDriven) as raised:
        simulated_arm.pose(REST)
    assert "motor-state" in raised.value.hints[0]
    simulation(simulated_arm).power_off()
    with pytest.raises(sevenbot.NoAnswer) as silent:
        simulated_arm.get("speed")
    assert isinstance(silent.value, sevenbot.PortError) and silent.value.hints
    simulation(simulated_arm).power_cycle()
    simulated_arm.sleep(1)
    assert simulated_arm.get("motor-state") == 1


def test_a_missing_port_has_the_hints_of_the_command_line() -> None:
    with pytest.raises(sevenbot.PortError, match="no such port") as raised:
        sevenbot.Arm("/dev/there-is-no-such-port")
    assert any("plugged in" in hint for hint in raised.value.hints)


def test_a_snapshot_is_restored(simulated_arm: sevenbot.Arm) -> None:
    world = simulation(simulated_arm)
    before, then = world.snapshot(), world.now
    simulated_arm.pose([120, *REST[1:]])
    world.restore(before)
    assert world.now == then
    assert world.angles[0] == pytest.approx(90, abs=1.5)
    assert simulated_arm.angles[0] == pytest.approx(90, abs=1.5)


def test_the_same_calls_give_the_same_values() -> None:
    def run() -> tuple[float, ...]:
        with sevenbot.Arm.simulated(seed=7) as arm:
            arm.sleep(1)
            arm.pose([130, *REST[1:]], speed=40)
            return (*arm.angles, *simulation(arm).angles, simulation(arm).now)

    assert run() == run()


def test_a_hand_turns_a_joint_without_torque(simulated_arm: sevenbot.Arm) -> None:
    world = simulation(simulated_arm)
    for joint in range(1, 8):
        world.hold_by_hand(joint)
    simulated_arm.set("motor-state", 2)
    world.move_by_hand(1, 100)
    simulated_arm.sleep(0.5)
    assert simulated_arm.angles[0] == pytest.approx(100, abs=1)
    with pytest.raises(ValueError, match="1 to 7"):
        world.let_go(8)


def test_map_21_has_the_same_names() -> None:
    with sevenbot.Arm.simulated(map="2.1") as arm:
        arm.sleep(1)
        arm.pose([100, *REST[1:]])
        assert arm.map == "2.1"
        assert arm.get("target-position.1") == 100
        assert arm.angles[0] == pytest.approx(100, abs=1.5)
        with pytest.raises(sevenbot.NotServed):
            with arm.stream():
                pass


@pytest.mark.usefixtures("ctrl_c")
def test_a_signal_ends_a_move_and_the_arm_holds(simulated_arm: sevenbot.Arm) -> None:
    # A stuck joint keeps its target of 180 degrees until the arm holds where it is.
    simulation(simulated_arm).fault("1=stuck")
    simulated_arm.pose([180, *REST[1:]], wait=False)
    timer = threading.Timer(0.05, _thread.interrupt_main)
    with pytest.raises(KeyboardInterrupt):
        timer.start()
        for _ in range(100):
            simulated_arm.sleep(3_600)
    timer.join()
    assert simulated_arm.get("target-position.1") == pytest.approx(90, abs=2)


def test_stop_of_another_thread_ends_a_call(simulated_arm: sevenbot.Arm) -> None:
    raised: list[BaseException] = []
    begun = threading.Event()

    def sleep() -> None:
        begun.set()
        try:
            for _ in range(1000):
                simulated_arm.sleep(86_400)
        except sevenbot.Error as error:
            raised.append(error)

    thread = threading.Thread(target=sleep)
    thread.start()
    begun.wait()
    while not raised:
        simulated_arm.stop()
    thread.join()
    assert isinstance(raised[0], sevenbot.Interrupted)
