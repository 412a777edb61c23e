import sys

import sevenbot

with sevenbot.Arm(*sys.argv[1:2]) as arm:
    arm.pose(60, None, None, None, None, None, None, speed=60)
    while not arm.angles[0] >= 80:
        arm.pose(arm.angles[0] + 6, None, None, None, None, None, None, speed=120)
    arm.pose(100, None, None, None, None, None, None, speed=60)
    if arm.where().tip[2] > 200 and arm.where().tip[0] < 0:
        arm.pose(None, None, None, 110, None, None, None, speed=60)
    if arm.observe().loads[2] < 90:
        arm.pose(None, None, None, None, 110, None, None, speed=60)
    if 2 in arm.status().blocked:
        arm.pose(None, None, None, None, None, 10, None, speed=60)
    else:
        arm.pose(None, None, None, None, None, 120, None, speed=60)
    if not arm.status().joints[6].state == "holds something":
        arm.pose(None, None, None, None, None, None, 50, speed=60)
    if arm.where().tip[1] > 1000:
        arm.pose(None, 10, None, None, None, None, None, speed=60)
