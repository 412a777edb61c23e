"""A 7Bot V2 arm as a robot of ROS 2: `ros2 run sevenbot_ros arm`, or `python -m sevenbot_ros`.

The modules `joints`, `commands`, `follower`, `trajectory`, `lead` and `health` decide without ROS and without an arm. `interlock`
tells whether the arm may move, `streamer` moves it, `monitor` measures it, and `driver` joins them. `actions` are what services do, and
`node` is what ROS sees.
"""
