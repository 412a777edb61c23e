"""The health of the arm as a diagnosis: a level, a sentence and values.

Knows neither ROS nor the arm, only the values of the registers in `BLOCKS`, or the reason why the arm does not answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

# The temperature in degrees Celsius from which on there is a warning. A servo switches itself off at 80.
HOT = 65
# The names of register 29.
MOTOR_STATES = ("damping protection", "servo", "forceless")
# The ranges of registers that hold the health. Each is one short read.
BLOCKS = ("29..31", "192..199", "240..255")


class Level(IntEnum):
    """The levels of `diagnostic_msgs/DiagnosticStatus`."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class Health:
    """What `/diagnostics` shows."""

    level: Level
    message: str
    values: dict[str, str]


def joints_of(bits: int) -> list[int]:
    """The joints of a register in which bit n-1 is joint n."""
    return [joint for joint in range(1, 8) if bits >> (joint - 1) & 1]


def lost(reason: str) -> Health:
    """The health of an arm that does not answer."""
    return Health(Level.ERROR, f"no arm: {reason}", {})


def of_registers(motor: Sequence[int], protection: Sequence[int], status: Sequence[int], errors_before: int) -> Health:
    """The health of the blocks of `BLOCKS`. `errors_before` is the count of bus errors at the previous diagnosis."""
    blocked, let_go, missing = joints_of(protection[3]), joints_of(protection[4]), joints_of(status[2])
    alarms, supply_lost = protection[5], bool(protection[6])
    errors, volts, celsius = bus_errors(status), status[10] / 10, status[11]
    new_errors = (errors - errors_before) % 65536
    problems = [
        (Level.ERROR, supply_lost, "the servos lost their supply"),
        (Level.ERROR, bool(missing), f"no answer of {_joints(missing)}"),
        (Level.ERROR, bool(let_go), f"no torque in {_joints(let_go)}"),
        (Level.ERROR, bool(blocked), f"an obstacle blocks {_joints(blocked)}"),
        (Level.ERROR, bool(alarms & 1 << 5), "a servo is overloaded"),
        (Level.WARN, celsius >= HOT or bool(alarms & 1 << 2), f"a servo is hot: {celsius} degrees Celsius"),
        (Level.WARN, bool(alarms & 1), f"the supply is out of range: {volts:.1f} V"),
        (Level.WARN, motor[0] != 1, f"the motors do not drive: {MOTOR_STATES[motor[0]]}"),
        (Level.WARN, new_errors > 0, f"{new_errors} new errors of the servo bus"),
    ]
    present = [(level, text) for level, is_present, text in problems if is_present]
    return Health(
        max((level for level, _ in present), default=Level.OK),
        "; ".join(text for _, text in present) or "healthy",
        {
            "motors": MOTOR_STATES[motor[0]],
            "vacuum": "sucks" if motor[2] else "off",
            "blocked": _joints(blocked),
            "let go": _joints(let_go),
            "missing": _joints(missing),
            "moving": _joints(joints_of(status[3])),
            "supply lost": str(supply_lost),
            "supply in V": f"{volts:.1f}",
            "hottest servo in degrees Celsius": str(celsius),
            "errors of the servo bus": str(errors),
            "alarms of the servos": f"{alarms:#04x}",
            "faults of the controller": f"{status[1]:#04x}",
        },
    )


def bus_errors(status: Sequence[int]) -> int:
    """The count of bus errors in the block 240 to 255, whose counters are one number each."""
    return status[9]


def _joints(joints: Sequence[int]) -> str:
    return " ".join(f"joint_{joint}" for joint in joints) or "none"
