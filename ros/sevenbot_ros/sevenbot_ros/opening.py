"""Opens the arm that the settings name, and tells where its joints stand."""

from __future__ import annotations

import sevenbot

from sevenbot_ros.clocks import Clock, RealClock, SimulatedClock
from sevenbot_ros.settings import Settings

# The name of the port that means a simulated arm in this process.
SIMULATOR = "sim"
# The time after power-up until the arm has measured its joints, in seconds.
START_UP = 1.0
# The speed registers also limit a stream. This is their value after power-up, in steps of 1.9 degrees a second. Another
# program may have left a lower one.
SPEED = 60


def open_arm(settings: Settings) -> tuple[sevenbot.Arm, Clock]:
    """Opens an arm, and returns it with its clock. Raises `sevenbot.Error`."""
    if settings.port == SIMULATOR:
        simulated = sevenbot.Arm.simulated(settings.seed)
        simulated.sleep(START_UP)
        return simulated, SimulatedClock(simulated, settings.real_time_factor)
    arm = sevenbot.Arm(
        settings.port or None,
        id=settings.id if settings.id >= 0 else None,
        chip=settings.chip or None,
    )
    try:
        arm.set("speed", [SPEED] * 7)
    except BaseException:
        arm.close()
        raise
    return arm, RealClock()


def standing(arm: sevenbot.Arm) -> tuple[float, ...]:
    """The targets of the joints in degrees. The joints stand there, apart from the bending under load."""
    status = arm.status()
    if status is None:
        raise sevenbot.NotServed("streams need the firmware of this project")
    return tuple(joint.target for joint in status.joints)
