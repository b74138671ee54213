"""A visit that covers all of a place: the robot drives from viewpoint to viewpoint.

So are patrolled the places of the parameter `sweep`, and a building of one place, where there is
nowhere else to go. From where to look, and what was in view, says who knows the map (the port
`SweepPort`).
"""

from __future__ import annotations

from state_machines import Interrupt
from state_machines.clock import elapsed_of
from state_machines.exceptions import CallError, CallInterruptedError
from surveillance_behaviour.mission.mission import Mission
from surveillance_behaviour.ports import SweepPort

MOST_FAILURES = 3
"""After so many stops in a row that could not be reached a sweep ends."""


def is_swept(mission: Mission, place: str) -> bool:
    """Tell whether a visit is to cover all of a place: one that is listed, or the only one."""
    port = mission.ports.sweeping
    return port is not None and (port.is_swept(place) or mission.ports.reasoner.places == {place})


class PlaceSweep:
    """Sweeps places of a mission.

    Args:
        mission: The mission's memory and ports.
    """

    def __init__(self, mission: Mission) -> None:
        self._mission = mission
        self._elapsed = elapsed_of(mission.clock)
        self._warned: set[str] = set()

    def run(self, interrupt: Interrupt) -> None:
        """Sweep the place where the robot is, if a visit is to cover all of it.

        What was in view for half of the place's threshold is left out; in the only place there is
        nothing is.

        Raises:
            CallInterruptedError: The interrupt came.
        """
        mission, port = self._mission, self._mission.ports.sweeping
        if port is None:
            return
        place = mission.place
        if is_swept(mission, place):
            is_only = mission.ports.reasoner.places == {place}
            rest = 0.0 if is_only else port.threshold(place) / 2.0
            self._sweep(port, place, mission.now() - rest, interrupt)
        try:
            if percent := {name: int(100.0 * part) for name, part in port.covered().items()}:
                mission.ports.ontology.record_coverage(percent, interrupt)
        except CallInterruptedError:
            raise
        except CallError as error:
            mission.say(f'covered: {error}', warning=True)

    def _sweep(self, port: SweepPort, place: str, since: float, interrupt: Interrupt) -> None:
        mission, began = self._mission, self._elapsed()
        metres = port.begin(place, since)
        if metres is None:
            return
        stops = failures = left_out = 0
        seconds = None
        try:
            while failures < MOST_FAILURES and (stop := port.next_stop()) is not None:
                if not stops:
                    mission.say(f'sweeping {place}: {metres:.0f} m')
                    mission.dock.strayed()
                stops += 1
                try:
                    port.drive(stop, interrupt)
                except CallInterruptedError:
                    raise
                except CallError as error:
                    failures, left_out = failures + 1, left_out + 1
                    port.leave_out(stop)
                    if failures == 1:
                        mission.say(
                            f'sweeping {place}: ({stop[0]:.1f}, {stop[1]:.1f}) is left out: '
                            f'{error}',
                            warning=True,
                        )
                else:
                    failures = 0
            if failures < MOST_FAILURES:
                seconds = self._elapsed() - began
        finally:
            part, driven = port.end(seconds)
            if stops:
                mission.note(
                    'sweep',
                    place=place,
                    seconds=round(self._elapsed() - began, 3),
                    distance=round(driven, 2),
                    covered=round(part, 3),
                    stops=stops,
                    left_out=left_out,
                )
        if stops and seconds is not None:
            mission.say(f'swept {place} in {seconds:.0f} s: {part:.0%} of its floor was in view')
            self._warn_of_threshold(place, seconds, port.threshold(place))

    def _warn_of_threshold(self, place: str, seconds: float, threshold: float) -> None:
        """Say once that no robot can keep a place's threshold."""
        if seconds > threshold and place not in self._warned:
            self._warned.add(place)
            self._mission.say(
                f'a sweep of {place} takes {seconds:.0f} s, and its threshold is {threshold:g} s '
                '(thresholds, urgency_threshold): it is always URGENT',
                warning=True,
            )
