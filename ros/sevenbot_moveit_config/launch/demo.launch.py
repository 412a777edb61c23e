"""The arm, ros2_control, MoveIt and RViz: `ros2 launch sevenbot_moveit_config demo.launch.py port:=sim use_sim_time:=true`."""

from pathlib import Path

import yaml
from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from sevenbot_ros import description

CONTROLLERS = ("joint_state_broadcaster", "arm_controller", "claw_controller")
TOPICS = {"commands": "/robot_joint_command", "states": "/robot_joint_states"}


def generate_launch_description() -> LaunchDescription:
    config = Path(get_package_share_directory("sevenbot_moveit_config")) / "config"

    def read(name: str) -> dict[str, object]:
        return dict(yaml.safe_load((config / name).read_text()))

    simulated = {"use_sim_time": ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)}
    model = {"robot_description": description.urdf(**TOPICS, meshes=description.meshes())}
    semantic = {"robot_description_semantic": (config / "7bot_v2.srdf").read_text()}
    kinematics = {"robot_description_kinematics": read("kinematics.yaml")}
    limits = {"robot_description_planning": read("joint_limits.yaml")}
    planning = {"planning_pipelines": ["ompl"], "default_planning_pipeline": "ompl", "ompl": read("ompl_planning.yaml")}
    moveit = [model, semantic, kinematics, limits, planning, read("moveit_controllers.yaml"), simulated]
    arm = Node(
        package="sevenbot_ros",
        executable="arm",
        output="screen",
        # ros2_control publishes joint_states and serves the trajectories.
        parameters=[
            {"port": LaunchConfiguration("port"), "publish_joint_states": False, "follow_joint_trajectory": False}
        ],
        remappings=[("robot_description", "sevenbot/robot_description")],
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument("port", default_value="", description="serial port, or sim"),
            DeclareLaunchArgument("use_sim_time", default_value="false", description="true with port:=sim"),
            arm,
            Node(package="robot_state_publisher", executable="robot_state_publisher", parameters=[model, simulated]),
            Node(
                package="controller_manager",
                executable="ros2_control_node",
                parameters=[str(config / "controllers.yaml"), simulated],
                output="screen",
            ),
            *(Node(package="controller_manager", executable="spawner", arguments=[name]) for name in CONTROLLERS),
            Node(package="moveit_ros_move_group", executable="move_group", parameters=moveit, output="screen"),
            Node(package="rviz2", executable="rviz2", parameters=[model, semantic, kinematics, limits, simulated]),
        ]
    )
