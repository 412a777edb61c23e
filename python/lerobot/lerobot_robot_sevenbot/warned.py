"""Warnings that do not repeat thirty times a second."""

import logging
import time

import sevenbot

LOGGER = logging.getLogger(__package__)
QUIET = 3.0
"""A problem that was not there for this time, in seconds, is told again when it comes back."""
PASSING = ("blocked", "let go")
"""What a loop goes on with: the joint takes up the stream by itself once it is free."""


class Warned:
    """Which problems and changes of actions were told already."""

    def __init__(self) -> None:
        """Nothing was told."""
        self._problems: dict[str, float] = {}
        self._told: set[str] = set()

    def problem(self, error: sevenbot.ArmProblem) -> None:
        """Warns once of joints that stall. Raises the error if it has another problem, with which no loop can go on."""
        if any(problem.kind not in PASSING for problem in error.problems):
            raise error
        now = time.monotonic()
        for problem in error.problems:
            if now - self._problems.get(str(problem), -QUIET) >= QUIET:
                LOGGER.warning("%s; %s", problem, problem.remedy)
            self._problems[str(problem)] = now

    def once(self, key: str, text: str) -> None:
        """Warns of something that needs telling only once."""
        if key not in self._told:
            self._told.add(key)
            LOGGER.warning(text)
