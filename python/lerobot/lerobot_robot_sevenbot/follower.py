"""The robot `sevenbot`: an arm that goes where the actions tell."""

import time
from functools import cached_property
from typing import Any, SupportsFloat

import sevenbot
from lerobot.cameras import make_cameras_from_configs
from lerobot.robots import Robot
from lerobot.utils.decorators import check_if_already_connected, check_if_not_connected

from . import joints
from .action_log import ActionLog
from .config_sevenbot import SevenbotConfig
from .connection import CALIBRATION, LOGGER, Connection
from .device import Device
from .warned import Warned

SPEED = 60
"""For the speed registers, in steps of 1.9 degrees per second. They limit a stream, and a program may have left them low."""
SHORTEST_APPROACH, LONGEST_APPROACH = 0.1, 60.0
"""The times for an approach that `Arm.stream` accepts, in seconds."""
TOLERANCE = 0.5
"""A smaller change of an action is not worth a warning, in degrees: a measured angle may be this far outside."""


class Sevenbot(Device, Robot):
    """A 7Bot V2 arm, real or simulated.

    Actions and observations have `joint_1.pos` to `joint_6.pos` in degrees, 0 to 180, and `claw.pos` from 0 (closed) to 100
    (open). With the options `velocities` and `loads` an observation has `.vel` (degrees or percent per second) and `.load`
    (percent of the stall torque, positive if the motor pushes towards greater angles), too.
    """

    config_class = SevenbotConfig
    name = "sevenbot"

    def __init__(self, config: SevenbotConfig) -> None:
        """Opens nothing yet."""
        super().__init__(config)
        self.config = config
        self.cameras: dict[str, Any] = make_cameras_from_configs(config.cameras)
        self._stream: sevenbot.Stream | None = None
        self._log = ActionLog(None)
        self._warned = Warned()
        self._last: joints.Angles = []
        self._last_time = 0.0
        self._is_behind = False

    @property
    def _kinds(self) -> dict[str, bool]:
        return {"pos": True, "vel": self.config.velocities, "load": self.config.loads}

    @cached_property
    def observation_features(self) -> dict[str, Any]:
        """The keys of an observation: numbers, and the shapes of the cameras' images."""
        numbers = {key: float for kind, is_on in self._kinds.items() if is_on for key in joints.keys(kind)}
        images = {name: (camera.height, camera.width, 3) for name, camera in self.cameras.items()}
        return {**numbers, **images}

    def configure(self) -> None:
        """Makes the motors hold, with the speeds of power-up. An arm that was parked is driven again."""
        self._open().arm.torque_on()
        self._open().arm.set("speed", [SPEED] * 7)
        self._open().follow_time()

    @check_if_already_connected
    def connect(self, calibrate: bool = True) -> None:
        """Opens the arm and the cameras. The arm holds where it is. If one fails, all are closed again."""
        self._connection = Connection(self.config.port, self.config.seed, "--robot.port")
        try:
            self.configure()
            for camera in self.cameras.values():
                camera.connect()
            self._log = ActionLog(self.config.log)
        except BaseException:
            self._close(park=False)
            raise
        arm = self._connection.arm
        LOGGER.info("%s is connected: firmware %s at %s. %s", self, arm.firmware, arm.port, CALIBRATION)

    @check_if_not_connected
    def get_observation(self) -> dict[str, Any]:
        """Positions, what the options add, and the cameras' images."""
        observed = self._open().observe()
        values = {"pos": observed.positions, "vel": observed.velocities, "load": observed.loads}
        observation: dict[str, Any] = {}
        for kind, is_on in self._kinds.items():
            if is_on:
                observation |= joints.to_lerobot(kind, values[kind])
        self._log.observed(observed.positions)
        return observation | {name: camera.read_latest() for name, camera in self.cameras.items()}

    @check_if_not_connected
    def send_action(self, action: dict[str, SupportsFloat]) -> dict[str, float]:
        """Sends an action, and returns what the arm got: within its limits, and within `max_step` of the action before.

        The first action, and the first after a pause longer than the watchdog's time, is approached slowly: the call takes as
        long. If the leader went on meanwhile, the arm catches up at the same speed. Later actions are points of a stream: the
        arm goes through them at the speed of the loop.
        """
        connection = self._open()
        wanted = joints.to_angles(action)
        angles = joints.within_limits(wanted)
        connection.follow_time()
        if self._stream is not None and time.monotonic() - self._last_time > self.config.watchdog:
            self._end_stream()
        if self._stream is not None and self.config.max_step is not None:
            angles = joints.within_limits(joints.within_step(angles, self._last, self.config.max_step))
        self._tell_change(wanted, angles)
        angles = self._caught_up(angles)
        self._send(connection, angles)
        # The approach of a simulated arm takes no real time. Without this wait, the approach would count as a pause before the next
        # action.
        connection.follow_time()
        self._last, self._last_time = angles, time.monotonic()
        self._log.sent(angles, connection.simulation)
        return joints.to_lerobot("pos", angles)

    def _caught_up(self, angles: joints.Angles) -> joints.Angles:
        """Limits the steps after an approach, until the arm has caught up with the leader, who went on meanwhile."""
        if self._stream is None or not self._is_behind:
            return angles
        step = self.config.approach_speed / self.config.fps
        nearer = joints.towards(angles, self._last, step)
        self._is_behind = bool(joints.differing(nearer, angles, 0.01))
        return nearer

    def _tell_change(self, wanted: joints.Angles, angles: joints.Angles) -> None:
        changed = joints.differing(wanted, angles, TOLERANCE)
        if changed:
            self._warned.once(
                f"changed {changed}",
                f"An action for {', '.join(changed)} is beyond the arm's limits or max_step: the arm gets the nearest "
                "allowed one. A dataset that lerobot-record writes has the action as it was before.",
            )

    def _send(self, connection: Connection, angles: joints.Angles) -> None:
        point = [round(angle, 2) for angle in angles]
        try:
            if self._stream is None:
                self._stream = self._begin_stream(connection, point)
            self._stream.send(point)
        except sevenbot.ArmProblem as problem:
            # The next action tries again. The firmware limits the push of a joint that stalls.
            self._warned.problem(problem)

    def _begin_stream(self, connection: Connection, point: joints.Angles) -> sevenbot.Stream:
        positions = connection.observe().positions
        way = max(abs(angle - float(there)) for angle, there in zip(point, positions, strict=True))
        seconds = way / self.config.approach_speed
        stream = connection.arm.stream(
            int(1000 / self.config.fps) / 1000,
            watchdog=self.config.watchdog,
            approach=min(max(seconds, SHORTEST_APPROACH), LONGEST_APPROACH),
        )
        stream.__enter__()
        self._is_behind = True
        return stream

    def _end_stream(self) -> None:
        stream, self._stream = self._stream, None
        if stream is None:
            return
        try:
            stream.__exit__(None, None, None)
        except (sevenbot.ArmProblem, sevenbot.NotReached) as error:
            LOGGER.warning("At the end of the motion: %s", error)

    def _close(self, *, park: bool) -> None:
        connection, self._connection = self._connection, None
        try:
            self._end_stream()
        except sevenbot.Error as error:
            LOGGER.error("The stream of actions does not end: %s", error)
        finally:
            if connection is not None:
                connection.close(park=park)
            self._log.close()
            for camera in self.cameras.values():
                if camera.is_connected:
                    camera.disconnect()

    @check_if_not_connected
    def disconnect(self) -> None:
        """Parks the arm, or makes it hold with `park_on_disconnect=false`, and closes it and the cameras."""
        self._close(park=self.config.park_on_disconnect)
        LOGGER.info("%s is disconnected.", self)
