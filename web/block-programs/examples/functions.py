import sys

import sevenbot

height = 0


def turn(angle):
    arm.pose(angle, None, None, None, None, None, None, speed=60)
    if angle > 100:
        return
    arm.pose(None, 100, None, None, None, None, None, speed=60)


def lift():
    global height
    height += 75


def sum(n):
    if n <= 1:
        return 1
    return n + sum(n - 1)


with sevenbot.Arm(*sys.argv[1:2]) as arm:
    turn(110)
    lift()
    arm.pose(None, None, sum(10), None, None, None, None, speed=60)
    arm.pose(None, None, None, height, None, None, None, speed=60)
