"""Talks to a 7Bot V2 robot arm over its serial port, or to a simulated one.

>>> import sevenbot
>>> with sevenbot.Arm.simulated() as arm:
...     angles = arm.pose(120, 90, 65, 90, 90, 90, 80)
>>> round(angles[0])
120

Angles are degrees, positions millimetres, times seconds.
"""

from sevenbot._sevenbot import (
    Arm,
    ArmProblem,
    BadRecording,
    Closed,
    Error,
    FileError,
    GuardWarning,
    Interrupted,
    InvalidType,
    InvalidValue,
    JointStatus,
    MayMove,
    NoAnswer,
    NotDriven,
    NotReached,
    NotServed,
    NotTaken,
    OutOfReach,
    OutsideGuard,
    PortError,
    Problem,
    Recording,
    Registers,
    SimulatedArm,
    Simulation,
    SimulationSnapshot,
    Status,
    Stream,
    Tip,
    TooFar,
    UnknownRegister,
    __version__,
    ports,
)

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
    "OutOfReach",
    "OutsideGuard",
    "PortError",
    "Problem",
    "Recording",
    "Registers",
    "SimulatedArm",
    "Simulation",
    "SimulationSnapshot",
    "Status",
    "Stream",
    "Tip",
    "TooFar",
    "UnknownRegister",
    "__version__",
    "ports",
]
