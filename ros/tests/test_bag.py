"""A bag of a run: recorded without rosbag2, and opened by programs that know nothing of this project."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from client import Client
from conftest import Start
from rosbags.highlevel import AnyReader
from sevenbot_ros.joints import NAMES


def test_a_bag_opens_with_rosbags_and_rerun(start: Start, client: Callable[..., Client], tmp_path: Path) -> None:
    start.node(real_time_factor=0.5)
    folder = tmp_path / "bag"
    recorder = start.program([sys.executable, "-m", "sevenbot_ros.bag", str(folder)])
    leading = client(simulated_time=True)
    leading.connect()
    # Both the node and the recorder receive the commands.
    leading.until(lambda: leading.commands.get_subscription_count() == 2, "the recorder")
    leading.each(0.02, 50, lambda index: leading.send({"joint_1": 0.1 * index}))
    leading.until(lambda: leading.degrees()[0] > 3.0 and len(leading.states) > 100, "motion")
    assert recorder.end(signal.SIGINT) == 0
    with AnyReader([folder]) as bag:
        counts = {connection.topic: connection.msgcount for connection in bag.connections}
        # On a busy machine the recorder misses states.
        assert counts["/robot_joint_states"] > 10 and counts["/robot_joint_command"] > 20, counts
        states = [connection for connection in bag.connections if connection.topic == "/robot_joint_states"]
        messages = [bag.deserialize(raw, connection.msgtype) for connection, _, raw in bag.messages(states)]
    assert messages[-1].name == list(NAMES)
    assert math.degrees(messages[-1].position[0]) > 2.0
    mcap, recording = next(folder.glob("*.mcap")), tmp_path / "run.rrd"
    rerun = Path(sys.executable).parent / "rerun"
    subprocess.run([rerun, "mcap", "convert", mcap, "-o", recording], check=True, timeout=120)
    shown = subprocess.run([rerun, "rrd", "print", recording], check=True, timeout=120, capture_output=True, text=True)
    assert "robot_joint_states" in shown.stdout
