"""What a mission writes down of itself: each entry once, in the log of the run."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

from patrol_policy.idleness_bounds import IdlenessBound
from strict_files.files import FileError
from surveillance_behaviour.mission.mission_log import CutOff, InspectionLog, MissionRecord

Spot = Sequence[float]


class MissionNotes:
    """Writes the entries of one mission, where there is a record.

    Args:
        record: The log; None: nothing is written.
        now: Returns the seconds on the mission's clock.
        complain: Takes a line about a record that cannot be written, once for each cause.

    Attributes:
        looked: What was looked at in each place.
        goes_on: Whether an earlier run of the same record is gone on with.
    """

    def __init__(
        self,
        record: MissionRecord | None,
        now: Callable[[], float],
        complain: Callable[[str], object],
    ) -> None:
        self._record, self._now, self._complain = record, now, complain
        self.looked = InspectionLog(None if record is None else record.looked.to_json())
        self.goes_on = record is not None and record.is_begun
        self._cut_off = None if record is None else record.left_at
        self._is_begun = False
        self._places: frozenset[str] = frozenset()
        self._threshold = 0.0
        self._idleness_bounds: Sequence[IdlenessBound] = ()
        self._complaint = ''

    @property
    def is_begun(self) -> bool:
        """Whether the start is written."""
        return self._is_begun

    def start(
        self, machine: str, place: str, places: frozenset[str], threshold: float
    ) -> CutOff | None:
        """Write that the mission begins; return where an earlier one was cut off.

        Args:
            machine: Name of the machine.
            place: Where the robot is.
            places: All that are to be patrolled.
            threshold: Seconds after which a place is URGENT.
        """
        self._is_begun, self._places, self._threshold = True, places, threshold
        self.write(
            'start',
            machine=machine,
            place=place,
            places=sorted(places),
            urgency_threshold=threshold,
        )
        before, self._cut_off = self._cut_off, None
        return before

    def decided(
        self, place: str, rule: str, reason: str, places: frozenset[str], threshold: float
    ) -> None:
        """Write a decision, and what has changed since the one before.

        Args:
            place, rule, reason: Of the decision.
            places: All that are to be patrolled.
            threshold: Seconds after which a place is URGENT.
        """
        if places != self._places:
            self._places = places
            self.write('map', places=sorted(places))
        changed = {} if threshold == self._threshold else {'urgency_threshold': threshold}
        self._threshold = threshold
        self.write('decision', place=place, rule=rule, reason=reason, **changed)

    def idleness_bounds(self, found: Sequence[IdlenessBound]) -> None:
        """Write what can be kept of the places, once its verdicts have changed."""
        if _verdicts(found) == _verdicts(self._idleness_bounds):
            return
        self._idleness_bounds = found
        self.write('idleness_bounds', places=[_plain(each) for each in found])

    def visited(
        self, place: str, distance: float, path: Sequence[Spot], driven: Sequence[Spot]
    ) -> None:
        """Write that the robot has come to a place.

        Args:
            place: Which one.
            distance: Metres driven.
            path: What was planned; may be empty.
            driven: Where the robot was; empty where nobody tells.
        """
        planned = {'path': _rounded(path)} if path else {}
        self.write('visit', place=place, distance=distance, **planned, **_driven(driven))

    def failed(self, what: str, reason: str, driven: Sequence[Spot]) -> None:
        """Write what did not work."""
        self.write('failure', what=what, reason=reason, **_driven(driven))

    def write(self, event: str, /, **fields: object) -> None:
        """Write an entry once the mission has begun, failures always."""
        if self._record is None or not (self._is_begun or event == 'failure'):
            return
        try:
            self._record.write(event, self._now(), **fields)
        except FileError as error:
            # A full disk is no reason to stop patrolling; once is enough to say so.
            if str(error) != self._complaint:
                self._complaint = str(error)
                self._complain(self._complaint)
        else:
            self._complaint = ''


def _verdicts(bounds: Iterable[IdlenessBound]) -> dict[str, str]:
    return {each.place: each.verdict for each in bounds}


def _plain(bound: IdlenessBound) -> dict[str, object]:
    """Return an idleness bound as JSON has it; null: without an end."""
    return {
        name: None if isinstance(value, float) and math.isinf(value) else value
        for name, value in vars(bound).items()
    }


def _driven(points: Sequence[Spot]) -> dict[str, list[list[float]]]:
    return {'driven': _rounded(points)} if points else {}


def _rounded(points: Sequence[Spot]) -> list[list[float]]:
    """Return points as a record has them: x and y in whole centimetres."""
    return [[round(x, 2), round(y, 2)] for x, y, *_ in points]
