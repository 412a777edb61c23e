"""Warnings that do not repeat thirty times a second."""

import logging
import time
from collections.abc import Iterable

import sevenbot

LOGGER = logging.getLogger(__package__)
QUIET = 3.0
"""A problem that was not there for this time, in seconds, is told again when it comes back."""
PASSING = ("blocked", "let go")
"""The kinds of problems that do not end the loop: the joint takes up the stream by itself once it is free."""
SILENCE = 0.5
"""A servo that does not answer for this time, in seconds, ends the loop. A shorter silence is a disturbance of its bus."""
GAP = 0.3
"""The arm tells its problems ten times a second: one that was not told for this time, in seconds, was over."""


class Warned:
    """Which problems and changes of actions were told already."""

    def __init__(self) -> None:
        # When each problem began, and when it was last seen.
        self._problems: dict[str, tuple[float, float]] = {}
        self._told: set[str] = set()

    def problem(self, error: sevenbot.ArmProblem) -> None:
        """Warns once of joints that stall, and of a short silence. Raises the error if no loop can go on with its problem."""
        self.problems(error.problems, error)

    def problems(self, problems: Iterable[sevenbot.Problem], error: Exception) -> None:
        """As `problem`, for these problems. Raises `error` if no loop can go on with one of them."""
        now = time.monotonic()
        for problem in problems:
            begin, last = self._problems.get(str(problem), (now, -QUIET))
            begin = begin if now - last < GAP else now
            self._problems[str(problem)] = begin, now
            is_short = problem.kind == "no answer" and now - begin < SILENCE
            if problem.kind not in PASSING and not is_short:
                raise error
            if now - last >= QUIET:
                LOGGER.warning("%s; %s", problem, problem.remedy)

    def once(self, key: str, text: str) -> None:
        """Warns of something that needs telling only once."""
        if key not in self._told:
            self._told.add(key)
            LOGGER.warning(text)
