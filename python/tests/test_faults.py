"""Each method in `ROWS` under each fault in `FAULTS`: no method reports success unless the arm did what it was asked.

The snapshot beside this file holds what each method does under each fault. A method succeeds only where the arm did what it was
asked, or where the method only reads.

`SNAPSHOT=write` writes the snapshot anew. `CELL="stop / silent"` runs these cells only, and prints all that they say.
"""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

import sevenbot

SNAPSHOT = Path(__file__).with_name("faults.txt")
REST = (90, 90, 65, 90, 90, 90, 80)
GOAL = (110, 105, 65, 90, 90, 90, 80)
#: A joint has reached an angle if it is within this many degrees of it: servos have play, and the arm bends.
NEAR = 3.0
#: A joint that moves by at most this many degrees in `AFTERWARDS` stands still.
STILL = 1.5
#: Seconds after the end of a method, in which the arm completes the move that the method began.
AFTERWARDS = 3.0
#: The number of reads before the call. A method detects a restart by the counter of frames.
USED = 100

#: The messages for a supply that is lost and comes back. Which one appears depends on when the method reads the arm.
SUPPLY_WORDS = ["no servo answers", "does not answer", "let go", "lost their supply"]

Angles = tuple[float, ...]


@dataclass(frozen=True)
class Cell:
    """What a method did.

    `done`: whether the arm did what it was asked. None if the method only reads, raised an error, or ended before the fault.
    """

    outcome: str
    done: bool | None
    words: str


@dataclass
class Seen:
    """The arm at the end of the call and some time later. `registers` is None if the arm is closed or does not answer."""

    at_end: Angles
    later: Angles
    registers: dict[str, object] | None
    result: object

    def stands(self) -> bool:
        return all(abs(then - now) <= STILL for now, then in zip(self.at_end, self.later))

    def is_at(self, goal: dict[int, float]) -> bool:
        return all(abs(self.later[joint - 1] - degrees) <= NEAR for joint, degrees in goal.items())

    def has(self, name: str, value: object) -> bool:
        return self.registers is not None and self.registers[name] == value


Check = Callable[[Seen], bool]


def reach(goal: dict[int, float], state: int = 1) -> Check:
    return lambda seen: seen.is_at(goal) and seen.has("motor-state", state)


def targets(goal: dict[int, int]) -> Check:
    return lambda seen: seen.has("motor-state", 1) and all(
        seen.has(f"target-position.{joint}", degrees) for joint, degrees in goal.items()
    )


def register(name: str, value: int) -> Check:
    return lambda seen: seen.has(name, value)


def holds(seen: Seen) -> bool:
    return seen.stands() and seen.has("motor-state", 1)


def recorded(seen: Seen) -> bool:
    assert isinstance(seen.result, sevenbot.Recording)
    return all(abs(last - now) <= 8 for last, now in zip(seen.result.angles[-1], seen.at_end))


@dataclass(frozen=True)
class Row:
    """A method. `moment` is the time in seconds from the call to a fault that comes during it."""

    name: str
    act: Callable[[sevenbot.Arm], object]
    moment: float
    asked: Check | None
    before: Callable[[sevenbot.Arm], object] = lambda arm: None
    pause: float = 1.5
    wall: int = 97


def stream(arm: sevenbot.Arm) -> None:
    with arm.stream(0.02) as points:
        for step in range(76):
            points.send([90 + step * 20 / 75, 90 + step * 15 / 75, *[None] * 5])
        arm.sleep(0.5)
        points.send([110, 105, *[None] * 5])


def leave(arm: sevenbot.Arm) -> None:
    with arm:
        pass


def slowly(*goal: float) -> Callable[[sevenbot.Arm], object]:
    return lambda arm: arm.pose([*goal, *[None] * (7 - len(goal))], speed=1.9, wait=False)


def away(arm: sevenbot.Arm) -> None:
    arm.pose(GOAL)
    arm.set("speed", 10)


def tool_down(arm: sevenbot.Arm) -> None:
    arm.pose(90, 91, 110, 90, 135, None, None)
    arm.set("speed", 10)


def wait(arm: sevenbot.Arm) -> object:
    arm.pose(GOAL, wait=False)
    return arm.wait()


def supported(arm: sevenbot.Arm) -> None:
    assert arm.simulation is not None
    arm.simulation.fault("arm=supported")


MOVE = sevenbot.Recording.from_points([0, 1.5], [REST, GOAL])
LOOP = sevenbot.Recording.from_points(
    [0, 0.8, 2.8, 3.6], [REST, (105, 105, *REST[2:]), (105, 105, *REST[2:]), (94, 94, *REST[2:])]
)
ARRIVED: dict[int, float] = {1: 110, 2: 105}
TIP: dict[int, float] = {1: 71.5, 2: 53}

ROWS = [
    Row("angles", lambda arm: arm.angles, 0.003, None),
    Row("where()", lambda arm: arm.where(), 0.003, None),
    Row("sample(20, period=0.05)", lambda arm: arm.sample(20, period=0.05), 0.3, None),
    Row("status()", lambda arm: arm.status(), 0.003, None),
    Row('get("present-position")', lambda arm: arm.get("present-position"), 0.003, None),
    Row("pose(...)", lambda arm: arm.pose(GOAL, speed=19), 0.4, reach(ARRIVED)),
    Row("pose(110.25, ...)", lambda arm: arm.pose(110.25, 105.25, *[None] * 5, speed=19), 0.4, reach(ARRIVED)),
    Row("pose(..., duration=8)", lambda arm: arm.pose(GOAL, duration=8), 0.4, reach(ARRIVED)),
    Row("pose(..., wait=False)", lambda arm: arm.pose(GOAL, wait=False), 0.02, targets({1: 110, 2: 105})),
    Row("pose(..., wait=False), wait()", wait, 0.2, reach(ARRIVED)),
    Row("pose(90, ...) from elsewhere", lambda arm: arm.pose(REST), 0.4, reach({1: 90, 2: 90}), away),
    Row("move_to(80, 250, 30)", lambda arm: arm.move_to(80, 250, 30), 0.4, reach(TIP), tool_down, wall=80),
    Row(
        "move_to(80, 250, 30, wait=False)",
        lambda arm: arm.move_to(80, 250, 30, wait=False),
        0.03,
        targets({1: 72, 2: 53}),
        tool_down,
        wall=80,
    ),
    Row(
        "move_to(80, 250, 30, straight=True)",
        lambda arm: arm.move_to(80, 250, 30, straight=True),
        1.2,
        reach(TIP),
        tool_down,
        wall=80,
    ),
    Row("stop()", lambda arm: arm.stop(), 0.01, holds, slowly(130, 130), 0.7),
    Row("with arm: ...", leave, 0.01, Seen.stands, slowly(130, 130), 0.7),
    Row("park()", lambda arm: arm.park(), 0.4, reach({2: 90, 3: 0, 4: 90, 5: 48}, 0), away),
    Row(
        'set("motor-state", 1)',
        lambda arm: arm.set("motor-state", 1),
        0.01,
        holds,
        lambda arm: arm.set("motor-state", 0),
    ),
    Row('set("motor-state", 0)', lambda arm: arm.set("motor-state", 0), 0.003, register("motor-state", 0)),
    Row('set("motor-state", 2)', lambda arm: arm.set("motor-state", 2), 0.003, register("motor-state", 2)),
    Row('set("vacuum-pump", 1)', lambda arm: arm.set("vacuum-pump", 1), 0.003, register("vacuum-pump", 1)),
    Row('set("speed", 30)', lambda arm: arm.set("speed", 30), 0.003, register("speed.2", 30)),
    Row(
        'set("target-position.2", 105)',
        lambda arm: arm.set("target-position.2", 105),
        0.006,
        targets({2: 105}),
    ),
    Row('set("fine-target.2", 10525)', lambda arm: arm.set("fine-target.2", 10525), 0.006, targets({2: 105})),
    Row(
        'set("offset.1", 3, unlock=True)',
        lambda arm: arm.set("offset.1", 3, unlock=True),
        0.006,
        register("offset.1", 3),
    ),
    Row("record(1)", lambda arm: arm.record(1), 0.5, recorded, slowly(95, 95), 0.7),
    Row("record(1, guided=True)", lambda arm: arm.record(1, guided=True), 0.5, recorded, supported),
    Row("play(...)", lambda arm: arm.play(MOVE), 0.9, reach(ARRIVED)),
    Row("play(..., times=2)", lambda arm: arm.play(LOOP, times=2, approach=1), 3.0, reach({1: 94, 2: 94})),
    Row("stream()", stream, 0.8, reach(ARRIVED)),
]


@dataclass(frozen=True)
class Fault:
    """A column: a fault that begins before the call, or an event during the call."""

    name: str
    since_before: str | None = None
    during: str | None = None


FAULTS = [
    Fault("none"),
    Fault("silent", "2=missing"),
    Fault("falls silent", during="fault 2=missing"),
    Fault("garbled", "2=garbled"),
    Fault("stuck", "2=stuck"),
    Fault("wall", "2=wall={wall}"),
    Fault("lets go", during="trip 2"),
    Fault("too hot", during="trip 2 heat"),
    Fault("supply off", "supply=off"),
    Fault("supply dips", during="fault supply=off 300000"),
    Fault("supply back", during="fault supply=off 1200000"),
    Fault("restart", during="restart"),
    Fault("off and on", during="power-cycle"),
    Fault("off", during="power-off"),
    Fault("halt", during="halt"),
    Fault("unplugged", during="unplug"),
    Fault("noise", "line=corruption=0.1%"),
]


def registers_of(arm: sevenbot.Arm) -> dict[str, object] | None:
    """The registers that the checks use; `None` if the arm is closed or does not answer."""
    try:
        # First the targets, which the arm changes by itself when it notices a fault.
        positions = enumerate(arm.get("target-position"), start=1)
        found: dict[str, object] = {f"target-position.{joint}": degrees for joint, degrees in positions}
        for name in ["motor-state", "vacuum-pump", "speed.2", "offset.1"]:
            found[name] = arm.get(name)
        return found
    except sevenbot.Error:
        return None


def run(row: Row, fault: Fault) -> Cell:
    arm = sevenbot.Arm.simulated()
    world = arm.simulation
    assert world is not None
    arm.sleep(1.5)
    row.before(arm)
    for _ in range(USED):
        arm.get("motor-state")
    if fault.since_before is not None:
        world.fault(fault.since_before.format(wall=row.wall))
    world.advance(row.pause)
    start = world.now
    if fault.during == "unplug":
        world.unplug(row.moment)
    elif fault.during is not None:
        world.later(row.moment, fault.during)
    outcome, words, result = "ok", "", None
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        warnings.simplefilter("ignore", sevenbot.GuardWarning)
        try:
            result = row.act(arm)
        except sevenbot.Error as error:
            outcome, words = type(error).__name__, str(error).splitlines()[0]
    if outcome == "ok" and told:
        words = f"warning: {told[0].message}"
    if fault.during is not None and world.now < start + row.moment:
        words = f"(before the fault) {words}"
    elif outcome == "ok" and row.asked is not None:
        at_end, registers = world.angles, registers_of(arm)
        world.advance(AFTERWARDS)
        seen = Seen(at_end, world.angles, registers, result)
        return Cell(outcome, row.asked(seen), words)
    return Cell(outcome, None, words)


def masked(words: str, fault: Fault) -> str:
    """The words without numbers, except those of joints and states, and without what depends on the moment of a read."""
    if fault.name.startswith("supply ") and any(stage in words for stage in SUPPLY_WORDS):
        return "(servos are silent, or let go, or had no supply)"
    words = re.sub(r"(no answer to a read|the connection is gone).*", r"\1", words)
    kept = re.sub(r"(?<!joint )(?<!joints )(?<!state )(?<!and )(?<![\d.])\d+(\.\d+)?", "#", words)
    return kept[:110].rstrip()


def table(cells: dict[tuple[str, str], Cell]) -> str:
    lines = []
    for row in ROWS:
        lines.append(row.name)
        for fault in FAULTS:
            cell = cells[row.name, fault.name]
            done = {None: "", True: "done", False: "not done"}[cell.done]
            lines.append(f"  {fault.name:<13} {cell.outcome:<11} {done:<9} {masked(cell.words, fault)}".rstrip())
    return "\n".join(lines) + "\n"


def test_no_method_reports_success_under_a_fault_that_prevents_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Keep the park poses of this computer out of the test.
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    only = os.environ.get("CELL", "")
    pairs = [(row, fault) for row in ROWS for fault in FAULTS if only in f"{row.name} / {fault.name}"]
    cells = {(row.name, fault.name): run(row, fault) for row, fault in pairs}
    if only:
        for (method, name), cell in cells.items():
            print(f"{method} / {name}: {cell}")
        return
    wrong = [f"{method} / {name}" for (method, name), cell in cells.items() if cell.done is False]
    text = table(cells)
    if os.environ.get("SNAPSHOT") == "write":
        SNAPSHOT.write_text(text)
    assert not wrong, "successes that were none:\n" + "\n".join(wrong)
    assert text == SNAPSHOT.read_text()
