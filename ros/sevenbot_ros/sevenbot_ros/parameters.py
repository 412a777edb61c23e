"""The parameters of the node, and the settings that they make."""

from __future__ import annotations

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from sevenbot_ros.commands import Rules
from sevenbot_ros.follower import Jump
from sevenbot_ros.joints import NAMES, Limits
from sevenbot_ros.settings import Settings

# Name, default, and meaning.
DECLARED: tuple[tuple[str, object, str], ...] = (
    ("port", "", "serial port; 'sim' for a simulated arm in this process; empty for the only port with an arm"),
    ("id", -1, "number of the arm (register 11); -1 for any"),
    ("chip", "", "chip id of the arm; empty for any"),
    ("rate", 50.0, "states per second, 1 to 200"),
    ("period", 0.02, "seconds between two points of a stream, 0.005 to 1"),
    ("watchdog", 0.3, "the arm holds after this time in seconds without the node, 0.05 to 2.55; the stream ends without commands"),
    ("max_age", 0.5, "oldest stamp of a command in seconds"),
    ("jump", "refuse", "a target that is too far from the last one: 'refuse' or 'approach'"),
    ("max_jump_degrees", 5.0, "the greatest distance of two targets in degrees"),
    ("approach_degrees_per_second", 30.0, "speed of the approach"),
    ("limits.lower", [], "lowest angle of each joint in radians, seven; an empty list takes the arm's own limits"),
    ("limits.upper", [], "highest angle of each joint in radians, seven; an empty list takes the arm's own limits"),
    ("publish_joint_states", True, "publish joint_states; false beside a joint_state_broadcaster"),
    ("follow_joint_trajectory", True, "serve the action FollowJointTrajectory if control_msgs is there; false beside ros2_control"),
    ("controller_name", "arm_controller", "the action is CONTROLLER_NAME/follow_joint_trajectory"),
    ("claw_controller_name", "claw_controller", "the same for an action that takes joint 7 alone"),
    ("frame_prefix", "", "prefix of the names of this arm's frames, the same as in robot_state_publisher"),
    ("mesh_prefix", "", "where the meshes are; empty for this package"),
    ("clock", True, "publish /clock with port 'sim'; false for all simulated arms but one"),
    ("real_time_factor", 1.0, "speed of simulated time"),
    ("seed", 1, "seed of the simulated arm"),
)


class WrongParameter(ValueError):
    """A parameter is out of range."""


def declare(node: Node) -> None:
    """Declares all parameters as read only, so that a change at run time is refused rather than ignored."""
    for name, default, meaning in DECLARED:
        descriptor = ParameterDescriptor(description=meaning, read_only=True)
        # On a command line `1` is an integer, also where a float is expected, and a chip id may look like a number.
        descriptor.dynamic_typing = not isinstance(default, (bool, int))
        node.declare_parameter(name, default, descriptor)


def settings(node: Node) -> Settings:
    """The settings that the parameters make. Raises `WrongParameter` if one is out of range."""

    def value(name: str) -> object:
        return node.get_parameter(name).value

    def number(name: str, low: float, high: float) -> float:
        found = value(name)
        if not isinstance(found, (int, float)) or not low <= found <= high:
            raise WrongParameter(f"{name} is {found}: it has to be {low:g} to {high:g}")
        return float(found)

    return Settings(
        port=str(value("port")),
        id=int(number("id", -1, 255)),
        chip=str(value("chip")),
        rate=number("rate", 1, 200),
        period=number("period", 0.005, 1),
        watchdog=number("watchdog", 0.05, 2.55),
        jump=_jump(str(value("jump"))),
        max_jump=number("max_jump_degrees", 0.1, 180),
        approach_speed=number("approach_degrees_per_second", 1, 190),
        real_time_factor=number("real_time_factor", 0.01, 100),
        seed=int(number("seed", 0, 2**63 - 1)),
        rules=Rules(limits=_limits(value("limits.lower"), value("limits.upper")), max_age=number("max_age", 0.01, 60)),
    )


def _jump(text: str) -> Jump:
    try:
        return Jump(text)
    except ValueError:
        raise WrongParameter(f"jump is '{text}': it has to be 'refuse' or 'approach'") from None


def _limits(low: object, high: object) -> Limits:
    sides = [list(side) if side is not None else [] for side in (low, high)]  # type: ignore[call-overload]
    for side in sides:
        if len(side) not in (0, len(NAMES)):
            raise WrongParameter(f"limits.lower and limits.upper have {len(NAMES)} numbers each, or none")
    return Limits.of_arm().within(*sides)
