"""The description as a file: joints, limits, meshes and kinematics. Also the health that is computed from registers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as Xml

import pytest
import sevenbot
from sevenbot_ros import description, health
from sevenbot_ros.joints import LINKAGE, NAMES, PASSIVE, Limits, to_radians
from sevenbot_ros.messages import orientation

ROS = Path(__file__).parents[1]
ROBOT = Xml.fromstring(description.urdf(commands="/robot_joint_command", states="/robot_joint_states", meshes="package://sevenbot_ros/meshes"))
LINKS = {link.get("name") for link in ROBOT.findall("link")}
JOINTS = {str(joint.get("name")): joint for joint in ROBOT.findall("joint")}
MOVED = {name for name, joint in JOINTS.items() if joint.get("type") == "revolute"}


def attribute(joint: Xml.Element, child: str, name: str) -> str:
    found = joint.find(child)
    assert found is not None
    return found.get(name, "")


def test_the_description_is_a_tree_of_the_joints_that_the_node_publishes() -> None:
    assert MOVED == {*NAMES, *(name for name, _, _ in PASSIVE)}
    children = [attribute(joint, "child", "link") for joint in JOINTS.values()]
    parents = {attribute(joint, "parent", "link") for joint in JOINTS.values()}
    assert len(set(children)) == len(children)
    assert LINKS == {*children, "base_link"} and parents <= LINKS


def test_passive_joints_of_the_description_are_those_of_the_node() -> None:
    for name, of, factor in PASSIVE:
        mimic = JOINTS[name].find("mimic")
        assert mimic is not None and mimic.get("joint") == of
        assert float(mimic.get("multiplier", "1")) == factor
    assert [name for name in MOVED if JOINTS[name].find("mimic") is not None] == pytest.approx(
        [name for name in MOVED if name not in NAMES]
    )


def test_the_limits_of_the_description_are_those_of_the_node() -> None:
    limits = Limits.of_arm()
    for side, angles in (("lower", limits.low), ("upper", limits.high)):
        found = [float(attribute(JOINTS[name], "limit", side)) for name in NAMES]
        assert found == pytest.approx(to_radians(angles), abs=1e-4)


def test_meshes_exist_and_are_closed_triangles() -> None:
    meshes = {str(mesh.get("filename")).rsplit("/", 1)[1] for mesh in ROBOT.iter("mesh")}
    assert meshes == {path.name for path in description.MODEL.glob("*.stl")}
    for name in meshes:
        data = (description.MODEL / name).read_bytes()
        assert len(data) == 84 + 50 * int.from_bytes(data[80:84], "little")


def test_the_tag_for_ros2_control() -> None:
    control = ROBOT.find("ros2_control")
    assert control is not None
    parameters = {parameter.get("name"): parameter.text for parameter in control.iter("param")}
    assert parameters == {
        "joint_commands_topic": "/robot_joint_command",
        "joint_states_topic": "/robot_joint_states",
        "trigger_joint_command_threshold": "-1",
    }
    assert [joint.get("name") for joint in control.findall("joint")] == list(NAMES)
    assert "xacro" not in Xml.tostring(ROBOT, encoding="unicode")


def turn(axis: Sequence[float], angle: float) -> list[list[float]]:
    """A rotation as a matrix."""
    x, y, z = axis
    c, s = math.cos(angle), math.sin(angle)
    d = 1 - c
    return [
        [c + x * x * d, x * y * d - z * s, x * z * d + y * s],
        [y * x * d + z * s, c + y * y * d, y * z * d - x * s],
        [z * x * d - y * s, z * y * d + x * s, c + z * z * d],
    ]


def tip_of_description(positions: dict[str, float]) -> tuple[list[float], list[float]]:
    """The tip and the direction of the tool by the joints of the description, in metres."""
    place, frame = [0.0, 0.0, 0.0], turn((1, 0, 0), 0.0)
    by_child = {attribute(joint, "child", "link"): joint for joint in JOINTS.values()}
    chain: list[Xml.Element] = []
    link = "tip"
    while link in by_child:
        chain.insert(0, by_child[link])
        link = attribute(by_child[link], "parent", "link")
    for joint in chain:
        origin = [float(number) for number in attribute(joint, "origin", "xyz").split()]
        place = [at + sum(row[k] * origin[k] for k in range(3)) for at, row in zip(place, frame, strict=True)]
        if joint.get("type") == "revolute":
            axis = [float(number) for number in attribute(joint, "axis", "xyz").split()]
            rotation = turn(axis, positions[str(joint.get("name"))])
            frame = [[sum(row[k] * rotation[k][j] for k in range(3)) for j in range(3)] for row in frame]
    return place, [row[0] for row in frame]


@pytest.mark.parametrize("pose", [(90, 90, 65, 90, 90, 90, 0), (120, 70, 80, 60, 130, 20, 40), (30, 110, 50, 170, 40, 150, 84)])
def test_the_tip_of_the_description_and_of_the_node_is_that_of_the_kinematics(pose: tuple[float, ...]) -> None:
    radians = to_radians(pose)
    positions = dict(zip(NAMES, radians, strict=True)) | {"elbow": -radians[1]}
    place, tool = tip_of_description(positions)
    where = sevenbot.forward(pose)
    (x, y, z), (u, v, w) = where.tip, where.tool
    assert place == pytest.approx([y / 1000, -x / 1000, z / 1000], abs=1e-5)
    assert tool == pytest.approx([v, -u, w], abs=1e-5)
    qx, qy, qz, qw = orientation(radians)
    turned = [1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy + qz * qw), 2 * (qx * qz - qy * qw)]
    assert turned == pytest.approx(tool, abs=1e-5)


def test_the_linkage_of_the_node_is_that_of_the_description() -> None:
    text = (description.MODEL / "7bot_v2.urdf").read_text()
    assert f"joint_2 + joint_3 within -{LINKAGE:g} to {LINKAGE:g} degrees" in text


def test_health() -> None:
    motor, protection = [1, 0, 0], [1, 70, 40, 0, 0, 0, 0, 1]
    status = [1, 0, 0, 0, 0, 0, 4, 0, 0, 7, 74, 25]
    fine = health.of_registers(motor, protection, status, 7)
    assert (fine.level, fine.message) == (health.Level.OK, "healthy")
    assert fine.values["supply in V"] == "7.4"
    wrong = health.of_registers([0, 0, 1], [1, 70, 40, 0b10, 0b100, 0b100101, 1, 1], [1, 0, 1, 0, 0, 0, 4, 0, 0, 9, 74, 70], 7)
    assert wrong.level is health.Level.ERROR
    for text in (
        "lost their supply", "no answer of joint_1", "no torque in joint_3", "blocks joint_2", "overloaded",
        "hot: 70", "out of range: 7.4 V", "damping protection", "2 new errors",
    ):
        assert text in wrong.message
    # The counter wraps.
    assert "3 new errors" in health.of_registers(motor, protection, [*status[:9], 1, 74, 25], 65534).message


def test_the_registers_of_the_health_are_those_of_the_arm() -> None:
    arm = sevenbot.Arm.simulated()
    arm.sleep(1)
    arm.simulation.fault("3=missing")
    arm.sleep(1)
    blocks = [arm.get(block) for block in health.BLOCKS]
    found = health.of_registers(*blocks, errors_before=0)
    status = arm.status()
    assert status is not None
    assert found.values["supply in V"] == f"{status.supply_volts:.1f}"
    assert found.values["hottest servo in degrees Celsius"] == f"{status.hottest_celsius}"
    assert found.values["missing"] == "joint_3" and status.missing == [3]
    assert int(found.values["errors of the servo bus"]) > 0
    arm.set("vacuum-pump", 1)
    assert health.of_registers(arm.get(health.BLOCKS[0]), *blocks[1:], errors_before=0).values["vacuum"] == "sucks"
