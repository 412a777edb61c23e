"""Recordings in the formats of other programs, read by those programs' own packages."""

from __future__ import annotations

import csv
import math
import os
import pickle
import subprocess
from pathlib import Path
from typing import Any

import pytest
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader

import sevenbot

REST = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0]
COUNT = 250
PROGRAMS = os.environ.get("SEVENBOT_PROGRAMS")
#: The timeout of waits in seconds. It is long, because the machine may be busy.
ENOUGH = 120.0


@pytest.fixture
def recording() -> sevenbot.Recording:
    times = [number / 50 for number in range(COUNT)]
    angles = [[90 + 30 * math.sin(time), *REST[1:]] for time in times]
    return sevenbot.Recording.from_points(times, angles, [time > 3 for time in times])


@pytest.fixture
def file(recording: sevenbot.Recording, tmp_path: Path) -> Path:
    path = tmp_path / "wave.mcap"
    recording.save(path)
    return path


@pytest.mark.parametrize("name", ["wave.txt", "wave.csv", "wave.mcap", "wave"])
def test_every_format_has_the_whole_recording(recording: sevenbot.Recording, name: str, tmp_path: Path) -> None:
    recording.save(tmp_path / name)
    assert sevenbot.Recording.load(tmp_path / name) == recording


def test_csv_has_a_column_for_each_joint(recording: sevenbot.Recording, tmp_path: Path) -> None:
    recording.save(tmp_path / "wave.csv")
    with (tmp_path / "wave.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == COUNT
    assert [float(row["joint_1"]) for row in rows] == [float(angles[0]) for angles in recording.angles]
    assert rows[-1]["seconds"] == "4.980" and rows[-1]["vacuum"] == "1"


def test_mcap_reads_the_file_by_its_index(file: Path) -> None:
    with file.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        assert reader.get_header().profile == "ros2"
        counts = summary.statistics.channel_message_counts
        topics = {channel.topic: counts[number] for number, channel in summary.channels.items()}
        assert topics == {
            "/joint_states": COUNT, "/tf": COUNT, "/tf_static": 1, "/robot_description": 1, "/vacuum": 2,
        }  # fmt: skip
        assert len(summary.chunk_indexes) == 5
        part = list(reader.iter_messages("/joint_states", starting_at=1_000_000_000, ending_before=2_000_000_000))
        assert len(part) == 50


def test_rosbags_reads_every_message(file: Path, recording: sevenbot.Recording) -> None:
    with AnyReader([file]) as bag:
        messages: list[tuple[str, Any]] = [
            (connection.topic, bag.deserialize(raw, connection.msgtype)) for connection, _, raw in bag.messages()
        ]
    states = [message for topic, message in messages if topic == "/joint_states"]
    assert len(states) == COUNT and states[0].name[6:] == ["joint_7", "elbow", "finger", "opposite_finger"]
    for state, angles in zip(states, recording.angles, strict=True):
        assert math.degrees(state.position[0]) + 90 == pytest.approx(float(angles[0]))
        assert math.degrees(state.position[2]) + 65 == pytest.approx(float(angles[2]))
    transforms = next(message for topic, message in messages if topic == "/tf").transforms
    assert [(link.header.frame_id, link.child_frame_id) for link in transforms][:2] == [
        ("base_link", "turret"),
        ("turret", "rear_arm"),
    ]
    description = next(message for topic, message in messages if topic == "/robot_description")
    assert '<robot name="7bot_v2">' in description.data


@pytest.mark.parametrize("kept", [0.3, 0.6, 0.9])
def test_a_cut_file_is_read_as_far_as_it_goes(file: Path, kept: float) -> None:
    whole = file.read_bytes()
    cut = file.with_name("cut.mcap")
    cut.write_bytes(whole[: int(len(whole) * kept)])
    with pytest.raises(sevenbot.BadRecording, match="the file ends in the middle; [1-9]") as refused:
        sevenbot.Recording.load(cut)
    assert "sevenbot convert" in refused.value.hints[0]
    # The messages that another reader finds in the cut file.
    topics, moments = {}, 0
    with cut.open("rb") as stream:
        try:
            for record in StreamReader(stream).records:
                if isinstance(record, Channel):
                    topics[record.id] = record.topic
                if isinstance(record, Message):
                    moments += topics[record.channel_id] == "/joint_states"
        except (McapError, EOFError):
            pass
    assert f"; {moments} moments" in str(refused.value)


def test_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "other.csv"
    path.write_text("time,joint_1\n0,90\n")
    with pytest.raises(sevenbot.BadRecording, match="not a recording"):
        sevenbot.Recording.load(path)


@pytest.mark.skipif(PROGRAMS is None, reason="SEVENBOT_PROGRAMS names no folder with programs")
def test_a_recording_from_mcap_equals_its_copy(tmp_path: Path) -> None:
    text, mcap = tmp_path / "a.txt", tmp_path / "a.mcap"
    words = [f"{PROGRAMS}/sevenbot", "--port", "sim", "record", str(text), "--driven", "--yes", "--seconds", "1"]
    subprocess.run([*words, "--mcap", str(mcap)], check=True, timeout=ENOUGH)
    loaded = sevenbot.Recording.load(mcap)
    assert loaded == pickle.loads(pickle.dumps(loaded)) == loaded[:] == sevenbot.Recording.load(text)
    same = subprocess.run([*words, "--mcap", str(text)], capture_output=True, text=True, timeout=ENOUGH)
    assert same.returncode != 0 and "two files" in same.stderr
    assert sevenbot.Recording.load(text) == loaded, "nothing is lost"
