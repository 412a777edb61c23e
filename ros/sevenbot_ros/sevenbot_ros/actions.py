"""What the services do. A call returns when its work is done. The thread of the driver measures the arm meanwhile.

Knows no ROS.
"""

from __future__ import annotations

from contextlib import suppress

import sevenbot

from sevenbot_ros.driver import Driver

# The standard pose in degrees, and the speed to it in degrees a second.
HOME = (90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0)
HOME_SPEED = 19.0
# The longest move, in seconds of the arm's clock, and the time between two checks of its status.
LONGEST_MOVE = 30.0
LOOK = 0.1
# A target may be rounded to a degree.
ROUNDING = 1.0


def stop(driver: Driver) -> str:
    """Hold at once, and refuse commands until `hold`."""
    targets = driver.interlock.stop("the arm was stopped")
    return f"the joints hold at {' '.join(f'{angle:g}' for angle in targets)} degrees"


def hold(driver: Driver) -> str:
    """Hold where the joints are, with torque, and take commands again."""
    stop_count = driver.interlock.stop_count
    with driver.action() as arm:
        if _is_driven(arm):
            arm.stop()
        else:
            arm.torque_on()
        driver.interlock.release(stop_count)
    return "the joints hold, and commands are taken"


def home(driver: Driver) -> str:
    """Move to the standard pose, then restore the speeds. The driver's thread lets time pass, also for a simulated arm."""
    with driver.motion() as arm:
        speeds = arm.get("speed")
        try:
            arm.pose(HOME, speed=HOME_SPEED, wait=False)
            _arrive(driver, arm)
        except sevenbot.NotReached:
            # Otherwise the other joints go on moving, at the speeds that are restored below.
            with suppress(sevenbot.Error):
                arm.stop()
            raise
        finally:
            arm.set("speed", speeds)
    return "the arm stands in the standard pose"


def _arrive(driver: Driver, arm: sevenbot.Arm) -> None:
    end = driver.now() + LONGEST_MOVE
    away: list[str] = []
    while driver.now() < end:
        driver.interlock.wait(LOOK)
        status = arm.status()
        if status is None:
            return
        if any(abs(joint.target - angle) > ROUNDING for joint, angle in zip(status.joints, HOME, strict=True)):
            raise sevenbot.Interrupted("the arm got other targets on its way")
        if status.problems:
            raise sevenbot.NotReached("; ".join(f"{problem}" for problem in status.problems))
        away = [f"{joint.joint}" for joint in status.joints if not joint.is_at_target]
        if not away:
            return
    joints = ", ".join(away)
    raise sevenbot.NotReached(f"not at the standard pose after {LONGEST_MOVE:g} s: joints {joints}: call home again")


def park(driver: Driver) -> str:
    """Move to the park pose, let go, and see that the arm stays. Commands are refused until `hold`."""
    with driver.motion() as arm:
        arm.park()
        driver.interlock.halt("the arm is parked")
    return "the arm is parked, its motors are damped"


def torque(driver: Driver, on: bool) -> str:
    """Hold with torque and take commands, or let go: then a hand has to hold the arm."""
    if on:
        return hold(driver)
    with driver.action() as arm:
        driver.interlock.halt("the motors are off")
        arm.torque_off()
    return "the motors are off"


def vacuum(driver: Driver, on: bool) -> str:
    """Switch the pump."""
    driver.arm().set("vacuum-pump", int(on))
    return "the pump sucks" if on else "the pump is off"


def _is_driven(arm: sevenbot.Arm) -> bool:
    return bool(arm.get("motor-state") == 1)
