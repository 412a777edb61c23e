"""The training of train_reach.py on several processes, or computers, with Ray.

    pip install "./python[gym]" ray
    python python/examples/train_reach_ray.py --workers 2

Each worker has arms of its own. It gets policies and goals, and returns the sums of rewards. A step of evolution is the same, whatever
the number of workers. On a cluster of Ray (`ray start`) the workers are on all its computers; each needs this package.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np
import ray
from numpy.typing import NDArray

import train_reach

Array = NDArray[np.float32]


@ray.remote
class Worker:
    """Arms in a process of their own."""

    def __init__(self, count: int) -> None:
        """Starts `count` arms, on one thread."""
        self.envs = train_reach.environments(count, threads=1)

    def run(self, policies: Array, seed: int, goals: Array) -> Array:
        """The sum of rewards of each policy."""
        return train_reach.run(self.envs, policies, seed, goals)[0]


def start(workers: int) -> list[Any]:
    """Workers that share the arms of a generation."""
    count = 2 * train_reach.PAIRS // workers
    return [Worker.remote(count) for _ in range(workers)]  # type: ignore[attr-defined]


def rewards(workers: list[Any], policies: Array, seed: int, goals: Array) -> Array:
    """The sum of rewards of each policy. Worker n takes the n-th part of them."""
    parts = zip(workers, np.split(policies, len(workers)), np.split(goals, len(workers)), strict=True)
    results = [worker.run.remote(policies, seed, goals) for worker, policies, goals in parts]
    return np.concatenate(ray.get(results))


def main() -> None:
    parser = argparse.ArgumentParser(description="Trains a reach policy on arms of several processes.")
    parser.add_argument("--workers", type=int, default=2, help="a divisor of 256")
    parser.add_argument("--generations", type=int, default=120)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--save", default="reach_policy.npy")
    options = parser.parse_args()
    ray.init(include_dashboard=False)
    workers = start(options.workers)
    evolution = train_reach.Evolution(options.seed)
    started = time.perf_counter()
    for generation in range(1, options.generations + 1):
        policies, goals = evolution.policies(), evolution.goals()
        total = rewards(workers, policies, generation, goals)
        evolution.learn(total)
        if generation % 10 == 0:
            print(f"{generation:4} {time.perf_counter() - started:6.1f} s  mean reward {total.mean():7.2f}", flush=True)
    np.save(options.save, evolution.policy)
    ray.shutdown()


if __name__ == "__main__":
    main()
