"""The example with Ray: two workers do what one process does.

`cargo xtask test --long` installs Ray and runs this file. The other steps leave it out.
"""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy
import pytest

ray = pytest.importorskip("ray")
pytest.importorskip("gymnasium")

EXAMPLES = Path(__file__).parents[1] / "examples"


def test_two_workers_give_the_rewards_of_one_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(EXAMPLES)
    # The workers import the example, too.
    monkeypatch.setenv("PYTHONPATH", str(EXAMPLES))
    train_reach = importlib.import_module("train_reach")
    with_ray = importlib.import_module("train_reach_ray")
    ray.init(num_cpus=2, include_dashboard=False, configure_logging=False)
    try:
        evolution = train_reach.Evolution(3)
        policies, goals = evolution.policies(), evolution.goals()
        workers = with_ray.start(2)
        shared = with_ray.rewards(workers, policies, 1, goals)
        again = with_ray.rewards(workers, policies, 1, goals)
    finally:
        ray.shutdown()
    envs = train_reach.environments(2 * train_reach.PAIRS)
    alone, _ = train_reach.run(envs, policies, 1, goals)
    envs.close()
    assert numpy.array_equal(shared, alone) and numpy.array_equal(again, alone)
    assert len(set(alone.tolist())) > 200
