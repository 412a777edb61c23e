"""Steps of 20 ms that simulated arms make in a second: `python python/benches/arms.py` prints the table of docs/simulation.md.

With a file of `sevenbot model --format mjcf --out arm.xml` as the argument, and the package `mujoco`, it also measures MuJoCo.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np

import sevenbot

REST = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0]
SECONDS = 3.0


def rate(step: Callable[[int], None], arms: int) -> tuple[float, float]:
    """Arm-steps per second of wall-clock time, and per second of processor time."""
    step(0)
    start, used, steps = time.perf_counter(), time.process_time(), 0
    while time.perf_counter() - start < SECONDS:
        steps += 1
        step(steps)
    done = steps * arms
    return done / (time.perf_counter() - start), done / (time.process_time() - used)


def without_frames(count: int, threads: int) -> tuple[float, float]:
    """The same motion with one point per second and without reads, to measure the arms without frames."""
    arms = sevenbot.SimulatedArms(count, threads=threads)
    actions, inside, wanted = np.tile(REST, (count, 1)), np.full((count, 21), np.nan), np.empty((count, 21))

    def step(number: int) -> None:
        if number % 50 == 0:
            actions[:, 0] = 90 + 20 * np.sin(number / 25)
            arms.send(actions, 1.0)
        arms.exchange(inside, 0.02, wanted)

    return rate(step, count)


def ours(count: int, threads: int) -> tuple[float, float]:
    """All arms follow a sine with joint 1: a point and a read in each step."""
    arms = sevenbot.SimulatedArms(count, threads=threads)
    actions, seen = np.tile(REST, (count, 1)), arms.observe()

    def step(number: int) -> None:
        actions[:, 0] = 90 + 20 * np.sin(number / 25)
        arms.step(actions, 0.02, seen)

    return rate(step, count)


def mujoco_alone(model_file: str) -> tuple[float, float]:
    """One arm in MuJoCo. A step of 20 ms consists of as many of MuJoCo's own timesteps as needed."""
    import mujoco  # type: ignore[import-untyped,unused-ignore]

    model = mujoco.MjModel.from_xml_path(model_file)
    data = mujoco.MjData(model)
    substeps = round(0.02 / model.opt.timestep)

    def step(number: int) -> None:
        if model.nu:
            data.ctrl[0] = 0.3 * np.sin(number / 25)
        mujoco.mj_step(model, data, substeps)

    return rate(step, 1)


def main() -> None:
    print("Arm-steps of 20 ms a second of the clock, and of the processor:\n")
    print("| arms | threads | frames | of the processor | without frames | of the processor |")
    print("| --: | --: | --: | --: | --: | --: |")
    for count in (1, 100, 1_000, 10_000):
        for threads in (1, 2):
            if threads <= count:
                rates = [*ours(count, threads), *without_frames(count, threads)]
                print(f"| {count:,} | {threads} | " + " | ".join(f"{rate:,.0f}" for rate in rates) + " |", flush=True)
    for model in sys.argv[1:]:
        wall, processor = mujoco_alone(model)
        print(f"| MuJoCo, 1 | 1 | | | {wall:,.0f} | {processor:,.0f} |")


if __name__ == "__main__":
    main()
