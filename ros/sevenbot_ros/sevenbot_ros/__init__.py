"""A 7Bot V2 arm as a robot of ROS 2: `ros2 run sevenbot_ros arm`, or `python -m sevenbot_ros`.

The modules `joints`, `commands`, `follower`, `trajectory` and `health` decide without ROS and without an arm. `driver` owns the arm, and
`node` is what ROS sees.
"""
