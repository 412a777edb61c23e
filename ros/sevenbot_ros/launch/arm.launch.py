"""The arm and its frames: `ros2 launch sevenbot_ros arm.launch.py port:=sim`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from sevenbot_ros import description

COMMANDS, STATES = "robot_joint_command", "robot_joint_states"


def generate_launch_description() -> LaunchDescription:
    namespace, port, prefix = (LaunchConfiguration(name) for name in ("namespace", "port", "frame_prefix"))
    simulated = LaunchConfiguration("use_sim_time")
    model = description.urdf(commands=COMMANDS, states=STATES, meshes=description.meshes())
    return LaunchDescription(
        [
            DeclareLaunchArgument("port", default_value="", description="serial port, or sim"),
            DeclareLaunchArgument("namespace", default_value="", description="namespace of this arm"),
            DeclareLaunchArgument("frame_prefix", default_value="", description="prefix of the names of its frames, as left/"),
            DeclareLaunchArgument("use_sim_time", default_value="false", description="true with port:=sim"),
            Node(
                package="sevenbot_ros",
                executable="arm",
                namespace=namespace,
                output="screen",
                parameters=[{"port": port, "frame_prefix": prefix}],
            ),
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                namespace=namespace,
                parameters=[
                    {
                        "robot_description": ParameterValue(model, value_type=str),
                        "frame_prefix": prefix,
                        "use_sim_time": ParameterValue(simulated, value_type=bool),
                    }
                ],
                # The node of the arm publishes the description, too.
                remappings=[("robot_description", "robot_state_publisher/robot_description")],
            ),
        ]
    )
