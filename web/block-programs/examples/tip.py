import sys

import sevenbot

with sevenbot.Arm(*sys.argv[1:2]) as arm:
    arm.move_to(-50, 185, 50, speed=60)
    arm.move_to(50, 185, 50, straight=True, speed=80)
    arm.move_to(50, 185, 110, straight=True, speed=40)
    arm.move_to(0, 240, 150, tool=(0, 1, 0), speed=60)
    arm.move_to(40, 240, 150, tool=(0, 1, 0), straight=True, speed=30)
