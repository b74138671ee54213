"""Looking around until the map is whole, or until a deadline.

First the arm's poses; then whole scans around the horizon, each with more overlap, a further reach
up and down and a longer rest than the one before, so that a marker missed at the edge of a picture,
at a flat angle or in poor light has another chance from a slightly different view.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from surveillance_behaviour.map_from_markers.survey import SurveyReport

_OVERLAP = 0.12
_REACH = 0.3


class Eyes(Protocol):
    """What turns the camera. Each blocks until the camera has rested and its pictures were seen."""

    def pose(self, number: int) -> None:
        """Take one of the arm's poses and look."""

    def scan(self, overlap: float, reach: float, dwell: float, done: Callable[[], bool]) -> None:
        """Look all around, `reach` rad above and below the horizon.

        `done` is asked after each view and ends the scan.
        """

    def home(self) -> None:
        """Fold the arm for driving."""


@dataclass
class LookingAround:
    """How to look around.

    Attributes:
        poses: Numbers of the poses, in order.
        deadline: Seconds after which what was found has to do; may change while it runs.
        dwell: Rest at each view of the first scan, seconds.
    """

    poses: Sequence[int] = (1, 2, 3, 4)
    deadline: float = 45.0
    dwell: float = 0.5

    def run(
        self,
        eyes: Eyes,
        judge: Callable[[], SurveyReport],
        now: Callable[[], float],
        say: Callable[[str], None],
        stopping: Callable[[], bool],
    ) -> SurveyReport:
        """Look until everything fits, the deadline has passed and there is something to patrol.

        Args:
            eyes: What turns the camera.
            judge: What has been found so far.
            now: Seconds.
            say: Told what goes on.
            stopping: Tells whether to give up.
        """
        begin = now()

        def late() -> bool:
            return now() - begin >= self.deadline

        def enough() -> bool:
            report = judge()
            return stopping() or report.complete or (late() and bool(report.places))

        for number in self.poses:
            eyes.pose(number)
            if enough():
                break
        overlap, reach, dwell, told = _OVERLAP, _REACH, self.dwell, False
        while not enough():
            for sentence in judge().sentences():
                say(f'looking on: {sentence}')
            eyes.scan(overlap, reach, dwell, enough)
            overlap = min(overlap + _OVERLAP, 0.5)
            reach = min(reach * 1.5, 1.2)
            dwell = min(dwell * 2.0, 4.0 * self.dwell)
            if late() and not judge().places and not told:
                told = True
                say('nothing to patrol was found yet; looking on')
        if not stopping():
            eyes.home()
        return judge()
