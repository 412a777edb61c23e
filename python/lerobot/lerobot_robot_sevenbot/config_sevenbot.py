"""The options of the follower and of the leader, as `--robot.NAME` and `--teleop.NAME` of LeRobot's commands."""

from dataclasses import dataclass, field
from pathlib import Path

from lerobot.cameras import CameraConfig
from lerobot.robots import RobotConfig
from lerobot.teleoperators import TeleoperatorConfig


def check_range(name: str, value: float | None, low: float, high: float) -> None:
    """Raises `ValueError` if an option is out of range, or no number."""
    if value is not None and not low <= value <= high:
        raise ValueError(f"{name}={value:g} is out of range: use {low:g} to {high:g}")


@RobotConfig.register_subclass("sevenbot")
@dataclass
class SevenbotConfig(RobotConfig):
    """The follower: an arm that goes where the actions tell."""

    # Serial port, `tcp://HOST:PORT` of `sevenbot serve`, or `sim`: a simulated arm. None: the only arm that answers.
    port: str | None = None
    # Cameras by name. An arm without one is complete.
    cameras: dict[str, CameraConfig] = field(default_factory=dict)
    # The rate of LeRobot's loop: what `--dataset.fps` or `--fps` says. The arm interpolates between actions of this rate.
    fps: int = 30
    # Observe velocities, in degrees per second.
    velocities: bool = False
    # Observe loads, in percent of the stall torque.
    loads: bool = False
    # The largest change of a joint from one action to the next, in degrees. None: no limit but the arm's speed.
    max_step: float | None = None
    # The mean speed of the fastest joint on the way to the first action, in degrees per second.
    approach_speed: float = 30.0
    # The arm holds if no action and no read comes for this time, in seconds.
    watchdog: float = 0.5
    # Go to the park pose at the end, and switch the motors to damping. False: hold where the arm is.
    park_on_disconnect: bool = True
    # A CSV file for what was sent and measured at each action.
    log: Path | None = None
    # For `port=sim`: which simulated arm.
    seed: int = 1

    def __post_init__(self) -> None:
        """Checks the ranges."""
        super().__post_init__()
        check_range("fps", self.fps, 1, 200)
        check_range("max_step", self.max_step, 0.01, 180)
        check_range("approach_speed", self.approach_speed, 1, 100)
        check_range("watchdog", self.watchdog, 0.05, 2.55)


@TeleoperatorConfig.register_subclass("sevenbot_leader")
@dataclass
class SevenbotLeaderConfig(TeleoperatorConfig):
    """The leader: an arm without torque that you move by hand."""

    # As `port` of the follower. `sim` is a simulated arm that a simulated hand leads.
    port: str | None = None
    # At the end hold, then go to the park pose and switch the motors to damping. False: hold where the arm is.
    park_on_disconnect: bool = True
    # For `port=sim`: a recording of `sevenbot record` that the hand follows. None: it waves.
    hand: Path | None = None
    # For `port=sim`: which simulated arm.
    seed: int = 2
