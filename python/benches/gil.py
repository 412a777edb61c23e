"""What the interpreter's lock costs: reads of all positions alone, and beside a Python thread that computes.

    cargo run --release -p host-sim -- --link /tmp/arm --unpaced
    python python/benches/gil.py /tmp/arm

`in the thread` reads in `Arm.sample`, without Python between two reads. `one call each` reads in a Python loop.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import sevenbot

READS = 2_000


@dataclass
class Spinner:
    """A Python thread that counts."""

    count: int = 0
    ends: bool = False

    def run(self) -> None:
        while not self.ends:
            self.count += 1


def spinning(work: Callable[[], None]) -> tuple[float, float]:
    """The seconds of `work` beside a spinner, and the rate of the spinner in counts a second."""
    spinner = Spinner()
    thread = threading.Thread(target=spinner.run)
    thread.start()
    start = time.perf_counter()
    work()
    seconds = time.perf_counter() - start
    count = spinner.count
    spinner.ends = True
    thread.join()
    return seconds, count / seconds


def alone(work: Callable[[], None]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main() -> None:
    with sevenbot.Arm(sys.argv[1]) as arm:
        _, spinner = spinning(lambda: time.sleep(2))

        def bulk() -> None:
            arm.sample(READS)

        def calls(reads: int = READS) -> None:
            for _ in range(reads):
                arm.get("present-position")

        print(f"{'reads':<16}{'alone':>10}{'beside a spinner':>20}{'spinner keeps':>16}")
        for name, work, count in [
            ("in the thread", bulk, READS),
            ("one call each", calls, READS),
        ]:
            rate = count / alone(work)
            seconds, kept = spinning(work)
            print(f"{name:<16}{rate:>7.0f} Hz{count / seconds:>17.0f} Hz{kept / spinner:>15.0%}")


if __name__ == "__main__":
    main()
