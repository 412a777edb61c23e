import sys

import sevenbot

with sevenbot.Arm(*sys.argv[1:2]) as arm:
    arm.set("effector-type", 1)
    arm.pose(None, None, None, None, None, None, 84)
    arm.set("vacuum-pump", 1)
    arm.sleep(0.3)
    arm.set("effector-type", 1)
    arm.pose(None, None, None, None, None, None, 0)
    arm.set("vacuum-pump", 0)
    arm.pose(70, None, None, None, None, None, None, speed=60)
