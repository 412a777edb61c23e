"""Environments for Gymnasium, with the real controller in them.

    env = gymnasium.make("sevenbot.gym:sevenbot/Reach-v0")

The part before the colon is what Gymnasium imports: since version 1.0 Gymnasium looks for no entry points of packages.

| name | task |
| --- | --- |
| `sevenbot/Reach-v0` | bring the tip to a point, and hold it there |
| `sevenbot/Track-v0` | follow a point on a circle |

With `disturbed=True` each episode has a load, a delay of actions and maybe a fault: of the line, of a servo, of the supply, or
a hand that pushes. An action turns the set-points of joints 1 to 5. `gymnasium.make_vec(name, num_envs=1000)` steps many arms at
once. The arm touches nothing, and there are no cameras.

Needs `pip install sevenbot[gym]`.
"""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from sevenbot import InvalidValue, SimulatedArms, forward

__all__ = ["ReachEnv", "ReachVectorEnv", "TrackEnv", "TrackVectorEnv", "sample_goal"]

Floats = NDArray[np.float32]
Flags = NDArray[np.bool_]

REST = np.array([90, 90, 65, 90, 90, 90, 80], dtype=np.float32)
JOINTS = 5
"""An action turns joints 1 to 5: the others do not move the tip."""
TURN = 3.0
"""The largest change of a set-point in a step, in degrees."""
DT = 0.02
NEAR_MM = 10.0
"""A tip within this distance of its goal has reached it."""
MOST_DELAY = 3
"""The longest delay of an action, in steps."""
FAULTS = (
    "line=corruption=0.05%",
    "line=loss=0.1%",
    "3=late=20",
    "4=garbled=5",
    "supply=dips=500",
    "2=push=-300",
    "1=push=300",
)
SIZES = np.array([180] * 7 + [200] * 7 + [100] * 7 + [300] * 3, dtype=np.float32)
"""What the first 24 numbers of an observation are divided by."""


class _Arms:
    """The arms of an environment, their goals and what disturbs them. Each has an episode of its own."""

    def __init__(self, count: int, *, is_moving: bool, disturbed: bool, threads: int | None) -> None:
        self.arms = SimulatedArms(count, threads=threads)
        self.count, self.is_moving, self.disturbed = count, is_moving, disturbed
        self.targets = np.tile(REST, (count, 1))
        self.seen: Floats = np.zeros((count, 32), dtype=np.float32)
        self.centres: Floats = np.zeros((count, 3), dtype=np.float32)
        self.steps = np.zeros(count, dtype=np.int64)
        self.delays = np.zeros(count, dtype=np.int64)
        self.waiting: Floats = np.zeros((MOST_DELAY + 1, count, JOINTS), dtype=np.float32)
        high = np.full(28 + 3 * is_moving, np.inf, dtype=np.float32)
        self.observation_space = gymnasium.spaces.Box(-high, high)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (JOINTS,))

    def reset(self, random: np.random.Generator, mask: Flags, goals: Floats | None = None) -> None:
        """Begins episodes of the arms of the mask."""
        self.arms.reset(mask, seeds=self.draw(random, mask, 2**63).tolist())
        self.targets[mask], self.steps[mask], self.delays[mask] = REST, 0, 0
        self.waiting[:, mask] = 0
        drawn = [sample_goal(random) for _ in range(mask.sum())] if goals is None else goals[mask]
        self.centres[mask] = drawn
        if self.disturbed:
            self.disturb(random, mask)
        self.arms.observe(self.seen)

    def disturb(self, random: np.random.Generator, mask: Flags) -> None:
        self.delays[mask] = self.draw(random, mask, MOST_DELAY + 1)[mask]
        self.arms.set_load(self.draw(random, mask, 201), mask)
        chosen = self.draw(random, mask, 2 * len(FAULTS))
        for number, fault in enumerate(FAULTS):
            self.arms.fault(mask & (chosen == number), fault)

    def draw(self, random: np.random.Generator, mask: Flags, end: int) -> NDArray[np.int64]:
        """A random number below `end` for each arm of the mask, and 0 for the others."""
        drawn = np.zeros(self.count, dtype=np.int64)
        drawn[mask] = random.integers(0, end, mask.sum())
        return drawn

    def step(self, actions: Floats) -> tuple[Floats, Flags]:
        """Moves all arms by a step. Returns their rewards, and which tips are near their goals."""
        # A wrong action would stay in the targets, also after the step that fails.
        if not np.isfinite(actions).all():
            raise InvalidValue("an action is not finite: NaN or an infinity")
        if actions.shape != (self.count, JOINTS):
            raise InvalidValue(f"actions: the shape is {actions.shape}: use ({self.count}, {JOINTS})")
        self.waiting = np.roll(self.waiting, 1, axis=0)
        self.waiting[0] = np.clip(actions, -1, 1)
        due = self.waiting[self.delays, np.arange(self.count)]
        self.targets[:, :JOINTS] = np.clip(self.targets[:, :JOINTS] + TURN * due, 0, 180)
        # The linkage keeps joints 2 and 3 together.
        linkage = np.clip(self.targets[:, 1] + self.targets[:, 2] - 65, 19, 161)
        self.targets[:, 2] = np.clip(linkage + 65 - self.targets[:, 1], 0, 180)
        self.arms.step(self.targets, DT, self.seen)
        self.steps += 1
        distance = np.linalg.norm(self.tips() - self.goals(), axis=1)
        cost = distance / 100 + 0.02 * np.square(actions).mean(axis=1)
        return (-cost).astype(np.float32), distance < NEAR_MM

    def tips(self) -> Floats:
        tips: Floats = np.nan_to_num(self.seen[:, self.arms.TIP])
        return tips

    def goals(self, ahead: int = 0) -> Floats:
        """Where the tips should be, in millimetres."""
        if not self.is_moving:
            return self.centres
        turn = (self.steps + ahead) * DT * 1.5
        circle = np.stack([np.cos(turn), np.zeros(self.count), np.sin(turn)], axis=1)
        goals: Floats = (self.centres + 30 * circle).astype(np.float32)
        return goals

    def observations(self) -> Floats:
        """Positions, velocities, loads, tip; the way from tip to goal; the age; the way of a moving goal in 5 steps."""
        # A joint that was not measured yet reads as 0.
        seen = np.nan_to_num(self.seen)
        way = (self.goals() - self.tips()) / 100
        parts = [seen[:, :24] / SIZES, way, seen[:, self.arms.AGE]]
        if self.is_moving:
            parts.append((self.goals(5) - self.goals()) / 100)
        return np.concatenate(parts, axis=1, dtype=np.float32)


def _checked(name: str, goals: Any, shape: tuple[int, ...]) -> Floats:
    try:
        numbers: Floats = np.asarray(goals, np.float32)
    except (TypeError, ValueError) as error:
        raise InvalidValue(f"{name}: {error}: use numbers of the shape {shape}, in millimetres") from error
    if numbers.shape != shape or not np.isfinite(numbers).all():
        raise InvalidValue(f"{name}: use finite numbers of the shape {shape}, in millimetres; the shape here is {numbers.shape}")
    return numbers


def sample_goal(random: np.random.Generator) -> tuple[float, float, float]:
    """A point that the tip can reach, above the table."""
    while True:
        turned = random.uniform(-30, 30, JOINTS)
        x, y, z = forward([*(REST[:JOINTS] + turned), 90, 80]).tip
        if 60 < z < 400:
            return x, y, z


class _ArmEnv(gymnasium.Env[Floats, Floats]):
    """One arm."""

    metadata: dict[str, Any] = {"render_modes": []}
    is_moving: ClassVar[bool]

    def __init__(self, *, disturbed: bool = False, render_mode: str | None = None) -> None:
        self.render_mode = render_mode
        self._arms = _Arms(1, is_moving=self.is_moving, disturbed=disturbed, threads=1)
        self.observation_space = self._arms.observation_space
        self.action_space = self._arms.action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Begins an episode. `options={"goal": (x, y, z)}` sets the goal, in millimetres."""
        super().reset(seed=seed)
        goal = (options or {}).get("goal")
        goals = None if goal is None else _checked("goal", goal, (3,)).reshape(1, 3)
        self._arms.reset(self.np_random, np.array([True]), goals)
        return self._arms.observations()[0], {}

    def step(self, action: Floats) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """A step of 20 ms. `info["is_success"]`: the tip is within 10 mm of its goal."""
        rewards, near = self._arms.step(np.asarray(action, dtype=np.float32)[None])
        seen = self._arms.observations()[0]
        return seen, float(rewards[0]), False, False, {"is_success": bool(near[0])}


class ReachEnv(_ArmEnv):
    """Bring the tip of one arm to a point, and hold it there."""

    is_moving = False


class TrackEnv(_ArmEnv):
    """Let the tip of one arm follow a point on a circle."""

    is_moving = True


class _ArmVectorEnv(VectorEnv[Floats, Floats, NDArray[Any]]):
    """Many arms, each with an episode of its own."""

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}
    is_moving: ClassVar[bool]

    def __init__(
        self,
        num_envs: int = 1,
        *,
        disturbed: bool = False,
        max_episode_steps: int = 150,
        threads: int | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.num_envs, self.render_mode = num_envs, render_mode
        self.max_episode_steps = max_episode_steps
        self._arms = _Arms(num_envs, is_moving=self.is_moving, disturbed=disturbed, threads=threads)
        self._ended = np.zeros(num_envs, dtype=np.bool_)
        self._own_random: list[np.random.Generator] = []
        self.single_observation_space = self._arms.observation_space
        self.single_action_space = self._arms.action_space
        batch = gymnasium.vector.utils.batch_space
        self.observation_space = batch(self.single_observation_space, num_envs)
        self.action_space = batch(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Begins an episode of each arm. `options={"goals": array}` sets the goals, (n, 3) in millimetres.

        All arms draw from one seed. With a list of n seeds each arm draws what a single environment with that seed draws; `None`
        in the list is a random seed. Without a seed the random numbers go on.
        """
        if isinstance(seed, (int, np.integer)):
            super().reset(seed=int(seed))
            self._own_random = []
        elif seed is not None:
            if len(seed) != self.num_envs:
                raise InvalidValue(f"seed: here are {len(seed)}: use one whole number, or one for each of {self.num_envs} arms")
            numbers = [None if one is None else int(one) for one in seed]
            self._own_random = [np_random(number)[0] for number in numbers]
        goals = (options or {}).get("goals")
        everything = np.ones(self.num_envs, dtype=np.bool_)
        self._ended[:] = False
        self._begin(everything, None if goals is None else _checked("goals", goals, (self.num_envs, 3)))
        return self._arms.observations(), {}

    def _begin(self, mask: Flags, goals: Floats | None = None) -> None:
        if not self._own_random:
            self._arms.reset(self.np_random, mask, goals)
            return
        for arm in np.flatnonzero(mask):
            self._arms.reset(self._own_random[arm], np.arange(self.num_envs) == arm, goals)

    def step(
        self, actions: Floats
    ) -> tuple[Floats, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """A step of 20 ms. An arm whose episode was over at the last step begins the next one instead."""
        begun = self._ended
        rewards, near = self._arms.step(np.asarray(actions, dtype=np.float32))
        if begun.any():
            self._begin(begun)
            rewards[begun], near[begun] = 0, False
        self._ended = self._arms.steps >= self.max_episode_steps
        never = np.zeros(self.num_envs, dtype=np.bool_)
        info = {"is_success": near, "_is_success": ~begun}
        return self._arms.observations(), rewards.astype(np.float64), never, self._ended.copy(), info


class ReachVectorEnv(_ArmVectorEnv):
    """Bring the tips of many arms to points, and hold them there."""

    is_moving = False


class TrackVectorEnv(_ArmVectorEnv):
    """Let the tips of many arms follow points on circles."""

    is_moving = True


for _task in ("Reach", "Track"):
    gymnasium.register(
        id=f"sevenbot/{_task}-v0",
        entry_point=f"sevenbot.gym:{_task}Env",
        vector_entry_point=f"sevenbot.gym:{_task}VectorEnv",
        max_episode_steps=150,
    )
