"""Tries a policy of train_reach.py on an arm: a real one, the emulated firmware, or a simulated one.

    python python/examples/try_reach.py reach_policy.npy --port /dev/ttyUSB0
    cargo xtask emulate --link ./7bot                # in another terminal, and then --port ./7bot

For each goal the arm starts in the pose of rest. Then the policy reads the arm and sends an action each 20 ms, for 1.5 s. The
guard is off: keep clear of the arm, and keep its surroundings free. Without a port the arm is simulated.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import sevenbot
import train_reach
from sevenbot.gym import DT, NEAR_MM, REST, SIZES, TURN, sample_goal

Array = train_reach.Array
SPEED = 60
"""The factory setting, in steps of 1.9 degrees per second."""
READ_TIME = 0.009
"""What a read and the policy need at most, in seconds: at 115200 baud the read takes 6 ms."""


def tip_of(observed: sevenbot.Observation) -> Array:
    """The tip by the measured angles, in millimetres."""
    return np.array(sevenbot.forward([float(angle) for angle in observed.positions]).tip, dtype=np.float32)


def observation(observed: sevenbot.Observation, goal: Array) -> Array:
    """The observation, in the form of the environment for Gymnasium."""
    tip = tip_of(observed)
    numbers = np.concatenate([observed.positions, observed.velocities, observed.loads, tip]) / SIZES
    return np.concatenate([numbers, (goal - tip) / 100, [0]]).astype(np.float32)


def reach(arm: sevenbot.Arm, policy: Array, goal: Array) -> float:
    """Lets the policy bring the tip to the goal. Returns how far from it the tip is in the end, in millimetres."""
    arm.pose([float(angle) for angle in REST], speed=38)
    # The speed registers also limit a stream. The policy has learned with this speed.
    arm.set("speed", SPEED)
    targets = REST.astype(np.float64)
    with arm.stream(DT, guard=False) as stream:
        stream.send(targets)
        for _ in range(train_reach.STEPS):
            observed = late_in_the_period(arm)
            action = train_reach.act(policy[None], observation(observed, goal)[None])[0]
            targets[:5] = np.clip(targets[:5] + TURN * np.clip(action, -1, 1), 0, 180)
            # The linkage keeps joints 2 and 3 together.
            linkage = np.clip(targets[1] + targets[2] - 65, 19, 161)
            targets[2] = np.clip(linkage + 65 - targets[1], 0, 180)
            stream.send(targets)
        return float(np.linalg.norm(tip_of(late_in_the_period(arm)) - goal))


def late_in_the_period(arm: sevenbot.Arm) -> sevenbot.Observation:
    """What is measured shortly before the next point is due: the policy has learned with this."""
    arm.sleep(DT - READ_TIME)
    return arm.observe()


def main() -> None:
    parser = argparse.ArgumentParser(description="Tries a reach policy on an arm.")
    parser.add_argument("policy", help="what train_reach.py has saved")
    parser.add_argument("--port", help="the arm; without it, a simulated one")
    parser.add_argument("--goals", type=int, default=20)
    options = parser.parse_args()
    policy: Array = np.load(options.policy)
    random = np.random.default_rng(20_000)
    with sevenbot.Arm.simulated() if options.port is None else sevenbot.Arm(options.port) as arm:
        arm.sleep(1)
        distances = []
        start = time.perf_counter()
        for number in range(1, options.goals + 1):
            goal = np.array(sample_goal(random), dtype=np.float32)
            distances.append(reach(arm, policy, goal))
            print(f"goal {number}: {distances[-1]:5.1f} mm away", flush=True)
        near = np.mean(np.array(distances) < NEAR_MM)
        print(f"{near:.0%} of {options.goals} goals within {NEAR_MM:.0f} mm, median {np.median(distances):.1f} mm, {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
