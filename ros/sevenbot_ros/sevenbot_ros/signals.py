"""SIGINT and SIGTERM, noted for the main loop.

The handlers of rclpy end the context at once: then the thread of the arm can neither publish nor close the arm in order.
"""

from __future__ import annotations

import signal


class EndSignals:
    """Notes the signals that end a program, instead of their usual effect."""

    def __init__(self) -> None:
        # A plain attribute, because a lock could be held when a second signal comes.
        self.have_come = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def _note(self, *_: object) -> None:
        self.have_come = True
