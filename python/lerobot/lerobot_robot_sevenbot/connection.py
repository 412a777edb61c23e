"""An arm from `connect` to `disconnect`: a real one, or a simulated one whose time is that of the wall clock."""

import logging
import time

import sevenbot

LOGGER = logging.getLogger(__package__)
CALIBRATION = (
    "the calibration of a 7Bot is in the arm, in its registers offset.1 to offset.7, and not in a file here: "
    "`sevenbot calibrate` changes it"
)
START_UP = 1.0
"""The arm needs this time after power-up, in seconds."""


class SimulatedTime:
    """Keeps the virtual time of a simulated arm at the wall clock, because LeRobot's loops sleep by the wall clock."""

    def __init__(self, arm: sevenbot.SimulatedArm) -> None:
        """The two clocks begin now."""
        self._arm = arm
        self._wall, self._virtual = time.monotonic(), arm.simulation.now

    def follow(self) -> None:
        """Advances the simulation to the wall clock. If the simulation is ahead, sleeps until the wall clock has caught up."""
        passed = self._arm.simulation.now - self._virtual
        behind = time.monotonic() - self._wall - passed
        if behind > 0:
            # Whole microseconds: the resolution of the virtual time.
            self._arm.simulation.advance(round(behind, 6))
        else:
            time.sleep(-behind)


class Connection:
    """An open arm."""

    def __init__(self, port: str | None, seed: int, option: str) -> None:
        """Opens the port, or a simulated arm for `sim`. `option` is the name of LeRobot's option, for errors."""
        self._time: SimulatedTime | None = None
        self.simulation: sevenbot.Simulation | None = None
        self.arm: sevenbot.Arm
        if port == "sim":
            simulated = sevenbot.Arm.simulated(seed)
            simulated.sleep(START_UP)
            self.arm, self.simulation = simulated, simulated.simulation
            self._time = SimulatedTime(simulated)
        else:
            self.arm = self._open(port, option)
        self.arm.progress = False

    @staticmethod
    def _open(port: str | None, option: str) -> sevenbot.Arm:
        try:
            return sevenbot.Arm(port)
        except sevenbot.PortError as error:
            error.add_note(f"{option}=PORT names the port of the arm, and {option}=sim is a simulated arm")
            raise

    def follow_time(self) -> None:
        """Brings a simulated arm to the wall clock. Call it before each exchange."""
        if self._time is not None:
            self._time.follow()

    def observe(self) -> sevenbot.Observation:
        """One read of all joints."""
        self.follow_time()
        observed = self.arm.observe()
        unknown = [index for index, angle in enumerate(observed.positions, start=1) if angle != angle]
        if unknown:
            raise ConnectionError(
                f"joint {unknown[0]} was not measured since power-up: check the plugs and the cable of its servo"
            )
        return observed

    def close(self, *, park: bool) -> None:
        """Parks the arm, or makes it hold, and closes the port. Logs what fails: LeRobot has more to end after this."""
        try:
            self.follow_time()
            if park:
                LOGGER.info("The arm goes to its park pose: keep clear.")
                if self.arm.get("motor-state") != 1:
                    self.arm.torque_on()
                self.arm.park()
            elif self.arm.get("motor-state") == 1:
                self.arm.stop()
            else:
                self.arm.torque_on()
            self.follow_time()
        except sevenbot.Error as error:
            LOGGER.error("The arm is not %s: %s", "parked" if park else "held", error)
        finally:
            self.arm.close()
