"""Trains a policy that brings the tip to any point in front of the arm, by evolution with numpy alone.

    pip install "./python[gym]"
    python python/examples/train_reach.py

Each generation tries 128 pairs of policies, one changed by a random step and one by its opposite, and moves the policy towards
the better ones. The two policies of a pair have the same goal. Ctrl-C ends the training early.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import gymnasium
import numpy as np
from numpy.typing import NDArray

import sevenbot.gym

Array = NDArray[np.float32]

PAIRS = 128
STEPS = 75
HIDDEN = 24
SIGMA = 0.05
"""The size of a random step of a weight."""
RATE = 0.03
"""The learning rate."""
# What the policy sees of an observation: joints 1 to 5, their velocities, and the way to the goal.
INPUTS = [0, 1, 2, 3, 4, 7, 8, 9, 10, 11, 24, 25, 26]
SHAPES = [(len(INPUTS) + 1, HIDDEN), (HIDDEN + 1, sevenbot.gym.JOINTS)]
SIZE = sum(rows * columns for rows, columns in SHAPES)


def act(policies: Array, seen: Array) -> Array:
    """The actions of policies, each with an observation of its own."""
    values, start = seen[:, INPUTS], 0
    for rows, columns in SHAPES:
        weights = policies[:, start : start + rows * columns].reshape(-1, rows, columns)
        start += rows * columns
        values = np.tanh(np.einsum("ni,nij->nj", values, weights[:, :-1]) + weights[:, -1])
    return values.astype(np.float32)


def run(
    envs: sevenbot.gym.ReachVectorEnv, policies: Array, seed: int, goals: Array | None
) -> tuple[Array, float]:
    """The sum of rewards of each policy, and the share of arms near their goals at the end."""
    options = None if goals is None else {"goals": goals}
    seen, _ = envs.reset(seed=seed, options=options)
    total, near = np.zeros(envs.num_envs, dtype=np.float32), 0.0
    for _ in range(STEPS):
        seen, rewards, _, _, info = envs.step(act(policies, seen))
        total += rewards.astype(np.float32)
        near = float(info["is_success"].mean())
    return total, near


def environments(count: int, *, disturbed: bool = False, threads: int | None = None) -> sevenbot.gym.ReachVectorEnv:
    """The vector environment with `count` arms."""
    envs = gymnasium.make_vec(
        "sevenbot/Reach-v0",
        num_envs=count,
        vectorization_mode="vector_entry_point",
        disturbed=disturbed,
        threads=threads,
    )
    assert isinstance(envs, sevenbot.gym.ReachVectorEnv)
    return envs


class Evolution:
    """The policy, and the steps that are tried in this generation."""

    def __init__(self, seed: int) -> None:
        """Starts with small random weights."""
        self.random = np.random.default_rng(seed)
        self.policy: Array = (self.random.standard_normal(SIZE) * 0.1).astype(np.float32)
        self.noise: Array = np.zeros((PAIRS, SIZE), dtype=np.float32)
        self.first, self.second = np.zeros(SIZE), np.zeros(SIZE)
        self.generation = 0

    def policies(self) -> Array:
        """The policies of the next generation: 128 changed by a step, then 128 changed by its opposite."""
        self.generation += 1
        self.noise = self.random.standard_normal((PAIRS, SIZE)).astype(np.float32)
        return np.concatenate([self.policy + SIGMA * self.noise, self.policy - SIGMA * self.noise])

    def goals(self) -> Array:
        """A goal for each policy: the two of a pair have the same. The tip can reach all of them."""
        random = np.random.default_rng(self.generation)
        goals = np.array([sevenbot.gym.sample_goal(random) for _ in range(PAIRS)], dtype=np.float32)
        return np.tile(goals, (2, 1))

    def learn(self, total: Array) -> None:
        """Moves the policy towards those with the larger sums of rewards, by Adam."""
        gain = total[:PAIRS] - total[PAIRS:]
        gradient = (gain / (np.abs(gain).mean() + 1e-9)) @ self.noise / PAIRS
        self.first = 0.9 * self.first + 0.1 * gradient
        self.second = 0.99 * self.second + 0.01 * np.square(gradient)
        first = self.first / (1 - 0.9**self.generation)
        second = self.second / (1 - 0.99**self.generation)
        self.policy = (self.policy + RATE * first / (np.sqrt(second) + 1e-8)).astype(np.float32)


def main() -> None:
    parser = argparse.ArgumentParser(description="Trains a reach policy on simulated arms.")
    parser.add_argument("--generations", type=int, default=120)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--disturbed", action="store_true", help="with loads, delays and faults")
    parser.add_argument("--save", default="reach_policy.npy")
    options = parser.parse_args()
    if options.generations < 1:
        parser.error("--generations: use 1 or more")
    folder = Path(options.save).parent
    if not folder.is_dir():
        parser.error(f"--save: there is no folder {folder}")
    envs = environments(2 * PAIRS, disturbed=options.disturbed)
    evolution = Evolution(options.seed)
    start = time.perf_counter()
    try:
        for generation in range(1, options.generations + 1):
            total, near = run(envs, evolution.policies(), generation, evolution.goals())
            evolution.learn(total)
            if generation % 10 == 0:
                passed = time.perf_counter() - start
                words = f"mean reward {total.mean():7.2f}, near {near:.0%}"
                print(f"{generation:4} {passed:6.1f} s  {words}", flush=True)
    except KeyboardInterrupt:
        print("ended early")
    np.save(options.save, evolution.policy)
    total, near = run(envs, np.tile(evolution.policy, (2 * PAIRS, 1)), 10_000, None)
    seconds = STEPS * sevenbot.gym.DT
    print(f"{2 * PAIRS} new goals: {near:.0%} within 10 mm after {seconds:.1f} s; saved {options.save}")
    envs.close()


if __name__ == "__main__":
    main()
