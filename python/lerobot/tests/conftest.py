"""Fixtures for the tests of the plugin."""

import importlib.util
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
HAS_TORCH = importlib.util.find_spec("torch") is not None
# LeRobot's base classes alone need no torch, but name it.
if not HAS_TORCH:
    sys.path.append(str(HERE / "stubs"))


@pytest.fixture(autouse=True)
def calibration_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets LeRobot make its folder for calibrations in a temporary folder, not in the home of the user."""
    for module in ("lerobot.robots.robot", "lerobot.teleoperators.teleoperator"):
        monkeypatch.setattr(f"{module}.HF_LEROBOT_CALIBRATION", tmp_path / "calibration")


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The clock of the plugin in seconds, as a list of one number. A sleep advances it, and so may a test."""
    clock = [1000.0]

    def sleep(seconds: float) -> None:
        clock[0] += seconds

    for module in ("connection", "follower", "hand", "warned", "action_log"):
        monkeypatch.setattr(f"lerobot_robot_sevenbot.{module}.time.monotonic", lambda: clock[0])
    monkeypatch.setattr("lerobot_robot_sevenbot.connection.time.sleep", sleep)
    return clock
