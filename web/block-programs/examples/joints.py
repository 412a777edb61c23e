import sys

import sevenbot

with sevenbot.Arm(*sys.argv[1:2]) as arm:
    arm.pose(120, None, None, None, None, None, None, speed=60)
    arm.pose(None, 80.5, None, None, None, None, None, speed=30)
    arm.pose(60, 95, 70, 100, 80, 120, 40, duration=1.5)
    arm.sleep(0.5)
    arm.pose(None, None, None, None, None, 45, None, speed=190)
