"""What follower and leader have in common: a connection, the keys of actions, and a calibration that is in the arm."""

from functools import cached_property

from . import joints
from .connection import CALIBRATION, LOGGER, Connection


class Device:
    """What the robot and the teleoperator for LeRobot have in common."""

    _connection: Connection | None = None

    @cached_property
    def action_features(self) -> dict[str, type]:
        """The keys of an action."""
        return dict.fromkeys(joints.keys("pos"), float)

    @property
    def is_connected(self) -> bool:
        """Is the arm open?"""
        return self._connection is not None

    @property
    def is_calibrated(self) -> bool:
        """Always: the calibration is in the arm, in its registers `offset`."""
        return True

    def calibrate(self) -> None:
        """Has nothing to do, and tells where the calibration is."""
        LOGGER.info(CALIBRATION)

    def _open(self) -> Connection:
        if self._connection is None:
            raise ConnectionError(f"{self} is not connected: call connect()")
        return self._connection
