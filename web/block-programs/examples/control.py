import sys

import sevenbot

angle = 0
count = 0

with sevenbot.Arm(*sys.argv[1:2]) as arm:
    angle = 90
    for _ in range(3):
        angle += 10
        arm.pose(angle, None, None, None, None, None, None, speed=120)
    count = 0
    while True:
        count += 1
        if count % 2 == 0:
            continue
        if count > 6:
            break
        arm.pose(None, 90 - count * 2, None, None, None, None, None, speed=120)
    while not (angle <= 100 or not (True and count != 99)):
        angle += -5
    if angle < 50:
        arm.pose(None, None, None, 50, None, None, None, speed=60)
    elif angle >= 100:
        arm.pose(None, None, None, angle + 45 / 2, None, None, None, speed=60)
    else:
        arm.pose(None, None, None, 30, None, None, None, speed=60)
    arm.pose(None, None, None, None, 10 ** 2, None, None, speed=60)
