"""The scan at the start: until the map is whole, or until a deadline.

First the arm's poses; then whole scans around the horizon, each with more overlap, a further reach
up and down and a longer rest than the one before, so that a marker missed at the edge of a picture,
at a flat angle or in poor light has another chance from a slightly different view.

The deadline counts once the camera has looked all around: how long that takes is the matter of the
arm, the detector and the rate of time. An arm that does not answer must not hold it up for long:
the first look takes at most two deadlines of real time, whatever the rate.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from strict_files.settings import parameter
from surveillance_behaviour.map_from_markers.assembly import SurveyReport

_OVERLAP = 0.12
_REACH = 0.3
_FIRST_LOOK = 2.0
"""Deadlines of real time that the first look all around takes at most."""


class ScanCamera(Protocol):
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
class ScanProgress:
    """How far a scan has come; it goes on from there after a restart.

    Attributes:
        poses: Numbers of the poses that are done.
        seconds: How long it has looked.
    """

    poses: list[int] = field(default_factory=list)
    seconds: float = 0.0


@dataclass
class InitialScan:
    """How to scan.

    Attributes:
        deadline: Seconds after which what was found has to do, when the camera has looked all
            around; may change while it runs.
    """

    poses: Sequence[int] = parameter((1, 2, 3, 4), "The arm's poses for looking around.", 1, 4)
    deadline: float = parameter(
        45.0,
        'Seconds after which the scan ends, once the camera has looked all around.',
        0.0,
    )
    dwell: float = parameter(0.5, 'Rest at each view of a scan, seconds.', 0.0)

    def run(
        self,
        camera: ScanCamera,
        judge: Callable[[], SurveyReport],
        now: Callable[[], float],
        say: Callable[[str], None],
        stopping: Callable[[], bool],
        progress: ScanProgress | None = None,
        keep: Callable[[], None] = lambda: None,
        real: Callable[[], float] = time.monotonic,
    ) -> SurveyReport:
        """Look until everything fits, the deadline has passed and there is something to patrol.

        Args:
            camera: What turns the camera.
            judge: What has been found so far.
            now: Seconds.
            say: Told what goes on.
            stopping: Tells whether to give up.
            progress: How far it has come before; kept up to date.
            keep: Called whenever there is progress worth keeping.
            real: Seconds of real time.
        """
        progress = progress or ScanProgress()
        begin, real_begin = now() - progress.seconds, real()
        looked_around = False

        def late() -> bool:
            return now() - begin >= self.deadline

        def enough(pose: int | None = None) -> bool:
            report = judge()
            if not stopping():
                # Only now all that was seen at the pose has been asked for.
                progress.poses += [pose] if pose is not None else []
                progress.seconds = now() - begin
                keep()
            is_long = looked_around or real() - real_begin >= _FIRST_LOOK * self.deadline
            will_do = is_long and late() and bool(report.places)
            return stopping() or report.complete or will_do

        begun_before = bool(progress.poses)
        for number in self.poses:
            if begun_before and enough():
                break
            if number not in progress.poses:
                camera.pose(number)
                if enough(number):
                    break
        overlap, reach, dwell, told = _OVERLAP, _REACH, self.dwell, False
        while not enough():
            for sentence in judge().sentences():
                say(f'looking on: {sentence}')
            camera.scan(overlap, reach, dwell, enough)
            looked_around = True
            overlap = min(overlap + _OVERLAP, 0.5)
            reach = min(reach * 1.5, 1.2)
            dwell = min(dwell * 2.0, 4.0 * self.dwell)
            if late() and not judge().places and not told:
                told = True
                say('nothing to patrol was found yet; looking on')
        if not stopping():
            camera.home()
        return judge()
