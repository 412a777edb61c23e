"""The files for MoveIt and ros2_control. Neither can be installed from PyPI, so these are checked as files: names, ranges and pairs."""

from __future__ import annotations

import ast
import importlib.util
import math
from pathlib import Path
from types import ModuleType
from typing import Any
from xml.etree import ElementTree as Xml

import pytest
import yaml
from sevenbot_ros.joints import LINKAGE, NAMES, PASSIVE
from sevenbot_ros.parameters import DECLARED
from sevenbot_ros.trajectory_action import CONTROLLERS
from test_files import JOINTS, LINKS, ROBOT, ROS, attribute

CONFIG = ROS / "sevenbot_moveit_config/config"
SRDF = Xml.parse(CONFIG / "7bot_v2.srdf").getroot()
ARM = list(NAMES[:6])
DEFAULTS = {name: default for name, default, _ in DECLARED}


def read(name: str) -> Any:
    return yaml.safe_load((CONFIG / name).read_text())


def limits(joint: str) -> tuple[float, float]:
    """The range of a joint in MoveIt: its own, or that of the description."""
    own = read("joint_limits.yaml")["joint_limits"][joint]
    if own.get("has_position_limits"):
        return own["min_position"], own["max_position"]
    return float(attribute(JOINTS[joint], "limit", "lower")), float(attribute(JOINTS[joint], "limit", "upper"))


def test_the_names_of_the_groups_are_those_of_the_description() -> None:
    assert SRDF.get("name") == ROBOT.get("name")
    chain = SRDF.find("group[@name='arm']/chain")
    assert chain is not None and {chain.get("base_link"), chain.get("tip_link")} <= LINKS
    named = {str(joint.get("name")) for joint in SRDF.iter("joint")} | {str(joint.get("name")) for joint in SRDF.iter("passive_joint")}
    assert named <= set(JOINTS)
    assert {joint.get("name") for joint in SRDF.iter("passive_joint")} == {name for name, _, _ in PASSIVE}
    groups = {group.get("name") for group in SRDF.findall("group")}
    assert {state.get("group") for state in SRDF.findall("group_state")} == groups
    effector = SRDF.find("end_effector")
    assert effector is not None and effector.get("parent_link") in LINKS and effector.get("group") in groups


def test_named_poses_are_within_the_limits_and_the_linkage() -> None:
    for state in SRDF.findall("group_state"):
        pose = {str(joint.get("name")): float(joint.get("value", "nan")) for joint in state.findall("joint")}
        assert list(pose) == (ARM if state.get("group") == "arm" else ["joint_7"])
        for joint, angle in pose.items():
            low, high = limits(joint)
            assert low <= angle <= high, (state.get("name"), joint)


def test_the_linkage_allows_every_corner_of_the_box() -> None:
    assert set(read("joint_limits.yaml")["joint_limits"]) == set(NAMES)
    for second in limits("joint_2"):
        for third in limits("joint_3"):
            assert abs(math.degrees(second + third)) <= LINKAGE
    for joint in NAMES:
        low, high = limits(joint)
        assert float(attribute(JOINTS[joint], "limit", "lower")) <= low < high
        assert high <= float(attribute(JOINTS[joint], "limit", "upper"))


def test_the_collision_pairs_are_those_of_the_meshes() -> None:
    script = module(ROS / "sevenbot_moveit_config/scripts/collisions.py")
    listed = [(str(row.get("link1")), str(row.get("link2")), str(row.get("reason"))) for row in SRDF.iter("disable_collisions")]
    assert listed == script.pairs()
    # The disc can meet the base, so this pair stays.
    assert all({"base_link", "disc"} != {one, other} for one, other, _ in listed)


def module(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


def test_controllers_of_moveit_are_those_of_ros2_control() -> None:
    moveit = read("moveit_controllers.yaml")["moveit_simple_controller_manager"]
    control = read("controllers.yaml")
    for name in moveit["controller_names"]:
        assert moveit[name]["joints"] == control[name]["ros__parameters"]["joints"]
        assert name in control["controller_manager"]["ros__parameters"]
    assert moveit["arm_controller"]["joints"] == ARM
    assert moveit["claw_controller"]["joints"] == ["joint_7"]
    assert [DEFAULTS[name] for name, _ in CONTROLLERS] == moveit["controller_names"]
    interfaces = {str(each.get("name")) for each in ROBOT.iter("command_interface")}
    assert {each for name in moveit["controller_names"] for each in control[name]["ros__parameters"]["command_interfaces"]} == interfaces
    assert set(read("kinematics.yaml")) == {"arm"}
    assert read("ompl_planning.yaml")["planning_plugins"] == ["ompl_interface/OMPLPlanner"]


@pytest.mark.parametrize("package", ["sevenbot_ros", "sevenbot_moveit_config"])
def test_the_package_as_files(package: str) -> None:
    folder = ROS / package
    manifest = Xml.parse(folder / "package.xml").getroot()
    assert manifest.findtext("name") == package and manifest.get("format") == "3"
    assert all(manifest.findtext(tag) for tag in ("version", "description", "maintainer", "license"))
    for launch in (folder / "launch").glob("*.py"):
        tree = ast.parse(launch.read_text())
        assert any(isinstance(node, ast.FunctionDef) and node.name == "generate_launch_description" for node in tree.body)
        used = {
            word.value.value
            for node in ast.walk(tree)
            if isinstance(node, ast.Call)
            for word in node.keywords
            if word.arg == "package" and isinstance(word.value, ast.Constant)
        }
        depends = {depend.text for depend in manifest.findall("exec_depend")} | {package}
        assert used <= depends, launch
