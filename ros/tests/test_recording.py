"""A recording of `sevenbot record --mcap`: the same topics as a bag of the node, and a model that moves in Rerun."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

from conftest import Start
from rosbags.highlevel import AnyReader
from sevenbot_ros.bag import TOPICS
from sevenbot_ros.messages import ALL_NAMES

TOOL = os.environ["SEVENBOT"]


def record(start: Start, mcap: Path) -> None:
    """A second of a motion of joint 1."""
    start.simulator()
    tool = [TOOL, "--port", start.link]
    subprocess.run([*tool, "pose", "150", "90", "65", "90", "90", "90", "60", "--speed", "20"], check=True, timeout=60)
    words = [*tool, "record", "--mcap", str(mcap), "--driven", "--seconds", "1"]
    subprocess.run(words, check=True, timeout=60)


def test_a_recording_looks_like_a_bag_of_the_node(start: Start, tmp_path: Path) -> None:
    mcap = tmp_path / "run.mcap"
    record(start, mcap)
    with AnyReader([mcap]) as bag:
        types = {connection.topic: connection.msgtype for connection in bag.connections}
        ours = {f"/{topic}": name for topic, _, name, _ in TOPICS}
        both = types.keys() & ours.keys()
        assert both == {"/joint_states", "/robot_joint_command", "/robot_description"}
        assert all(types[topic] == ours[topic] for topic in both)
        assert types["/diagnostics"] == "diagnostic_msgs/msg/DiagnosticArray"
        messages = [
            (connection.topic, bag.deserialize(raw, connection.msgtype)) for connection, _, raw in bag.messages()
        ]
    states = [message for topic, message in messages if topic == "/joint_states"]
    assert list(states[0].name) == ALL_NAMES
    assert len(states) > 10 and states[-1].position[0] > states[0].position[0]
    assert max(state.velocity[0] for state in states) > 0.1
    commands = [message for topic, message in messages if topic == "/robot_joint_command"]
    assert math.isclose(commands[0].position[0], math.radians(60), abs_tol=1e-9)
    diagnosis = next(message for topic, message in messages if topic == "/diagnostics").status[0]
    assert (diagnosis.level, diagnosis.message, diagnosis.name) == (0, "healthy", "/sevenbot: arm")


def test_rerun_has_the_model_and_its_motion(start: Start, tmp_path: Path) -> None:
    mcap, rrd = tmp_path / "run.mcap", tmp_path / "run.rrd"
    record(start, mcap)
    rerun = Path(sys.executable).parent / "rerun"
    subprocess.run([rerun, "mcap", "convert", mcap, "-o", rrd], check=True, timeout=120)
    shown = subprocess.run([rerun, "rrd", "print", rrd], check=True, timeout=120, capture_output=True, text=True).stdout
    for columns in (
        "/tf - data columns: [Transform3D:child_frame Transform3D:parent_frame Transform3D:quaternion",
        "/joint_states/position - data columns: [Scalars:scalars",
        "/7bot_v2/visual_geometries/forearm/visual_0 - data columns: [Cylinders3D:colors Cylinders3D:lengths",
    ):
        assert columns in shown, shown
