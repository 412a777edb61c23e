"""What leads the arm now. Commands and goals set it, and the thread of the arm follows it.

Knows neither ROS nor the stream.
"""

from __future__ import annotations

from sevenbot_ros.commands import Refusal, Targets
from sevenbot_ros.interlock import Interlock
from sevenbot_ros.lead import CommandLead, Lead
from sevenbot_ros.settings import Settings


class LeadSlot:
    """One lead at a time, as long as the interlock allows one."""

    def __init__(self, settings: Settings, interlock: Interlock) -> None:
        self._settings, self._interlock = settings, interlock
        self._lead: Lead | None = None

    def command(self, targets: Targets) -> Refusal | None:
        """Follows these targets, or returns why commands are refused. Refusals of a target, such as a jump, come as events."""
        with self._interlock.lock:
            if refusal := self._interlock.refusal():
                return refusal
            if self._lead is not None and not isinstance(self._lead, CommandLead):
                return Refusal("trajectory", "a trajectory is running: cancel it first")
            if self._lead is None:
                self._lead = CommandLead(self._settings)
            self._lead.command(targets)
            return None

    def lead(self, lead: Lead) -> Refusal | None:
        """Lets this lead the arm from the next point on, and ends the lead before it. Returns a reason if this is refused."""
        with self._interlock.lock:
            if refusal := self._interlock.refusal():
                return refusal
            if self._lead is not None:
                if not self._lead.gives_way_to(lead):
                    return Refusal("busy", "a trajectory of other joints is running: wait for its end, or cancel it")
                self._lead.end("another one replaces it")
            self._lead = lead
            return None

    @property
    def current(self) -> Lead | None:
        """What leads the arm."""
        return self._lead

    def allowed(self) -> Lead | None:
        """What leads the arm; `None` if nothing does. If the interlock refuses commands now, ends the lead and returns `None`."""
        with self._interlock.lock:
            lead, refusal = self._lead, self._interlock.refusal()
            if refusal is not None:
                self._lead = None
        if lead is not None and refusal is not None:
            lead.end(refusal.text)
        return lead if refusal is None else None

    def end(self, lead: Lead | None, reason: str) -> None:
        """Ends this lead, and empties the slot unless another lead is in it."""
        if lead is None:
            return
        lead.end(reason)
        with self._interlock.lock:
            if self._lead is lead:
                self._lead = None
