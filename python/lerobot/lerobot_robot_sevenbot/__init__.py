"""The 7Bot V2 arm for LeRobot: the robot `sevenbot` and the teleoperator `sevenbot_leader`.

`lerobot-record`, `lerobot-replay` and `lerobot-teleoperate` import this package by its name, and find both types.
"""

from .config_sevenbot import SevenbotConfig, SevenbotLeaderConfig
from .follower import Sevenbot
from .leader import SevenbotLeader

__all__ = ["Sevenbot", "SevenbotConfig", "SevenbotLeader", "SevenbotLeaderConfig"]
