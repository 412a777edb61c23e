"""What the interpreter's lock costs: reads of all positions alone, and beside a Python thread that computes.

    taskset --cpu-list 0 cargo run --release -p host-sim -- --link /tmp/arm
    python python/benches/gil.py /tmp/arm

`in the thread` reads in `Arm.sample`, without Python between two reads. `one call each` reads in a Python loop. Each
figure is a median of several runs. In brackets is the range from the worst to the best run.
"""

from __future__ import annotations

import statistics
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import sevenbot

READS = 600
RUNS = 9
# Switch intervals of the interpreter, in seconds: CPython's default, and a shorter one.
INTERVALS = (0.005, 0.0001)


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


def shown(rates: list[float]) -> str:
    """The median and the range of rates, as text. Each rate is a part of the rate without the other thread."""
    return f"{statistics.median(rates):.0%} ({min(rates):.0%} to {max(rates):.0%})"


def main() -> None:
    with sevenbot.Arm(sys.argv[1]) as arm:

        def bulk() -> None:
            arm.sample(READS)

        def calls() -> None:
            for _ in range(READS):
                arm.get("present-position")

        print(f"{'reads':<16}{'interval':>9}{'alone':>10}{'beside':>10}{'link keeps':>24}{'spinner keeps':>24}")
        for name, work, interval in [
            ("in the thread", bulk, INTERVALS[0]),
            *(("one call each", calls, interval) for interval in INTERVALS),
        ]:
            sys.setswitchinterval(interval)
            rates, links, spinners = [], [], []
            for _ in range(RUNS):
                _, counts = spinning(lambda: time.sleep(1))
                rate = READS / alone(work)
                seconds, kept = spinning(work)
                rates.append(rate)
                links.append(READS / seconds / rate)
                spinners.append(kept / counts)
            rate = statistics.median(rates)
            print(
                f"{name:<16}{interval * 1_000:>6} ms{rate:>7.0f} Hz{rate * statistics.median(links):>7.0f} Hz"
                f"{shown(links):>24}{shown(spinners):>24}",
                flush=True,
            )


if __name__ == "__main__":
    main()
