"""The environments for Gymnasium."""

from __future__ import annotations

import contextlib
import math
from typing import Any

import numpy
import pytest

gymnasium = pytest.importorskip("gymnasium")
env_checker = pytest.importorskip("gymnasium.utils.env_checker")

import sevenbot.gym  # noqa: E402

TASKS = ["Reach", "Track"]


def environment(task: str) -> str:
    """The name of a task, and the module that registers it."""
    return f"sevenbot.gym:sevenbot/{task}-v0"


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("disturbed", [False, True])
@pytest.mark.filterwarnings("ignore:.*(observation space (minimum|maximum) value|not enough data)")
def test_gymnasium_accepts_an_environment(task: str, disturbed: bool) -> None:
    env = gymnasium.make(environment(task), disturbed=disturbed)
    env_checker.check_env(env.unwrapped, skip_render_check=True)
    env.close()


def episode(envs: Any, seed: int) -> list[Any]:
    """The observations, rewards and truncations of 60 steps."""
    rows = [envs.reset(seed=seed)[0]]
    actions = numpy.random.default_rng(1).uniform(-1, 1, (60, envs.num_envs, 5)).astype(numpy.float32)
    for action in actions:
        seen, rewards, terminated, truncated, _ = envs.step(action)
        assert envs.observation_space.contains(seen) and not terminated.any()
        rows += [seen, rewards, truncated]
    return [row.tolist() for row in rows]


@pytest.mark.parametrize("task", TASKS)
def test_a_seed_determines_all_episodes_whatever_the_threads(task: str) -> None:
    runs = []
    for threads in (1, 3):
        # Two episodes and a part of a third: each reset of an arm is a step.
        options = {"disturbed": True, "max_episode_steps": 25, "threads": threads}
        envs = gymnasium.make_vec(environment(task), 20, vectorization_mode="vector_entry_point", **options)
        runs.append(episode(envs, 4))
        envs.close()
    assert runs[0] == runs[1]
    assert [any(row) for row in runs[0][3::3]].count(True) == 2


def test_the_tip_reaches_a_goal_by_inverse_kinematics() -> None:
    env = gymnasium.make(environment("Reach"))
    wanted = numpy.array([110.0, 80, 75, 95, 100])
    goal = sevenbot.forward([*wanted, 90, 80]).tip
    env.reset(seed=1, options={"goal": goal})
    targets = numpy.array(sevenbot.gym.REST[:5], dtype=float)
    info: dict[str, Any] = {}
    for _ in range(149):
        action = numpy.clip((wanted - targets) / sevenbot.gym.TURN, -1, 1).astype(numpy.float32)
        targets += action * sevenbot.gym.TURN
        _, reward, _, truncated, info = env.step(action)
        assert not truncated
    assert info["is_success"] and reward > -0.1


def test_each_arm_has_its_own_disturbances() -> None:
    envs = sevenbot.gym.ReachVectorEnv(30, disturbed=True)
    goals = numpy.tile([0.0, 250, 200], (30, 1))
    envs.reset(seed=2, options={"goals": goals})
    for _ in range(50):
        seen = envs.step(numpy.full((30, 5), 0.5, dtype=numpy.float32))[0]
    assert len({tuple(row) for row in seen[:, :7].tolist()}) > 20


def test_a_wrong_number_of_actions_is_said() -> None:
    with pytest.raises(ValueError, match="shape"):
        sevenbot.gym.ReachVectorEnv(3).step(numpy.zeros((2, 5), dtype=numpy.float32))


def test_a_wrong_action_changes_nothing() -> None:
    env, other = sevenbot.gym.ReachEnv(), sevenbot.gym.ReachEnv()
    for each in (env, other):
        each.reset(seed=1)
    action = numpy.full(5, 0.5, dtype=numpy.float32)
    for wrong in ([0, 0, float("nan"), 0, 0], [float("inf")] * 5, [0, 0, 0]):
        with pytest.raises(ValueError, match="finite|shape"):
            env.step(numpy.array(wrong, dtype=numpy.float32))
        assert env.step(action)[0].tolist() == other.step(action)[0].tolist()


@pytest.mark.parametrize("disturbed", [False, True])
def test_each_of_several_seeds_counts(disturbed: bool) -> None:
    seeds: list[int | None] = [5, 1, 5]
    envs = sevenbot.gym.ReachVectorEnv(3, disturbed=disturbed, max_episode_steps=20)
    alone = [sevenbot.gym.ReachEnv(disturbed=disturbed) for _ in seeds]
    action = numpy.full((3, 5), 0.5, dtype=numpy.float32)
    seen = envs.reset(seed=seeds)[0]
    assert seen.tolist() == [env.reset(seed=seed)[0].tolist() for env, seed in zip(alone, seeds)]
    for step in range(45):
        # An episode has 20 steps, and the reset after it takes the place of a step.
        over = step in (20, 41)
        seen = envs.step(action)[0]
        wanted = [env.reset()[0] if over else env.step(row)[0] for env, row in zip(alone, action)]
        assert seen.tolist() == numpy.array(wanted).tolist()


def test_seeds_are_checked_and_may_be_of_numpy() -> None:
    envs = sevenbot.gym.ReachVectorEnv(2)
    of_numpy: Any = numpy.int64(3)
    assert envs.reset(seed=of_numpy)[0].tolist() == envs.reset(seed=3)[0].tolist()
    assert envs.reset(seed=[None, 3])[0][1].tolist() == sevenbot.gym.ReachEnv().reset(seed=3)[0].tolist()
    for count in (0, 3):
        with pytest.raises(ValueError, match="one for each of 2 arms"):
            envs.reset(seed=[1] * count)


@pytest.mark.parametrize("goal", [(1, 2, math.nan), 5, (0, 185), "near"])
def test_a_goal_has_three_finite_numbers(goal: object) -> None:
    with contextlib.closing(sevenbot.gym.ReachEnv()) as env:
        with pytest.raises(ValueError, match=r"goal: .*\(3,\)"):
            env.reset(options={"goal": goal})
    with contextlib.closing(sevenbot.gym.ReachVectorEnv(num_envs=2)) as envs:
        with pytest.raises(ValueError, match=r"goals: .*\(2, 3\)"):
            envs.reset(options={"goals": [goal, goal]})
