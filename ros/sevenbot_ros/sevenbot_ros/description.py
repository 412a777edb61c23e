"""The model of the arm for `robot_description`: the file of `sevenbot model`, with meshes, the claw and a tag for ros2_control.

The model's file and the meshes are in the folder `model`, which `cargo xtask docs` writes.
"""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree as Xml

from sevenbot_ros.joints import CLAW_MAX, NAMES, PASSIVE

MODEL = Path(__file__).parent / "model"
# The links with a mesh of the same name.
MESHES = ("base_link", "turret", "rear_arm", "forearm", "wrist", "hand", "disc")
FINGERS = ("finger_link", "opposite_finger_link")
# From the tip to the axes of the fingers, in metres: ahead and to the sides.
FINGER_AXIS = (0.014, 0.011)
PLUGIN = "joint_state_topic_hardware_interface/JointStateTopicSystem"
_COLOURS = {"shell": "0.85 0.86 0.88 1"}


def meshes() -> str:
    """The place of the meshes: this package for ROS if it was installed with colcon, else a folder of this computer."""
    try:
        from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

        get_package_share_directory("sevenbot_ros")
    except (ImportError, PackageNotFoundError, OSError):
        return MODEL.as_uri()
    return "package://sevenbot_ros/meshes"


def urdf(*, commands: str, states: str, meshes: str) -> str:
    """The description, with these topics for ros2_control."""
    robot = Xml.parse(MODEL / "7bot_v2.urdf").getroot()
    for link in robot.findall("link"):
        if link.get("name") in MESHES:
            _set_mesh(link, meshes)
    _add_claw(robot, meshes)
    robot.append(_ros2_control(commands, states))
    Xml.indent(robot)
    return Xml.tostring(robot, encoding="unicode")


def _set_mesh(link: Xml.Element, meshes: str) -> None:
    for shape in [*link.findall("visual"), *link.findall("collision")]:
        link.remove(shape)
    for kind in ("visual", "collision"):
        shape = Xml.SubElement(link, kind)
        geometry = Xml.SubElement(shape, "geometry")
        # The meshes are in millimetres.
        Xml.SubElement(geometry, "mesh", filename=f"{meshes}/{link.get('name')}.stl", scale="0.001 0.001 0.001")
        if kind == "visual":
            material = Xml.SubElement(shape, "material", name="shell")
            Xml.SubElement(material, "color", rgba=_COLOURS["shell"])


def _add_claw(robot: Xml.Element, meshes: str) -> None:
    """Adds joint 7 and the fingers. Joint 7 turns an empty link, because each finger turns by half of the joint's angle."""
    _add_joint(robot, "joint_7", "tip", "claw", (0.0, 0.0), CLAW_MAX)
    ahead, aside = FINGER_AXIS
    for (name, of, factor), link, side in zip(PASSIVE[1:], FINGERS, (aside, -aside), strict=True):
        joint = _add_joint(robot, name, "tip", link, (ahead, side), CLAW_MAX)
        low, high = sorted((0.0, factor * math.radians(CLAW_MAX)))
        limit = joint.find("limit")
        assert limit is not None
        limit.set("lower", f"{low:.6f}")
        limit.set("upper", f"{high:.6f}")
        Xml.SubElement(joint, "mimic", joint=of, multiplier=f"{factor}", offset="0")
        element = robot.find(f"link[@name='{link}']")
        assert element is not None
        _set_mesh(element, meshes)


def _add_joint(
    robot: Xml.Element, name: str, parent: str, child: str, place: tuple[float, float], high: float
) -> Xml.Element:
    Xml.SubElement(robot, "link", name=child)
    joint = Xml.SubElement(robot, "joint", name=name, type="revolute")
    Xml.SubElement(joint, "parent", link=parent)
    Xml.SubElement(joint, "child", link=child)
    Xml.SubElement(joint, "origin", xyz=f"{place[0]} {place[1]} 0", rpy="0 0 0")
    Xml.SubElement(joint, "axis", xyz="0 0 1")
    Xml.SubElement(joint, "limit", lower="0", upper=f"{math.radians(high):.6f}", effort="2", velocity="6.49")
    return joint


def _ros2_control(commands: str, states: str) -> Xml.Element:
    control = Xml.Element("ros2_control", name="sevenbot", type="system")
    hardware = Xml.SubElement(control, "hardware")
    Xml.SubElement(hardware, "plugin").text = PLUGIN
    # With a threshold a controller that rests sends nothing, and the stream would end.
    for name, value in (
        ("joint_commands_topic", commands),
        ("joint_states_topic", states),
        ("trigger_joint_command_threshold", "-1"),
    ):
        Xml.SubElement(hardware, "param", name=name).text = value
    for name in NAMES:
        joint = Xml.SubElement(control, "joint", name=name)
        Xml.SubElement(joint, "command_interface", name="position")
        for interface in ("position", "velocity", "effort"):
            Xml.SubElement(joint, "state_interface", name=interface)
    return control
