"""The follower and the leader on simulated arms, through LeRobot's base classes."""

import logging
from pathlib import Path
from typing import Any

import pytest
import sevenbot
from lerobot.robots import RobotConfig, make_robot_from_config
from lerobot.teleoperators import TeleoperatorConfig, make_teleoperator_from_config
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

from lerobot_robot_sevenbot import Sevenbot, SevenbotConfig, SevenbotLeader, SevenbotLeaderConfig, joints

HOME = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0]
FRAME = 1 / 30
Clock = list[float]


def follower(**options: Any) -> Sevenbot:
    robot = make_robot_from_config(SevenbotConfig(port="sim", id="test", **options))
    assert isinstance(robot, Sevenbot)
    robot.connect()
    return robot


def leader(**options: Any) -> SevenbotLeader:
    teleop = make_teleoperator_from_config(SevenbotLeaderConfig(port="sim", id="test", **options))
    assert isinstance(teleop, SevenbotLeader)
    teleop.connect()
    return teleop


def simulation(device: Sevenbot | SevenbotLeader) -> sevenbot.Simulation:
    assert device._connection is not None and device._connection.simulation is not None
    return device._connection.simulation


def arm(device: Sevenbot | SevenbotLeader) -> sevenbot.Arm:
    assert device._connection is not None
    return device._connection.arm


def action(*angles: float) -> dict[str, float]:
    return joints.to_lerobot("pos", angles)


def run(robot: Sevenbot, now: Clock, path: list[list[float]]) -> list[list[float]]:
    """Sends a path as LeRobot's loops do, and returns what was measured before each action."""
    measured = []
    for angles in path:
        start = now[0]
        measured.append(joints.to_angles(robot.get_observation()))
        robot.send_action(action(*angles))
        now[0] = max(now[0], start + FRAME)
    return measured


def test_lerobot_finds_both_types() -> None:
    assert RobotConfig.get_choice_class("sevenbot") is SevenbotConfig
    assert TeleoperatorConfig.get_choice_class("sevenbot_leader") is SevenbotLeaderConfig
    assert SevenbotConfig().type == "sevenbot" and SevenbotLeaderConfig().type == "sevenbot_leader"


def test_features_need_no_arm_and_no_camera() -> None:
    robot = Sevenbot(SevenbotConfig(port="/dev/none", velocities=True, loads=True))
    assert robot.cameras == {}
    assert len(robot.observation_features) == 21
    assert robot.observation_features["claw.load"] is float
    assert list(robot.action_features) == joints.keys("pos")
    assert list(SevenbotLeader(SevenbotLeaderConfig()).action_features) == list(robot.action_features)
    with pytest.raises(DeviceNotConnectedError):
        robot.get_observation()


@pytest.mark.parametrize(
    ("option", "value"), [("fps", 0), ("max_step", 0.0), ("approach_speed", 500.0), ("watchdog", 60.0)]
)
def test_options_out_of_range_are_named(option: str, value: float) -> None:
    options: dict[str, Any] = {option: value}
    with pytest.raises(ValueError, match=f"{option}=.* is out of range"):
        SevenbotConfig(**options)


def test_observations_are_what_the_features_say(now: Clock) -> None:
    robot = follower(velocities=True, loads=True)
    observation = robot.get_observation()
    assert list(observation) == list(robot.observation_features)
    assert observation["joint_1.pos"] == pytest.approx(90, abs=1)
    assert observation["claw.pos"] == pytest.approx(100 * 80 / 84, abs=1)
    assert abs(observation["joint_1.vel"]) < 1
    robot.disconnect()


def test_the_arm_follows_a_path_at_the_loops_rate(now: Clock) -> None:
    robot = follower()
    path = [[90 + 0.5 * step, *HOME[1:]] for step in range(90)]
    before = simulation(robot).now
    measured = run(robot, now, path)
    assert simulation(robot).now - before == pytest.approx(90 * FRAME, abs=0.5)
    # A point is reached two periods after it was sent.
    for step in range(10, 90):
        assert measured[step][0] == pytest.approx(path[step - 2][0], abs=1)
    assert simulation(robot).angles[0] == pytest.approx(134, abs=2)


def test_the_first_action_is_approached_slowly(now: Clock) -> None:
    robot = follower(approach_speed=20.0)
    start = now[0]
    robot.send_action(action(130, *HOME[1:]))
    assert now[0] - start == pytest.approx(2.0, abs=0.3)
    assert simulation(robot).angles[0] == pytest.approx(130, abs=1.5)
    # The approach does not count as a pause, so the next action is not approached.
    start = now[0]
    run(robot, now, [[130 - step * 0.5, *HOME[1:]] for step in range(30)])
    assert now[0] - start == pytest.approx(30 * FRAME, abs=0.1)


def test_the_first_action_after_a_pause_is_approached_too(now: Clock) -> None:
    robot = follower()
    run(robot, now, [HOME] * 5)
    now[0] += 20
    start = simulation(robot).now
    robot.send_action(action(60, *HOME[1:]))
    assert simulation(robot).now - start > 20.9
    assert simulation(robot).angles[0] == pytest.approx(60, abs=1.5)


def test_actions_beyond_the_limits_are_brought_inside_and_told_once(
    now: Clock, caplog: pytest.LogCaptureFixture
) -> None:
    robot = follower()
    run(robot, now, [HOME])
    outside = [*HOME[:6], 84 * 1.1]
    sent = [robot.send_action(action(*outside)) for _ in range(5)]
    assert sent[-1]["claw.pos"] == pytest.approx(100)
    told = [record.message for record in caplog.records if "claw" in record.message]
    assert len(told) == 1 and "as it was before" in told[0]
    now[0] += 1
    assert simulation(robot).angles[6] <= 84.5


def test_the_arm_does_not_leap_to_where_the_leader_went_during_the_approach(now: Clock) -> None:
    robot = follower(approach_speed=30.0)
    run(robot, now, [[100, *HOME[1:]]])
    sent = [robot.send_action(action(110, *HOME[1:]))["joint_1.pos"] for _ in range(12)]
    assert sent[:3] == pytest.approx([101, 102, 103]) and sent[9:] == pytest.approx([110, 110, 110])
    # It has caught up: from now on it goes where the actions are.
    assert robot.send_action(action(104, *HOME[1:]))["joint_1.pos"] == pytest.approx(104)


def test_max_step_limits_the_change(now: Clock) -> None:
    robot = follower(max_step=1.0)
    run(robot, now, [HOME] * 2)
    assert robot.send_action(action(100, *HOME[1:]))["joint_1.pos"] == pytest.approx(91)
    assert robot.send_action(action(100, *HOME[1:]))["joint_1.pos"] == pytest.approx(92)


def test_a_stalled_joint_is_warned_about_once(now: Clock, caplog: pytest.LogCaptureFixture) -> None:
    robot = follower()
    run(robot, now, [HOME] * 3)
    simulation(robot).fault("1=stuck")
    run(robot, now, [[90 + min(step, 80) * 0.5, *HOME[1:]] for step in range(240)])
    told = [record.message for record in caplog.records if "joint 1 is blocked" in record.message]
    assert len(told) == 1 and "remove what is in its way" in told[0]
    simulation(robot).clear()
    measured = run(robot, now, [[130, *HOME[1:]]] * 90)
    assert measured[-1][0] == pytest.approx(130, abs=1.5)


def test_a_short_silence_of_a_servo_is_told_and_a_long_one_ends_the_loop(
    now: Clock, caplog: pytest.LogCaptureFixture
) -> None:
    robot = follower()
    run(robot, now, [HOME] * 30)
    simulation(robot).fault("2=missing", 0.3)
    run(robot, now, [[90 + step * 0.2, *HOME[1:]] for step in range(60)])
    told = [record.message for record in caplog.records if "joint 2 does not answer" in record.message]
    assert len(told) == 1
    simulation(robot).fault("2=missing")
    with pytest.raises(sevenbot.ArmProblem, match="joint 2 does not answer"):
        run(robot, now, [[102, *HOME[1:]]] * 60)


def test_a_lost_supply_ends_the_loop_with_what_to_do(now: Clock) -> None:
    robot = follower()
    run(robot, now, [HOME] * 3)
    simulation(robot).fault("supply=off")
    with pytest.raises(sevenbot.ArmProblem, match="check the servos' supply"):
        run(robot, now, [HOME] * 120)
    robot.disconnect()
    assert not robot.is_connected


def test_an_arm_without_supply_is_not_connected(now: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    without = sevenbot.Arm.simulated()
    without.sleep(1)
    without.simulation.fault("supply=off")
    without.sleep(2)
    monkeypatch.setattr("sevenbot.Arm", lambda port: without)
    robot = Sevenbot(SevenbotConfig(port="/dev/any"))
    with pytest.raises(sevenbot.ArmProblem, match="emergency stop"):
        robot.connect()
    assert not robot.is_connected


def test_a_wrong_port_names_the_option() -> None:
    for device, option in (
        (Sevenbot(SevenbotConfig(port="/dev/none")), "--robot.port=sim"),
        (SevenbotLeader(SevenbotLeaderConfig(port="/dev/none")), "--teleop.port=sim"),
    ):
        with pytest.raises(sevenbot.PortError, match="there is no such port") as raised:
            device.connect()
        assert option in raised.value.__notes__[0]
        assert not device.is_connected


def test_calibration_is_in_the_arm(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    robot = Sevenbot(SevenbotConfig())
    assert robot.is_calibrated
    robot.calibrate()
    assert "offset.1" in caplog.text


def test_connecting_twice_is_refused(now: Clock) -> None:
    robot = follower()
    with pytest.raises(DeviceAlreadyConnectedError):
        robot.connect()


def test_a_disconnect_parks_or_holds(now: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    for park, state in ((True, "damping protection"), (False, "servo")):
        robot = follower(park_on_disconnect=park)
        run(robot, now, [[100 + 0.5 * step, *HOME[1:]] for step in range(20)])
        connected = arm(robot)
        # Read the motor state before the arm is closed.
        with monkeypatch.context() as patch:
            states: list[str] = []
            close = type(connected).close
            patch.setattr(
                "lerobot_robot_sevenbot.connection.Connection.follow_time",
                lambda self: states.append(self.arm.status().motor_state),
            )
            robot.disconnect()
        assert states[-1] == state
        assert close is type(connected).close
        assert not connected.is_connected


def test_a_failed_end_is_logged_and_everything_closed(now: Clock, caplog: pytest.LogCaptureFixture) -> None:
    robot = follower()
    run(robot, now, [HOME] * 3)
    simulation(robot).unplug()
    robot.disconnect()
    assert not robot.is_connected
    assert "The arm is not parked" in caplog.text


def test_a_leader_is_led_by_hand_within_the_followers_limits(now: Clock, tmp_path: Path) -> None:
    path = tmp_path / "hand.txt"
    rows = [HOME, [120, *HOME[1:6], 90.0]]
    sevenbot.Recording.from_points([0.0, 2.0], rows).save(path)
    teleop = leader(hand=path)
    assert arm(teleop).get("motor-state") != 1
    first = teleop.get_action()
    now[0] += 1
    middle = teleop.get_action()
    now[0] += 1
    last = teleop.get_action()
    assert [pose["joint_1.pos"] for pose in (first, middle, last)] == pytest.approx([90, 105, 120], abs=1.5)
    assert last["claw.pos"] == 100
    teleop.disconnect()
    assert not teleop.is_connected


def test_a_leader_that_cannot_be_read_ends_the_loop(now: Clock, caplog: pytest.LogCaptureFixture) -> None:
    for fault, told in (("3=missing", "joint 3 does not answer"), ("supply=off", "no servo answers")):
        teleop = leader()
        simulation(teleop).fault(fault)
        with pytest.raises(ConnectionError, match=told):
            for _ in range(60):
                teleop.get_action()
                now[0] += FRAME
        teleop.disconnect()
    assert "joint 3 does not answer" in caplog.text, "a short silence is told"
    teleop = leader()
    arm(teleop).set("motor-state", 1)
    now[0] += 1
    with pytest.raises(ConnectionError, match="the motors of the leader are on"):
        teleop.get_action()


def test_speeds_that_another_program_left_do_not_slow_the_arm(now: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    left = sevenbot.Arm.simulated()
    left.sleep(1)
    left.set("speed", [5] * 7)
    monkeypatch.setattr("sevenbot.Arm", lambda port: left)
    robot = make_robot_from_config(SevenbotConfig(port="left", id="test"))
    robot.connect()
    assert left.get("speed") == [60] * 7


def test_a_leader_waves_without_a_recording(now: Clock) -> None:
    teleop = leader()
    poses = []
    for _ in range(60):
        poses.append(joints.to_angles(teleop.get_action()))
        now[0] += 0.1
    first = [pose[0] for pose in poses]
    assert max(first) - min(first) == pytest.approx(50, abs=3)


def test_a_follower_follows_a_leader(now: Clock) -> None:
    robot, teleop = follower(), leader()
    for _ in range(150):
        start = now[0]
        robot.get_observation()
        wanted = teleop.get_action()
        robot.send_action(wanted)
        now[0] = max(now[0], start + FRAME)
    true, led = simulation(robot).angles, simulation(teleop).angles
    assert max(abs(one - other) for one, other in zip(true, led, strict=True)) < 4


def test_the_log_has_what_was_sent_measured_and_true(now: Clock, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    robot = follower(log=path)
    run(robot, now, [HOME] * 4)
    robot.disconnect()
    head, *lines = path.read_text().splitlines()
    assert head.split(",")[:2] == ["time", "sent.joint_1"] and len(head.split(",")) == 22
    assert len(lines) == 4
    assert [float(cell) for cell in lines[-1].split(",")[1:8]] == HOME
