"""The teleoperator `sevenbot_leader`: an arm without torque that you move by hand."""

import time
from functools import cached_property
from typing import Any

import sevenbot
from lerobot.teleoperators import Teleoperator
from lerobot.utils.decorators import check_if_already_connected, check_if_not_connected

from . import joints
from .config_sevenbot import SevenbotLeaderConfig
from .connection import CALIBRATION, LOGGER, Connection
from .device import Device
from .hand import Hand
from .warned import Warned

HEALTH_PERIOD = 0.1
"""Seconds between two looks at the health of the arm."""
SILENT = ("no answer", "no servo answers")
"""The kinds of problems that matter while the motors are off."""


class SevenbotLeader(Device, Teleoperator):
    """A 7Bot V2 arm, real or simulated, whose measured positions are actions.

    The actions have the keys and scales of the robot `sevenbot`, and are within its limits. So a dataset has the actions that
    the follower can carry out.
    """

    config_class = SevenbotLeaderConfig
    name = "sevenbot_leader"

    def __init__(self, config: SevenbotLeaderConfig) -> None:
        """Opens nothing yet."""
        super().__init__(config)
        self.config = config
        self._hand: Hand | None = None
        self._warned = Warned()
        self._next_check = 0.0

    @cached_property
    def feedback_features(self) -> dict[str, type]:
        """No features: the arm gives no force to the hand."""
        return {}

    def configure(self) -> None:
        """Switches the motors off. A simulated arm gets a hand."""
        connection = self._open()
        if connection.simulation is None:
            LOGGER.warning("Hold the leader: its motors go off now, and it falls without a hand.")
        connection.arm.torque_off()
        if connection.simulation is not None:
            self._hand = Hand(connection.simulation, self.config.hand)
        connection.follow_time()

    @check_if_already_connected
    def connect(self, calibrate: bool = True) -> None:
        """Opens the arm and switches its motors off: hold it."""
        self._connection = Connection(self.config.port, self.config.seed, "--teleop.port")
        try:
            self.configure()
        except BaseException:
            self._close(park=False)
            raise
        arm = self._connection.arm
        LOGGER.info("%s is connected: firmware %s at %s. %s", self, arm.firmware, arm.port, CALIBRATION)

    @check_if_not_connected
    def get_action(self) -> dict[str, float]:
        """Where the leader is, brought within the limits of the follower."""
        connection = self._open()
        if self._hand is not None:
            # Move the hand before time passes, so that the measurement shows where the hand is now.
            self._hand.lead()
        connection.follow_time()
        self._check_health(connection.arm)
        return joints.to_lerobot("pos", joints.within_limits(map(float, self._positions(connection))))

    def _check_health(self, arm: sevenbot.Arm) -> None:
        """Raises `ConnectionError` if a servo stays silent, so that its position is old, or if the motors drive the joints."""
        if time.monotonic() < self._next_check:
            return
        self._next_check = time.monotonic() + HEALTH_PERIOD
        status = arm.status()
        if status is None:
            # The maker's firmware has no status.
            return
        silent = [problem for problem in status.problems if problem.kind in SILENT]
        if silent:
            text = "; ".join(f"{problem}: {problem.remedy}" for problem in silent)
            self._warned.problems(silent, ConnectionError(f"the leader cannot be read: {text}"))
        if status.motor_state == "servo":
            raise ConnectionError("the motors of the leader are on: it restarted, or another program switched them on; connect again")

    @staticmethod
    def _positions(connection: Connection) -> Any:
        try:
            return connection.observe().positions
        except sevenbot.NotServed:
            # The maker's firmware has whole degrees, and no velocities.
            return connection.arm.angles

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Has no effect: see `feedback_features`."""

    def _close(self, *, park: bool) -> None:
        connection, self._connection, self._hand = self._connection, None, None
        if connection is not None:
            connection.close(park=park)

    @check_if_not_connected
    def disconnect(self) -> None:
        """The leader holds, then parks, or goes on holding with `park_on_disconnect=false`. Then it is closed."""
        LOGGER.info("The leader holds now: let it go.")
        self._close(park=self.config.park_on_disconnect)
        LOGGER.info("%s is disconnected.", self)
