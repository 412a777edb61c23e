"""What a user sets: which arm, how it is measured, and how it follows commands."""

from __future__ import annotations

from dataclasses import dataclass, field

from sevenbot_ros.commands import Rules
from sevenbot_ros.follower import Jump


@dataclass(frozen=True)
class Settings:
    """What the parameters of the node say. Times are seconds, angles degrees."""

    port: str = ""
    id: int = -1
    chip: str = ""
    rate: float = 50.0
    period: float = 0.02
    watchdog: float = 0.3
    jump: Jump = Jump.REFUSE
    max_jump: float = 5.0
    approach_speed: float = 30.0
    real_time_factor: float = 1.0
    seed: int = 1
    rules: Rules = field(default_factory=Rules)
