"""What to do after a failure: another path, another place, back, or wait for help.

The steps escalate. A peer that was lost and is there again, as after a restart, costs a new choice.
Whatever else fails is tried again on another path; then its place is left alone for a while and
another one is chosen; when that fails several times in a row, something is wrong with where the
robot is, so it goes back to the last place it knows it was in; and when not even that helps, it
waits for help. It never gives up: the pauses grow up to a limit, and after each the steps begin
anew.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum

from strict_files.settings import parameter

WAITING_FOR_HELP = 'waiting for help'
"""How the line of the log begins by which the robot asks for somebody."""
DOUBLINGS = 30
"""More doublings of a time than this are not worth counting."""


class Step(StrEnum):
    """What to do next; the values are the outcomes of the machines' recovery state."""

    CHOOSE_ANEW = 'choose_anew'
    ANOTHER_PATH = 'another_path'
    ANOTHER_PLACE = 'another_place'
    GO_BACK = 'go_back'
    WAIT_FOR_HELP = 'wait_for_help'


@dataclass(frozen=True)
class RecoveryLimits:
    """How patient the recovery is.

    Attributes:
        avoid_seconds: How long a place that was given up is left alone at first; doubled each
            time it is given up again.
    """

    path_tries: int = parameter(3, 'Times a place is tried before another one is chosen.', 1, 1000)
    place_tries: int = parameter(3, 'Places given up in a row before the robot goes back.', 1, 1000)
    avoid_seconds: float = parameter(
        60.0, 'How long a place that was given up is left alone at first, s.', 0.0, 86_400.0
    )
    longest_avoid: float = parameter(
        600.0, 'The longest time a place is left alone, s.', 0.0, 86_400.0
    )
    help_seconds: float = parameter(
        2.0, 'The first pause while waiting for help, s.', 0.0, 86_400.0
    )
    longest_help: float = parameter(
        60.0, 'The longest pause while waiting for help, s.', 0.0, 86_400.0
    )


@dataclass(frozen=True)
class Failure:
    """Something did not work.

    Attributes:
        what: The state in which it happened.
        reason: One line.
        goal: The place that was not reached; None: the failure has nothing to do with a place.
        charging: The place was reached, but the battery is not charged there.
        is_over: Whether what failed may work again, as when a peer has come back; None: only
            another try tells.
    """

    what: str
    reason: str
    goal: str | None = None
    charging: bool = False
    is_over: Callable[[], bool] | None = None


@dataclass
class Recovery:
    """Remembers what failed lately, and says what to do."""

    limits: RecoveryLimits = field(default_factory=RecoveryLimits)
    _tries: Counter[str] = field(default_factory=Counter)
    _charge_tries: Counter[str] = field(default_factory=Counter)
    _given_up: Counter[str] = field(default_factory=Counter)
    _avoided_until: dict[str, float] = field(default_factory=dict)
    _in_a_row: int = 0
    _went_back: bool = False
    _pauses: int = 0
    _chosen_anew: int = 0

    def tries(self, goal: str) -> int:
        """Return how often ``goal`` failed since it last worked or was given up."""
        return self._tries[goal]

    def next_step(self, failure: Failure, now: float, *, may_go_back: bool = True) -> Step:
        """Return what to do after ``failure``.

        Args:
            failure: What happened.
            now: Seconds on the mission's clock.
            may_go_back: False when going back is what failed, or makes no sense.
        """
        goal = failure.goal
        if goal is None:
            is_over = failure.is_over is not None and failure.is_over()
            if not is_over or self._chosen_anew + 1 >= self.limits.path_tries:
                return Step.WAIT_FOR_HELP
            self._chosen_anew += 1
            return Step.CHOOSE_ANEW
        tries = self._charge_tries if failure.charging else self._tries
        tries[goal] += 1
        if tries[goal] % self.limits.path_tries:
            return Step.ANOTHER_PATH
        self._avoid(goal, now)
        if failure.charging:
            return Step.WAIT_FOR_HELP
        del tries[goal]
        self._in_a_row += 1
        if self._in_a_row < self.limits.place_tries:
            return Step.ANOTHER_PLACE
        if may_go_back and not self._went_back:
            self._went_back = True
            return Step.GO_BACK
        return Step.WAIT_FOR_HELP

    def _avoid(self, goal: str, now: float) -> None:
        seconds = self.limits.avoid_seconds * 2.0 ** min(self._given_up[goal], DOUBLINGS)
        self._avoided_until[goal] = now + min(seconds, self.limits.longest_avoid)
        self._given_up[goal] += 1

    def avoided(self, now: float) -> frozenset[str]:
        """Return places that are left alone at present."""
        # Later than the longest time from now: the clock has begun anew.
        latest = now + self.limits.longest_avoid
        until = self._avoided_until
        return frozenset(place for place in tuple(until) if now < until.get(place, now) <= latest)

    def arrived(self, place: str) -> None:
        """Note that a place was reached."""
        self._in_a_row = self._chosen_anew = 0
        self._went_back = False
        if not self._charge_tries:
            self._pauses = 0
        if place not in self._charge_tries:
            self._forget(place)

    def charged(self, place: str) -> None:
        """Note that the battery was charged in ``place``."""
        self._charge_tries.clear()
        self._pauses = 0
        self._forget(place)

    def _forget(self, place: str) -> None:
        for memory in (self._tries, self._given_up, self._avoided_until):
            memory.pop(place, None)

    def pause(self) -> float:
        """Return the seconds to wait for help now; after them all steps are open again."""
        seconds = min(
            self.limits.help_seconds * 2.0 ** min(self._pauses, DOUBLINGS), self.limits.longest_help
        )
        self._pauses += 1
        self._in_a_row = self._chosen_anew = 0
        self._went_back = False
        self._tries.clear()
        return seconds
