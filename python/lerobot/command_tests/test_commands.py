"""`lerobot-record`, `lerobot-replay` and `lerobot-teleoperate`, as a user runs them.

Loop times are printed and not checked: the machine may be busy. So paths are compared as curves, without their times.
"""

import shlex
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from conftest import EmulatedArm, LeRobot, Log, Rows
from lerobot.datasets import LeRobotDataset
from numpy.typing import NDArray

from lerobot_robot_sevenbot import joints

FOLLOWER = ("--robot.type=sevenbot", "--robot.port=sim", "--robot.id=follower")
LEADER = ("--teleop.type=sevenbot_leader", "--teleop.port=sim", "--teleop.id=leader")
SECONDS = 12
OLDEST = 1.0
"""The oldest that a measured angle of the emulated arm may be, in seconds."""
DOCS = Path(__file__).parents[3] / "docs/lerobot.md"


def away(points: Rows, path: Rows) -> float:
    """The largest distance of a point from a path through rows, in degrees of the joint that is furthest away."""
    starts, steps = path[:-1], np.diff(path, axis=0)
    lengths = np.maximum((steps**2).sum(axis=1), 1e-12)
    distances = []
    for point in points:
        share = np.clip(((point - starts) * steps).sum(axis=1) / lengths, 0, 1)
        nearest = starts + share[:, None] * steps
        distances.append(np.abs(point - nearest).max(axis=1).min())
    return float(max(distances))


def degrees(rows: object) -> Rows:
    """Rows of a dataset in degrees, the claw's too."""
    angles = np.array([joints.to_angles(dict(zip(joints.keys("pos"), row, strict=True))) for row in rows])  # type: ignore[attr-defined]
    return np.asarray(angles, dtype=np.float64)


def record(lerobot: LeRobot, hand: Path, *robot: str) -> LeRobotDataset:
    """Records two episodes led by a hand, and reads the dataset back as LeRobot does."""
    root = lerobot.folder / "dataset"
    lerobot.run(
        "lerobot-record",
        *robot,
        f"--robot.log={lerobot.folder / 'record.csv'}",
        *LEADER,
        f"--teleop.hand={hand}",
        "--dataset.repo_id=me/test",
        f"--dataset.root={root}",
        "--dataset.push_to_hub=false",
        "--dataset.single_task=wave",
        "--dataset.num_episodes=2",
        f"--dataset.episode_time_s={SECONDS}",
        "--dataset.reset_time_s=1",
        "--play_sounds=false",
    )
    return LeRobotDataset("me/test", root=root)


def replay(lerobot: LeRobot, *robot: str) -> Log:
    """Replays the first episode."""
    log = lerobot.folder / "replay.csv"
    lerobot.run(
        "lerobot-replay",
        *robot,
        f"--robot.log={log}",
        "--dataset.repo_id=me/test",
        f"--dataset.root={lerobot.folder / 'dataset'}",
        "--dataset.episode=0",
        "--play_sounds=false",
    )
    return Log.read(log)


@dataclass(frozen=True)
class Runs:
    """What was recorded and replayed: the rows of the first episode after the approach."""

    recorded: Log
    replayed: Log
    rows: slice


def record_and_replay(lerobot: LeRobot, hand: Path, *robot: str) -> Runs:
    """Records, replays, and checks that the dataset has what was sent and measured."""
    dataset = record(lerobot, hand, *robot)
    recorded = Log.read(lerobot.folder / "record.csv")
    assert (dataset.num_episodes, dataset.fps) == (2, 30)
    assert dataset.features["action"]["names"] == joints.keys("pos")
    assert dataset.features["observation.state"]["names"] == joints.keys("pos")
    episode = np.array(dataset.hf_dataset["episode_index"])
    frames = int((episode == 0).sum())
    state, action = (degrees(dataset.hf_dataset[key]) for key in ("observation.state", "action"))
    assert np.abs(state[:frames] - recorded.measured[:frames]).max() < 0.01
    assert np.abs(action[:frames] - recorded.sent[:frames]).max() < 0.01
    # The second episode follows the time to reset, which is not in the dataset.
    second = len(state) - frames
    assert np.abs(state[frames:] - recorded.measured[-second:]).max() < 0.01

    replayed = replay(lerobot, *robot)
    assert np.abs(replayed.sent - recorded.sent[:frames]).max() < 0.011
    print("record:", recorded.loop_times())
    print("replay:", replayed.loop_times())
    # The first frame is where the arm stood before the approach.
    return Runs(recorded, replayed, slice(1, frames))


def check_same_path(what: str, one: Rows, other: Rows, longer_one: Rows | None = None, longer_other: Rows | None = None) -> None:
    """Checks that two paths are the same within a degree, and that all joints move.

    The longer paths also hold the motion before and after: the two paths do not begin and end at the same point.
    """
    distances = (
        away(other, one if longer_one is None else longer_one),
        away(one, other if longer_other is None else longer_other),
    )
    print(f"{what}: the replayed path is {distances[0]:.2f} and {distances[1]:.2f} degrees away from the recorded one")
    assert max(distances) < 1
    assert (np.ptp(one, axis=0) > 15).all(), "a path that moves all joints"


def test_record_and_replay_on_a_simulated_arm(lerobot: LeRobot, hand: Path) -> None:
    runs = record_and_replay(lerobot, hand, *FOLLOWER)
    recorded, replayed, rows = runs.recorded, runs.replayed, runs.rows
    check_same_path("measured", recorded.measured[rows], replayed.measured[rows])
    # The true path of the simulated arm: a measurement is up to 10 ms old, and the arm moves on in that time.
    check_same_path("true", recorded.true[rows], replayed.true[rows])
    assert away(recorded.measured[2 : rows.stop], recorded.true[: rows.stop + 1]) < 1


def test_record_and_replay_on_the_emulated_image(
    lerobot: LeRobot, slow_hand: Path, emulated_arm: EmulatedArm
) -> None:
    robot = ("--robot.type=sevenbot", f"--robot.port={emulated_arm.port}", "--robot.id=arm")
    runs = record_and_replay(lerobot, slow_hand, *robot)
    logs = (runs.recorded, runs.replayed)
    paths = [emulated_arm.true_path(log, runs.rows) for log in logs]
    longer = [emulated_arm.true_path(log, runs.rows, more=1.0)[1] for log in logs]
    check_same_path("true", paths[0][1], paths[1][1], *longer)
    for log, (times, path) in zip(logs, paths, strict=True):
        ages = measured_ages(log, runs.rows, times, path)
        print(f"a measurement is {np.median(ages) * 1000:.0f} ms old, in the median, and {ages.max() * 1000:.0f} ms at most")


def measured_ages(log: Log, rows: slice, times: NDArray[np.float64], path: Rows) -> NDArray[np.float64]:
    """How old each measured angle was, in seconds: the joint was there, within a degree, at some time not long before.

    The servos of the emulator answer through sockets. On a busy computer an answer takes longer than on a servo bus, and the seven
    angles of a row are not of the same moment. So they do not lie on the path together, and the true path is compared.
    """
    ages = []
    for moment, measured in zip(log.times[rows], log.measured[rows], strict=True):
        before = (times <= moment) & (times >= moment - OLDEST)
        if moment - OLDEST < times[0]:
            continue
        for joint, angle in enumerate(measured):
            near = times[before][np.abs(path[before, joint] - angle) < 1]
            assert near.size, f"joint {joint + 1} was not at {angle} degrees in the last {OLDEST} s"
            ages.append(moment - near[-1])
    return np.array(ages)


def test_teleoperate_between_two_simulated_arms(lerobot: LeRobot, hand: Path) -> None:
    log = lerobot.folder / "teleoperate.csv"
    printed = lerobot.run(
        "lerobot-teleoperate",
        *FOLLOWER,
        f"--robot.log={log}",
        *LEADER,
        f"--teleop.hand={hand}",
        "--fps=30",
        f"--teleop_time_s={SECONDS}",
    )
    assert "Teleop loop time" in printed
    led = Log.read(log)
    distance = away(led.true[1:], led.sent)
    print(f"teleoperate: {distance:.2f} degrees away from the leader's path;", led.loop_times())
    assert distance < 1.5


@pytest.mark.parametrize("park", ["true", "false"])
def test_ctrl_c_ends_both_arms(lerobot: LeRobot, park: str) -> None:
    log = lerobot.folder / "log.csv"
    process = lerobot.start(
        "lerobot-teleoperate",
        *FOLLOWER,
        f"--robot.log={log}",
        f"--robot.park_on_disconnect={park}",
        *LEADER,
        f"--teleop.park_on_disconnect={park}",
        "--fps=30",
    )
    while process.poll() is None and not (log.exists() and log.read_text().count("\n") > 30):
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    printed = lerobot.finish(process)
    assert printed.count("is disconnected") == 2
    assert printed.count("goes to its park pose") == (2 if park == "true" else 0)
    assert "The arm is not" not in printed


def test_a_wrong_port_is_said_with_what_to_do(lerobot: LeRobot) -> None:
    process = lerobot.start("lerobot-teleoperate", "--robot.type=sevenbot", "--robot.port=/dev/none", *LEADER)
    printed, _ = process.communicate(timeout=300)
    assert process.returncode != 0
    assert "/dev/none: there is no such port" in printed
    assert "--robot.port=sim is a simulated arm" in printed


def test_the_commands_of_the_docs(lerobot: LeRobot) -> None:
    lines = DOCS.read_text().replace("\\\n", " ").splitlines()
    commands = [shlex.split(line) for line in lines if line.startswith("lerobot-")]
    assert [command[0] for command in commands] == ["lerobot-record", "lerobot-replay", "lerobot-teleoperate"]
    for command in commands:
        lerobot.run(*command)
    assert LeRobotDataset("me/wave", root=lerobot.folder / "wave").num_episodes == 2
