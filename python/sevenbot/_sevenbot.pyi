"""Types of the compiled module. The docstrings are those of the module: a test compares them."""

from collections.abc import Iterable, Iterator
from os import PathLike
from types import TracebackType
from typing import Any, ClassVar, Literal, SupportsIndex, TypeAlias, TypeVar, final, overload

from numpy import float32, float64
from numpy.typing import ArrayLike, NDArray
from typing_extensions import Self, disjoint_base

__all__ = [
    "Arm",
    "ArmProblem",
    "BadRecording",
    "Closed",
    "Error",
    "FileError",
    "GuardWarning",
    "Interrupted",
    "InvalidType",
    "InvalidValue",
    "JointStatus",
    "MayMove",
    "NoAnswer",
    "NotDriven",
    "NotReached",
    "NotServed",
    "NotTaken",
    "Observation",
    "OutOfReach",
    "OutsideGuard",
    "PortError",
    "Problem",
    "Recording",
    "Registers",
    "SimulatedArm",
    "SimulatedArms",
    "Simulation",
    "SimulationSnapshot",
    "Status",
    "Stream",
    "StreamCounts",
    "Tip",
    "TooFar",
    "UnknownRegister",
    "__version__",
    "forward",
    "inverse",
    "limits",
    "model",
    "ports",
]

__version__: str

_Angles: TypeAlias = tuple[float, float, float, float, float, float, float]
_Vector: TypeAlias = tuple[float, float, float]
_Goal: TypeAlias = float | None
# A list, a tuple, an array: whatever has an order.
_Goals: TypeAlias = Iterable[_Goal]
# A number, a text, or a list of them, as the name tells: a type checker cannot know.
_Value: TypeAlias = Any
_Map: TypeAlias = Literal["2.1", "2.2"]
_Path: TypeAlias = str | PathLike[str]
_T = TypeVar("_T")
_Numbers = TypeVar("_Numbers", NDArray[float32], NDArray[float64])

class Error(Exception):
    """A failure of this package. `hints` is a tuple of texts: what to try, the most likely cause first. `recording` is what `Arm.record` had recorded before it, or `None`."""
    hints: tuple[str, ...]
    recording: Recording | None

class PortError(Error):
    """The port cannot be opened, has no arm, or failed."""
class NoAnswer(PortError):
    """The arm does not answer."""
class NotTaken(Error):
    """The arm did not take a value. The message tells why."""
class NotReached(Error):
    """Joints did not reach their targets, or still move."""
class ArmProblem(NotReached):
    """The arm does not carry out a move: a joint is blocked, let go or silent, the servos have no supply, or the controller restarted. `problems` is a tuple of `Problem`, `joints` the numbers of their joints, `hints` what to do."""
    problems: tuple[Problem, ...]
    joints: tuple[int, ...]

class NotDriven(Error):
    """The motors do not drive the joints: `arm.set('motor-state', 1)` switches them on."""
class MayMove(Error):
    """It is unknown whether the arm took a command, so it may be moving."""
class OutOfReach(Error):
    """No joint angles reach the position."""
class TooFar(Error):
    """The first point of a stream or a recording is far from where the arm stands."""
class OutsideGuard(Error):
    """The move would take the arm below the table or into its base."""
class NotServed(Error):
    """The arm's firmware does not have this function."""
class BadRecording(Error):
    """A text is not a recording, or the arm cannot play it."""
class Interrupted(Error):
    """Another thread stopped the arm during this call."""
class Closed(Error):
    """The arm is closed, or the stream is."""
class InvalidValue(Error, ValueError):
    """A value is out of range, or does not fit the others. Also a `ValueError`."""
class InvalidType(Error, TypeError):
    """An argument is of the wrong kind, or does not go with another one. Also a `TypeError`."""
class UnknownRegister(Error, KeyError):
    """There is no register of this name. Also a `KeyError`."""
class FileError(Error, OSError):
    """A file cannot be read or written. Also the `OSError` of Python for the reason, such as `FileNotFoundError`."""
class GuardWarning(UserWarning):
    """Joints were sent below the table or into the base of the arm."""

@overload
def forward(angles: Iterable[float], /) -> Tip:
    """Where an arm is whose seven angles are these, in degrees: forward kinematics. The same as `Tip.of`."""
@overload
def forward(
    angle1: float,
    angle2: float,
    angle3: float,
    angle4: float,
    angle5: float,
    angle6: float,
    angle7: float,
    /,
) -> Tip: ...
def inverse(
    x: float, y: float, z: float, *, tool: Iterable[float] | None = None
) -> NDArray[float64]:
    """The angles of joints 1 to 5 in degrees that bring the tip to x, y, z in millimetres, with the tool in this direction, by
    default straight down: inverse kinematics. With numpy an array.

    Raises `OutOfReach` with the nearest point within reach. It ignores the table and the base, which `Arm.move_to` avoids.
    """
def limits() -> tuple[NDArray[float64], NDArray[float64]]:
    """The smallest and the largest angles of joints 1 to 7 in degrees: two arrays with numpy, or tuples.

    The linkage keeps joints 2 and 3 together: joint 2 + joint 3 - 65 is 19 to 161.
    """
def model(format: Literal["urdf", "mjcf"]) -> str:
    """The model of the arm for other programs, as text: `"urdf"`, or `"mjcf"` for MuJoCo, where the parallelogram is a closed loop.

    The same as `sevenbot model`. Lengths are metres and angles radians; a joint's angle is the register's angle less 90, 90, 65,
    90, 90, 90 degrees. The claw, joint 7, is left out.
    """
def ports(baud: int = 115200) -> list[tuple[str, str, int, str, str]]:
    """The arms of this machine: port, description, device id (register 11), firmware version and `chip_id`. Their ports are serial
    ports, or servers of this user (`sevenbot serve`).

    Asks all ports at the same time, at `baud` bits per second, for about half a second.
    """

@disjoint_base
class Arm:
    """A 7Bot V2 arm.

    `Arm("/dev/ttyUSB0")` opens a port, `Arm("tcp://HOST:PORT", token="...")` connects to a server, `Arm()` opens the only port with
    an arm that answers, `Arm(id=5)` the port of the arm with this number (register 11), `Arm(chip="...")` that of the arm with this `chip_id`,
    and `Arm.simulated()` is an arm in virtual time. All have the same methods. `with Arm() as arm:` stops what moves at the
    end, as `stop()`, and closes the port.

    Angles are degrees, 0 to 180, joint 1 first; positions millimetres; times seconds.
    """
    def __new__(
        cls,
        port: _Path | None = None,
        *,
        id: int | None = None,
        chip: str | None = None,
        token: str | None = None,
        baud: int = 115200,
        timeout: float = 0.5,
        attempts: int = 3,
        map: _Map | None = None,
    ) -> Self: ...
    @classmethod
    def simulated(
        cls,
        seed: int = 1,
        *,
        timeout: float = 0.5,
        attempts: int = 3,
        map: _Map | None = None,
    ) -> SimulatedArm:
        """An arm in virtual time. The same calls give the same values on every machine.

        `seed` determines the random faults of the host line, 0 to 2**64 - 1. `attempts` and `timeout` are as for a port.
        """
    @property
    def simulation(self) -> Simulation | None:
        """The simulation behind this arm; `None` for a real one."""
    @property
    def port(self) -> str:
        """The name of the port."""
    @property
    def firmware(self) -> str:
        """The firmware's version, such as `"3.0"`."""
    @property
    def chip_id(self) -> str:
        """The chip's unique number, twelve hexadecimal digits."""
    @property
    def map(self) -> str:
        """The register map of the frames, `"2.1"` or `"2.2"`. Names and addresses are those of map 2.2 with both."""
    @property
    def progress(self) -> bool:
        """Whether a long call shows its progress on a terminal. `True` at first."""
    @progress.setter
    def progress(self, value: bool, /) -> None: ...
    @property
    def registers(self) -> Registers:
        """The registers as a mapping: `arm.registers["speed.1"] = 10`."""
    @property
    def angles(self) -> _Angles:
        """The measured angles in degrees, joint 1 first: in steps of 0.01 with this project's firmware and map 2.2, else of 1.

        Raises `ArmProblem` if a servo does not answer, because its angle is unknown then; `status()` has the others.
        """
    def get(self, name: str) -> _Value:
        """The value of a register, or a list if the name has several: `arm.get("offset")`.

        Numbers are in the units of docs/registers.md. An unknown name raises `KeyError`.
        """
    def set(self, name: str, values: SupportsIndex | Iterable[SupportsIndex], *, unlock: bool = False) -> None:
        """Writes a register, or several with one number for all or one each, and reads them back.

        Raises `ValueError` for a number out of range, and `NotTaken` if the arm does not take it. `unlock=True` opens the
        EEPROM lock (register 28) for this write. A target of a driven joint is a move: `ArmProblem` is raised if the joint does
        not answer or has let go, and nothing is written. Motor state 1 is watched for half a second as `stop()`. A motor state
        without torque warns of servos that do not answer.
        """
    def observe(self) -> Observation:
        """Positions, velocities and loads of one read, with its time and how old the measurement is: for a control loop.

        A damaged answer is asked for again at once. Raises `NotServed` with the maker's firmware or map 2.1. A servo that does
        not answer keeps its last position here: `status()` tells.
        """
    @property
    def is_connected(self) -> bool:
        """Does the arm answer now? `False` if it is closed, does not answer, or its port is gone. Asks it."""
    def torque_on(self) -> None:
        """Makes the motors hold all joints where they are, and watches for half a second, as `stop()` does."""
    def torque_off(self) -> None:
        """Switches all motors off, so that a hand can lead the arm: it falls unless you hold it. Warns of servos that do not answer."""
    def where(self) -> Tip:
        """Where the arm is: tip, tool and wrist in millimetres, and the angles. Raises `ArmProblem` as `angles` does."""
    @overload
    def pose(
        self,
        angles: _Goals,
        /,
        *,
        speed: float | None = None,
        duration: float | None = None,
        wait: Literal[True] = True,
        table: float | None = None,
        guard: bool = True,
    ) -> _Angles:
        """Moves joints: `arm.pose(120, 90, 65.25, None, None, None, 80)`, or one list of seven.

        Angles are 0 to 180 degrees in steps of 0.01; `None` leaves a joint. `speed` is 1.9 to 190 degrees per second in
        steps of 1.9, rounded down; or `duration` 0.1 to 10 seconds. Both stay set for later moves. Waits until the joints
        rest, and returns their measured angles; with `wait=False` returns `None` when the arm has taken the targets. Raises `ArmProblem` if a joint of the
        move is blocked, let go or silent, the servos have no supply, or the controller restarted.

        Warns with `GuardWarning` if the way leads below the table or into the base: see `move_to`.
        """
    @overload
    def pose(
        self,
        angles: _Goals,
        /,
        *,
        speed: float | None = None,
        duration: float | None = None,
        wait: Literal[False],
        table: float | None = None,
        guard: bool = True,
    ) -> None: ...
    @overload
    def pose(
        self,
        angles: _Goals,
        /,
        *,
        speed: float | None = None,
        duration: float | None = None,
        wait: bool,
        table: float | None = None,
        guard: bool = True,
    ) -> _Angles | None: ...
    @overload
    def pose(
        self,
        angle1: _Goal,
        angle2: _Goal,
        angle3: _Goal,
        angle4: _Goal,
        angle5: _Goal,
        angle6: _Goal,
        angle7: _Goal,
        /,
        *,
        speed: float | None = None,
        duration: float | None = None,
        wait: Literal[True] = True,
        table: float | None = None,
        guard: bool = True,
    ) -> _Angles: ...
    @overload
    def pose(
        self,
        angle1: _Goal,
        angle2: _Goal,
        angle3: _Goal,
        angle4: _Goal,
        angle5: _Goal,
        angle6: _Goal,
        angle7: _Goal,
        /,
        *,
        speed: float | None = None,
        duration: float | None = None,
        wait: Literal[False],
        table: float | None = None,
        guard: bool = True,
    ) -> None: ...
    @overload
    def pose(
        self,
        angle1: _Goal,
        angle2: _Goal,
        angle3: _Goal,
        angle4: _Goal,
        angle5: _Goal,
        angle6: _Goal,
        angle7: _Goal,
        /,
        *,
        speed: float | None = None,
        duration: float | None = None,
        wait: bool,
        table: float | None = None,
        guard: bool = True,
    ) -> _Angles | None: ...
    @overload
    def move_to(
        self,
        x: float,
        y: float,
        z: float,
        *,
        tool: Iterable[float] | None = None,
        speed: float | None = None,
        duration: float | None = None,
        wait: Literal[True] = True,
        straight: bool = False,
        table: float | None = None,
        guard: bool = True,
    ) -> _Angles:
        """Moves the tip to x, y, z in millimetres, with the tool in a direction of any length, by default straight down.

        `speed` and `duration` are those of `pose`. With `straight` the tip moves on a straight line, from its present
        targets, with `speed` 1 to 500 millimetres per second (default 50), or in `duration` 0.1 to 600 seconds; this program
        leads the tip, so it has to wait. Raises `OutOfReach` with the nearest point within
        reach; then nothing moves.

        The guard keeps the arm above a table at the height `table` in millimetres, by default the foot of the base (-60),
        and 10 mm away from the base, also on the way. It knows no suction cup and no claw: raise the table by its length.
        Raises `OutsideGuard` with the nearest allowed point; then nothing moves. `guard=False` checks none of this.
        """
    @overload
    def move_to(
        self,
        x: float,
        y: float,
        z: float,
        *,
        tool: Iterable[float] | None = None,
        speed: float | None = None,
        duration: float | None = None,
        wait: Literal[False],
        straight: bool = False,
        table: float | None = None,
        guard: bool = True,
    ) -> None: ...
    @overload
    def move_to(
        self,
        x: float,
        y: float,
        z: float,
        *,
        tool: Iterable[float] | None = None,
        speed: float | None = None,
        duration: float | None = None,
        wait: bool,
        straight: bool = False,
        table: float | None = None,
        guard: bool = True,
    ) -> _Angles | None: ...
    def wait(self) -> _Angles | None:
        """Waits until the joints of the last move rest, and returns their measured angles; `None` if there is no move.

        Raises `NotReached` if a joint does not arrive. Ctrl-C makes the arm hold. Other threads may read meanwhile.
        """
    def sleep(self, seconds: float) -> None:
        """Waits this many seconds, 0 to 86400, on the clock of the arm: virtual time for a simulated one."""
    def stop(self) -> list[int]:
        """Makes every joint hold its position, and watches for half a second whether it does. Ends a move of another thread.

        Returns the targets in degrees. If the motors are off, writes nothing. Raises `ArmProblem` if a joint is silent or has let
        go, the servos have no supply, or the controller restarted; the other joints hold. Raises `MayMove` if the arm does not
        answer, or if something drags a joint further than 10 degrees from its target.
        """
    def status(self) -> Status | None:
        """The health of the arm: each joint, alarms, supply, and what needs attention. `None` if the firmware does not tell, as
        the maker's.
        """
    def park(self, *angles: _Goal | _Goals, keep: bool = False) -> _Angles:
        """Moves slowly to a pose in which the arm may be let go, switches the motors to damping, and checks that the arm stays: for 2
        seconds in the standard park pose, and for 15 in another one. Returns the measured angles.

        Without angles it is the pose that was kept for this arm, or the standard park pose, which is right for an empty gripper:
        rear arm upright, forearm folded up. `keep=True` keeps the given angles for this arm. If a joint sinks by more than 2 degrees,
        or still sinks after 5 seconds, the arm holds again, and `NotReached` is raised. `arm.set("motor-state", 1)` makes a parked arm hold.
        """
    def stream(
        self,
        period: float = 0.02,
        *,
        watchdog: float = 0.3,
        damping: bool = False,
        approach: float | None = None,
        table: float | None = None,
        guard: bool = True,
    ) -> Stream:
        """A stream of set-points, one each `period` seconds, 0.005 to 1: a context manager. An arm has one open stream at a time.

        If the program sends nothing for `watchdog` seconds, 0.01 to 2.55 or 0 for never, the arm holds; with `damping` it
        sinks slowly. Needs this project's firmware and map 2.2, or raises `NotServed`. `approach`: seconds to go smoothly to the
        first point, 0.1 to 60; without it a point further than 5 degrees raises `TooFar`. `table` and `guard`: see `pose`.
        """
    def record(
        self, seconds: float | None = None, *, hz: int = 30, guided: bool = False
    ) -> Recording:
        """Records the positions for `seconds`, 0 to 86400, or until Ctrl-C, `hz` times a second, 1 to 50. Raises `Interrupted` if
        another thread calls `stop()`. An exception has what was recorded until then as its `recording`.

        With `guided` the motors go off, so that you can guide the arm by hand: it falls unless you hold it. At the end it
        holds where it is.
        """
    def play(
        self,
        recording: Recording,
        *,
        speed: float = 1.0,
        times: int = 1,
        approach: float | None = None,
        table: float | None = None,
        guard: bool = True,
    ) -> Recording:
        """Plays a recording, `speed` times as fast (0.1 to 10), `times` times, and returns the measured positions of the
        first run.

        The whole recording is checked before the arm moves. Ctrl-C makes it hold. `approach`: seconds to go smoothly to the
        first pose, 0.1 to 60, also between the runs; without it a pose further than 5 degrees raises `TooFar`.

        Warns with `GuardWarning` if the recording leads below the table or into the base: see `move_to`.
        """
    def sample(
        self, count: int, *, period: float = 0.0
    ) -> tuple[NDArray[float64], NDArray[float64]]:
        """Reads all positions `count` times, one read after the other, or one each `period` seconds.

        Raises `ArmProblem` if a servo does not answer meanwhile, or the controller restarts, and `Interrupted` if another thread
        calls `stop()`.

        Returns times in seconds and angles in degrees: numpy arrays of shape (n,) and (n, 7) if numpy is installed. Python
        threads run meanwhile, and do not delay the reads.
        """
    def close(self) -> None:
        """Closes the port. The arm goes on with its move: `stop()` makes it hold. Calls of other threads end as with `stop()`."""
    def __enter__(self) -> Self: ...
    def __exit__(
        self,
        *exception: type[BaseException] | BaseException | TracebackType | None,
    ) -> Literal[False]: ...

@final
class SimulatedArm(Arm):
    """An arm in virtual time: an `Arm` that always has its `simulation`."""
    @property
    def simulation(self) -> Simulation:
        """The simulation behind this arm."""

@final
class SimulatedArms:
    """Simulated arms that step together, for learning: `seen = arms.step(actions, 0.02)`, with an action of seven angles in degrees
    for each arm.

    `seen` is an array with a row for each arm. The slices `POSITIONS`, `VELOCITIES`, `LOADS`, `TIP`, `BLOCKED` and `AGE` name its
    columns: `seen[:, arms.TIP]`. Each arm is a controller that parses frames and answers a read, with servos, virtual time,
    faults and a load of its own. Its line takes no time. The results do not depend on the number of threads. `exchange` lets
    another simulation move the joints.

    The first arm has the seed `seed`, and each other one the next number; or give `seeds`. By default there is a thread for each
    processor. Needs numpy.
    """

    POSITIONS: ClassVar[slice]
    VELOCITIES: ClassVar[slice]
    LOADS: ClassVar[slice]
    TIP: ClassVar[slice]
    BLOCKED: ClassVar[slice]
    AGE: ClassVar[slice]
    SET_POINTS: ClassVar[slice]
    SET_VELOCITIES: ClassVar[slice]
    DRIVES: ClassVar[slice]
    def __new__(
        cls,
        n: int,
        seed: int = 1,
        *,
        seeds: Iterable[SupportsIndex] | None = None,
        threads: int | None = None,
    ) -> Self: ...
    @overload
    def step(self, actions: ArrayLike | None, dt: float, out: _Numbers) -> _Numbers:
        """Sends each arm its action, the next set-point of seven angles of 0 to 180 degrees, lets `dt` pass, and reads its state.

        `actions` is an array (n, 7); arrays of float32 and float64 without gaps are not copied, unless `out` has the other type.
        With `None` the arms go on.
        `dt` is 0.005 to 1 second in whole milliseconds. Returns `out`, or a new array (n, 32), which is float32 if the actions are.
        A wrong action raises `ValueError` before any arm moves. Ctrl-C ends the call after the step.
        """
    @overload
    def step(self, actions: ArrayLike | None, dt: float = 0.02, *, out: _Numbers) -> _Numbers: ...
    @overload
    def step(self, actions: NDArray[float32], dt: float = 0.02, out: None = None) -> NDArray[float32]: ...
    @overload
    def step(self, actions: ArrayLike | None, dt: float = 0.02, out: None = None) -> NDArray[float64]: ...
    def send(self, actions: ArrayLike, period: float = 0.02) -> None:
        """Sends each arm its action as the next point of a stream of this period, as `step` does. No time passes."""
    @overload
    def exchange(
        self, measured: ArrayLike, dt: float = 0.002, out: None = None
    ) -> NDArray[float64]:
        """Lets another simulation, such as MuJoCo, move the joints: passes its measurements to the arms, lets `dt` pass, and returns
        what the servos want then.

        `measured` is an array (n, 21) with the columns `POSITIONS`, `VELOCITIES` and `LOADS`, in the units of an observation. A
        joint whose position is NaN is moved by this simulation. Returns `out`, or a new array (n, 21): `SET_POINTS` in degrees,
        `SET_VELOCITIES` in degrees per second, and `DRIVES`: 1 for a motor that drives its joint, 2 for one that damps it, or else
        0. `dt` is 0.001 to 1 second in whole milliseconds. `send` gives actions, `read` the observations.
        """
    @overload
    def exchange(self, measured: ArrayLike, dt: float, out: NDArray[float64]) -> NDArray[float64]: ...
    @overload
    def exchange(self, measured: ArrayLike, dt: float = 0.002, *, out: NDArray[float64]) -> NDArray[float64]: ...
    @overload
    def read(self, out: _Numbers) -> _Numbers:
        """Asks each arm for its state: `out`, or a new array (n, 32). No time passes."""
    @overload
    def read(self, out: None = None) -> NDArray[float64]: ...
    @overload
    def observe(self, out: _Numbers) -> _Numbers:
        """The observations of the last reads: `out`, or a new array (n, 32). No time passes."""
    @overload
    def observe(self, out: None = None) -> NDArray[float64]: ...
    def reset(
        self,
        mask: ArrayLike | None = None,
        snapshot: SimulationSnapshot | None = None,
        *,
        seeds: Iterable[SupportsIndex] | None = None,
    ) -> None:
        """Makes the arms of the mask (n truth values), or all, as they were after their start, or as a snapshot: time, faults and
        load, too. Each keeps its seed, or gets one of `seeds` (n numbers), and draws the same random numbers again.
        """
    def fault(self, mask: ArrayLike | None, fault: str, seconds: float | None = None) -> None:
        """Gives the arms of the mask, or all with `None`, a fault, for `seconds` or until `clear` or `reset`. The words are those of
        `Simulation.fault`.
        """
    def clear(self, mask: ArrayLike | None = None, location: str | None = None) -> None:
        """Takes the faults of the arms of the mask, or of all, back: all, or those at one location, `"3"`, `"supply"`, `"line"`."""
    def set_load(self, grams: ArrayLike, mask: ArrayLike | None = None) -> None:
        """Hangs a weight on the tip of the arms of the mask, or of all: grams, 0 to 1000, one number or one for each of the n arms."""
    def set(
        self, name: str, values: SupportsIndex | Iterable[SupportsIndex], mask: ArrayLike | None = None
    ) -> None:
        """Writes registers of the arms of the mask, or of all, in one frame each: `arms.set("push-limit", 50)`. Names and numbers
        are those of docs/registers.md. An arm refuses a write that its rules forbid.
        """
    def scale_servos(
        self, torque: ArrayLike, friction: ArrayLike, mask: ArrayLike | None = None
    ) -> None:
        """Makes the servos of the arms of the mask, or of all, stronger or weaker, and their gears stiffer: factors of the stall torque
        and of all friction and drag, 0.1 to 10 in steps of 0.01, one number or one for each of the n arms. `reset` takes it back.
        """
    def snapshot(self, arm: int) -> SimulationSnapshot:
        """A copy of an arm as it is now, by its number from 0: for `reset`, and for `Simulation.restore`."""
    @property
    def angles(self) -> NDArray[float64]:
        """The true angles of all joints in degrees, without noise: an array (n, 7)."""
    @property
    def time(self) -> NDArray[float64]:
        """The virtual time of each arm in seconds: an array (n,)."""
    @property
    def threads(self) -> int:
        """The most threads that step the arms."""
    def __len__(self) -> int: ...

@final
class Registers:
    """The registers of an arm as a mapping from names to numbers: `arm.registers["speed.1"]`.

    Names are those of docs/registers.md, in any case, shortened while they are unique, with `.3` for joint 3; or numbers
    and ranges, `"54..60"`. Numbers are in the units of the table. Each access asks the arm, and each assignment is read
    back. `keys()` has the full names that this arm has, and `dict(arm.registers)` all their values.
    """
    def __getitem__(self, name: str, /) -> _Value: ...
    def __setitem__(self, name: str, value: SupportsIndex | Iterable[SupportsIndex], /) -> None: ...
    # Registers cannot be deleted: the slot exists because of __setitem__.
    def __delitem__(self, name: str, /) -> None: ...
    def __contains__(self, name: str, /) -> bool: ...
    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[str]: ...
    def keys(self) -> list[str]:
        """The names of the registers that this arm has."""
    def values(self) -> list[_Value]:
        """The values of all registers, in the order of `keys()`."""
    def items(self) -> list[tuple[str, _Value]]:
        """The names and the values of all registers."""
    @overload
    def get(self, name: str, default: None = None) -> _Value | None:
        """The value of a register, or `default` if there is none of this name."""
    @overload
    def get(self, name: str, default: _T) -> _Value | _T: ...
    def _ipython_key_completions_(self) -> list[str]: ...
    def describe(self, name: str) -> str:
        """What the register table says about a name: meaning, access, range and unit."""

@final
class Tip:
    """Where the arm is.

    Positions are millimetres from the point where the axis of the base meets the top plate: x to the right, y forward,
    z up. The tip is the middle of the disc that joint 6 turns. Tips of the same angles are equal.
    """
    @overload
    @staticmethod
    def of(angles: Iterable[float], /) -> Tip:
        """Where an arm is whose seven angles are these, in degrees: forward kinematics, without an arm."""
    @overload
    @staticmethod
    def of(
        angle1: float,
        angle2: float,
        angle3: float,
        angle4: float,
        angle5: float,
        angle6: float,
        angle7: float,
        /,
    ) -> Tip: ...
    @property
    def tip(self) -> _Vector:
        """The tip in millimetres: x, y, z."""
    @property
    def tool(self) -> _Vector:
        """The direction of the tool, of length 1: from the wrist to the tip."""
    @property
    def wrist(self) -> _Vector:
        """The common point of the axes of joints 4, 5 and 6, in millimetres."""
    @property
    def angles(self) -> _Angles:
        """The angles of joints 1 to 7 in degrees."""
    def __eq__(self, value: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def _repr_html_(self) -> str: ...

@final
class Observation:
    """What one read of the arm tells: positions, velocities and loads of all joints, measured in the same cycle of the controller.

    The controller asks its servos once in a cycle of 10 ms, so a position is up to 10 ms old when the arm answers, and `age`
    adds the time that the answer took.
    """
    @property
    def positions(self) -> NDArray[float64]:
        """The measured positions in degrees; NaN for a joint that was not measured since power-up. With numpy an array."""
    @property
    def velocities(self) -> NDArray[float64]:
        """The velocities in degrees per second, in steps of 0.1: as `positions`."""
    @property
    def loads(self) -> NDArray[float64]:
        """The loads in percent of the stall torque, positive if the motor pushes towards greater angles: as `positions`."""
    @property
    def time(self) -> float:
        """When the answer came: seconds since the arm was opened, on the clock of its line. It never goes back."""
    @property
    def age(self) -> float:
        """The longest time between the measurement and `time`, in seconds: a cycle of the controller, and that of the exchange. While
        the servo of a joint does not answer, its values are older: those of before. `arm.status()` tells it.
        """
    @property
    def monotonic(self) -> float:
        """When the answer came, on the clock of `time.monotonic()`."""
    @staticmethod
    def _of(
        positions: Iterable[float],
        velocities: Iterable[float],
        loads: Iterable[float],
        time: float,
        age: float,
        monotonic: float,
    ) -> Observation: ...

@final
class Problem:
    """Something that is wrong with the arm or one of its joints."""
    @property
    def kind(self) -> str:
        """A word or two, such as `"blocked"`."""
    @property
    def joint(self) -> int | None:
        """The joint, 1 to 7; `None` if the problem is that of the whole arm."""
    @property
    def remedy(self) -> str:
        """What to do."""
    @staticmethod
    def _of(kind: str, joint: int | None) -> Problem: ...

@final
class JointStatus:
    """One joint at one instant. A value is `None` if the firmware does not tell it."""
    @property
    def joint(self) -> int:
        """1 to 7."""
    @property
    def position(self) -> float | None:
        """The measured position in degrees; `None` if it was never measured."""
    @property
    def target(self) -> float:
        """The target in degrees."""
    @property
    def velocity(self) -> float | None:
        """The velocity in degrees per second."""
    @property
    def load(self) -> float | None:
        """The load in percent of the stall torque, positive if the motor pushes towards greater angles."""
    @property
    def is_moving(self) -> bool | None:
        """Does the set-point move?"""
    @property
    def is_silent(self) -> bool | None:
        """Does the servo not answer?"""
    @property
    def is_blocked(self) -> bool | None:
        """Does an obstacle keep the joint from its target?"""
    @property
    def has_let_go(self) -> bool | None:
        """Does the servo hold no torque although it should?"""
    @property
    def is_at_target(self) -> bool:
        """Is the joint driven, at rest, and within 3 degrees of its target?"""
    @property
    def state(self) -> str:
        """What the joint does, in a word or two; empty if it has no problem and the motors are off."""
    @staticmethod
    def _of_registers(registers: bytes, joint: int) -> JointStatus: ...

@final
class Status:
    """The health of the arm at one instant. Only this project's firmware has it. Two are equal if all registers of the arm were equal."""
    @property
    def is_healthy(self) -> bool:
        """Does nothing need attention?"""
    @property
    def problems(self) -> list[Problem]:
        """What needs attention, the most important first; each has a `remedy`."""
    @property
    def joints(self) -> list[JointStatus]:
        """The joints, joint 1 first."""
    @property
    def motor_state(self) -> str:
        """The motor state: `"servo"`, `"damping protection"` or `"forceless"`."""
    @property
    def blocked(self) -> list[int]:
        """The joints, 1 to 7, that an obstacle keeps from their targets."""
    @property
    def let_go(self) -> list[int]:
        """The joints, 1 to 7, whose servo holds no torque although it should."""
    @property
    def alarms(self) -> str | None:
        """The alarms of the servos as text, `"none"` without any; `None` if unknown."""
    @property
    def supply_lost(self) -> bool | None:
        """Did the controller switch the motors off because the servos lost their supply? `None` if unknown."""
    @property
    def faults(self) -> str:
        """The faults as text; `"none"` without any."""
    @property
    def fault_bits(self) -> int:
        """The bits of register 241."""
    @property
    def missing(self) -> list[int]:
        """The joints, 1 to 7, whose servo does not answer."""
    @property
    def moving(self) -> list[int]:
        """The joints, 1 to 7, whose set-point moves."""
    @property
    def supply_volts(self) -> float | None:
        """The supply of the servos in volts; `None` if unknown."""
    @property
    def hottest_celsius(self) -> int | None:
        """The temperature of the hottest servo in degrees Celsius; `None` if unknown."""
    @property
    def frames_accepted(self) -> int:
        """The number of accepted frames, 0 to 65535; wraps."""
    @property
    def frames_corrupted(self) -> int:
        """The number of frames with a wrong checksum, 0 to 65535; wraps."""
    @property
    def frames_refused(self) -> int:
        """The number of refused frames, 0 to 65535; wraps."""
    @property
    def servo_bus_errors(self) -> int:
        """The number of questions on the servo bus without an accepted answer, 0 to 65535; wraps."""
    @property
    def last_refusal(self) -> str | None:
        """Why the last refused frame was refused; `None` if none was."""
    @staticmethod
    def _of_registers(registers: bytes) -> Status: ...
    def __eq__(self, value: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def _repr_html_(self) -> str: ...

@final
class Stream:
    """A stream of set-points, a context manager: `with arm.stream(0.02) as stream: stream.send(...)`.

    `send` waits until the next point is due, `latest` does not wait. If the program sends nothing for longer than the watchdog's
    time, the arm holds. At the end it waits until the joints stand at their last points, and raises `ArmProblem` or `NotReached` if one
    does not get there. The registers of the stream have their old values again.
    """
    def __enter__(self) -> Self: ...
    def __exit__(
        self,
        *_exception: type[BaseException] | BaseException | TracebackType | None,
    ) -> Literal[False]: ...
    def send(self, angles: _Goals) -> int:
        """Sends a point when it is due: seven angles, 0 to 180 degrees in steps of 0.01, `None` for joints without a point.

        Returns the number of the point, which grows by more than one if the program was late. Raises `ArmProblem` if a joint of
        the stream is blocked, let go or silent, the servos have no supply, or the controller restarted.

        The first point of a joint has to be within 5 degrees of where it stands, and is approached at up to 30 degrees per
        second; else `TooFar` is raised, unless the stream has an `approach`. Then the call takes that time. The first point below
        the table or in the base gives a `GuardWarning`. After `Simulation.restore`, and after a failure of the whole arm, such as a
        restart, the next point is a first one again.
        """
    def latest(self, angles: _Goals) -> StreamCounts:
        """Offers an action, and does not wait: seven angles, as for `send`; `None` keeps the joint's angle in the action before.

        A thread outside the interpreter sends the newest action each `period`, and without a new one the last one again. Once
        the program has offered nothing for the time of `watchdog`, it sends nothing, so that the watchdog of the arm acts after
        the same time again. Returns how the actions became points so far: see `StreamCounts`.

        A failure of the thread is raised by the next call, which then offers nothing. The thread goes on after an `ArmProblem` of a joint.
        After all other failures, and after `Arm.stop` (`Interrupted`), it begins again with the next action. This is a first one,
        as of `send`, and so is the next one after the watchdog has acted. A simulated arm sends while its time passes: in
        `Arm.sleep`, or when the arm is asked. `record`, `sample` and moves hold the sender up.
        """
    @property
    def counts(self) -> StreamCounts:
        """How the actions of `latest` became points so far."""
    @property
    def period(self) -> float:
        """The time between two points in seconds."""

@final
class StreamCounts:
    """How the actions of `Stream.latest` became points so far."""
    @property
    def sent(self) -> int:
        """Points that were sent, repeated ones included."""
    @property
    def skipped(self) -> int:
        """Actions that a newer one replaced before a point was due."""
    @property
    def repeated(self) -> int:
        """Points without a new action: the last one again."""
    @property
    def missed(self) -> int:
        """Points that were due and not sent, because the sender was late."""
    @property
    def watchdog(self) -> int:
        """How often the program was silent until the watchdog of the arm acted."""
    @staticmethod
    def _of(sent: int, skipped: int, repeated: int, missed: int, watchdog: int) -> StreamCounts: ...

@final
class Recording:
    """A movement: times in seconds, angles of joints 1 to 7 in degrees, and the vacuum pump.

    The file is that of `sevenbot record`: text, one line for each moment. `recording[0]` is the first moment: its time, its
    angles, and whether the pump sucks. `recording[10:20]` is a part, and `len(recording)` the number of moments. Recordings
    with the same moments are equal.
    """
    @classmethod
    def load(cls, path: _Path) -> Recording:
        """Reads a file: text, CSV or MCAP, which its first bytes tell."""
    @classmethod
    def parse(cls, text: str, arrivals: Iterable[float] | None = None) -> Recording:
        """From the text of a file, as `str(recording)` gives it, and the times of arrival."""
    @classmethod
    def from_points(
        cls,
        times: Iterable[float],
        angles: Iterable[Iterable[float]],
        vacuum: Iterable[bool] | None = None,
    ) -> Recording:
        """From times in seconds, in ascending order, and as many rows of seven angles, 0 to 180 degrees."""
    def save(self, path: _Path) -> None:
        """Writes a file, which `sevenbot play` takes, too: CSV for a name with `.csv` at its end, MCAP with messages of ROS 2 for
        `.mcap`, else text.
        """
    @property
    def times(self) -> NDArray[float64]:
        """The times of the moments in seconds: a numpy array, or a tuple without numpy.

        `Arm.record` has the times of measurement: the arm measures at even times, and a moment that arrives late still has the
        time at which it was measured.
        """
    @property
    def arrivals(self) -> NDArray[float64] | None:
        """When each moment of `Arm.record` arrived here, in seconds since the first: as `times`. `None` for another recording."""
    @property
    def angles(self) -> NDArray[float64]:
        """The angles in degrees, one row of seven for each moment: a numpy array, or a tuple of lists without numpy."""
    @property
    def vacuum(self) -> list[bool]:
        """Does the vacuum pump suck? One for each moment."""
    @property
    def duration(self) -> float:
        """The time from the first moment to the last, in seconds."""
    def check(self, speed: float = 1.0) -> None:
        """Checks that every joint can follow at `speed` times the recorded speed. Raises `BadRecording`."""
    def __len__(self) -> int: ...
    @overload
    def __getitem__(self, index: int, /) -> tuple[float, _Angles, bool]: ...
    @overload
    def __getitem__(self, part: slice, /) -> Recording: ...
    def __iter__(self) -> Iterator[tuple[float, _Angles, bool]]: ...
    def __eq__(self, value: object, /) -> bool: ...
    def __hash__(self) -> int: ...

@final
class Simulation:
    """The simulated arm of `Arm.simulated()`.

    Its time is virtual: it passes only while the arm is asked, in `Arm.sleep` and in `advance`. A program may think as long
    as it likes, and gets the same result on every machine.
    """
    @property
    def now(self) -> float:
        """The virtual time since power-up, in seconds."""
    def advance(self, seconds: float) -> None:
        """Lets this many seconds pass, 0 to 86400. Ctrl-C ends it early."""
    def fault(self, fault: str, seconds: float | None = None) -> None:
        """Gives the arm a fault, for `seconds` or until `clear`: `"3=missing"`, `"5=late=20"`, `"supply=off"`, `"bus=echo"`.
        Also what a joint meets: `"2=wall=60"`, `"2=wall=60/500"` (soft, mN m per degree), `"2=push=-300"` (mN m),
        `"7=thing=30"`.

        The words are those of `host-sim --fault`. A wrong word raises `ValueError` with the list.
        """
    def later(self, seconds: float, action: str) -> None:
        """Does something to the arm after this many seconds, 0 to 86400, also during a call: `later(2, "restart")`,
        `"fault 3=missing"`, `"fault supply=off 300000"` (for 300,000 microseconds), `"halt"`, `"trip 2"`, `"power-cycle"`.

        The words are those of a session of `host-sim --record`. A wrong word raises `ValueError` with the list.
        """
    def unplug(self, seconds: float = 0.0) -> None:
        """Pulls the cable of the line after this many seconds, 0 to 86400. There is no way to plug it in again."""
    def clear(self, location: str | None = None) -> list[str]:
        """Takes all faults back, or those at one location: `"3"`, `"supply"`, `"line"`.

        Returns how often each took effect, as text.
        """
    @property
    def faults(self) -> list[str]:
        """The present faults, and how often each took effect so far, as text."""
    @property
    def angles(self) -> _Angles:
        """The true angles of joints 1 to 7 in degrees, without offsets and without noise."""
    def move_by_hand(self, joint: int, degrees: float) -> None:
        """Turns a joint by hand to an angle of 0 to 180 degrees, and holds it there until it has torque or `let_go`."""
    def hold_by_hand(self, joint: int) -> None:
        """Lets a hand hold a joint where it is, until it has torque. Has no effect on a joint with torque."""
    def let_go(self, joint: int) -> None:
        """Takes the hand away from a joint: without torque, a loaded joint falls."""
    @property
    def load_grams(self) -> int:
        """The weight in the gripper in grams, 0 to 1000."""
    @load_grams.setter
    def load_grams(self, value: int, /) -> None: ...
    def drop_load(self) -> None:
        """Drops all that the gripper holds: the thing between the claws, the weight, and an object of the scene."""
    @property
    def scene(self) -> str | None:
        """What stands on the table, as text: `"cube red 30 40 0 200; cylinder can 40 60 100 -80 200"`. docs/simulation.md describes it.
        `None`: there is no table. Setting it puts all things in their places.
        """
    @scene.setter
    def scene(self, value: str | None, /) -> None: ...
    @property
    def things(self) -> dict[str, list[float]]:
        """Where the middle of each thing of the scene is, by its name: x, y and z in mm."""
    def trip(self, joint: int, alarm: Literal["overload", "heat"] = "overload") -> None:
        """Forces an alarm on a joint's servo, which switches its motor off: `"overload"`, until its torque is switched off
        and on, or `"heat"`, until it has cooled down. An overload has no effect on a joint without torque.
        """
    def power_cycle(self) -> None:
        """Switches the arm off and on. The settings stay."""
    def power_off(self) -> None:
        """Switches the arm off, until `power_cycle`. Loaded joints fall."""
    def snapshot(self) -> SimulationSnapshot:
        """A copy of the arm as it is now."""
    def restore(self, snapshot: SimulationSnapshot) -> None:
        """Makes the arm as it was at a snapshot, its time included. The clock of its line goes on: sleeps, streams and timeouts are
        as long as without it.
        """

@final
class SimulationSnapshot:
    """A simulated arm at one instant: servos, registers, settings and time. Two are equal if all of their state is equal.

    `pickle` keeps it for the same version of this package. As any pickle, load it only if you trust its source.
    """

    @staticmethod
    def _of_bytes(bytes: bytes) -> SimulationSnapshot: ...
    def __eq__(self, value: object, /) -> bool: ...
    def __hash__(self) -> int: ...
