"""Looking at a room: from its viewpoints, all around, within the time that there is; and again.

From where a room is to be looked at, and which alerts wait for a second look, says who watches (the
port `Looking`). What cannot be driven to or turned is left out: a look is never a reason to stop
patrolling. In a room with a charging station the robot keeps its place, so that it may charge.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from state_machines import Interrupt
from state_machines.clock import elapsed_of
from state_machines.exceptions import CallError, CallInterruptedError
from surveillance_behaviour.mission.mission import Mission
from surveillance_behaviour.ports import Looking, Point, Side

SETTLE = 4.0
"""Seconds for which the robot stands at a viewpoint, so that sweeps and pictures are compared."""
BASE_TURN, ARM_MOVE = 12.0, 3.0
"""So long the first turn of the base, or move of the arm, is taken to last, seconds."""
DWELL = 4.5
"""The arm stands so long at each side: for two pictures of the observer, seconds."""
SWEEP = (Side.LEFT, Side.BACK, Side.RIGHT)
"""The sides in the order in which the arm passes them; ahead it looks when it arrives."""
DETOUR = 1.3
"""A way in a room is so much longer than the straight line."""
LONGEST_DETOUR = 10.0
"""A second look takes the robot so far at most, metres."""
MOST_SECOND_LOOKS = 2
"""In one visit."""


class RoomLook:
    """Looks at the rooms of a mission.

    Args:
        mission: The mission's memory and ports.
    """

    def __init__(self, mission: Mission) -> None:
        self._mission = mission
        self._turn_seconds, self._arm_seconds = BASE_TURN, ARM_MOVE
        self._seen: dict[tuple[str, Side], int] = {}
        self._turns = 0
        self._looked_again: set[int] = set()

    def look(self, seconds: float, interrupt: Interrupt) -> None:
        """Look at the place where the robot is, as far as that goes within a time.

        Args:
            seconds: What there is, on the mission's clock.
            interrupt: Ends it.

        Raises:
            CallInterruptedError: The interrupt came.
        """
        mission, looking = self._mission, self._mission.ports.looking
        if looking is None or seconds < SETTLE:
            return
        elapsed = elapsed_of(mission.clock)
        end = elapsed() + seconds
        drives = mission.place not in mission.settings.choice.recharge_rooms
        try:
            sides = self._turn(looking, end - elapsed(), drives, interrupt)
            if looking.sees_around():
                self._stand(end - elapsed(), interrupt)
            points = list(looking.viewpoints(mission.place)) if drives else []
            left_out = len(points)
            while points and (here := looking.position()) is not None:
                point = self._next(here, points, end - elapsed())
                if point is None:
                    break
                points.remove(point)
                looking.drive(point, interrupt)
                left_out -= 1
                mission.note('viewpoint', place=mission.place, point=list(point[:2]))
                if not self._turn(looking, end - elapsed(), drives, interrupt):
                    self._stand(end - elapsed(), interrupt)
            mission.note('look', place=mission.place, sides=sides, left_out=left_out)
        except CallInterruptedError:
            raise
        except CallError as error:
            mission.say(f'looking at {mission.place}: {error}', warning=True)

    def verify(self, interrupt: Interrupt) -> None:
        """Look again, from elsewhere, at what made an alert in this place that is not sure.

        Raises:
            CallInterruptedError: The interrupt came.
        """
        mission, looking = self._mission, self._mission.ports.looking
        if looking is None:
            return
        drives = mission.place not in mission.settings.choice.recharge_rooms
        waiting = looking.doubts(mission.place)
        self._looked_again &= {each.number for each in waiting}
        fresh = [each for each in waiting if each.number not in self._looked_again]
        for doubt in fresh[:MOST_SECOND_LOOKS]:
            self._looked_again.add(doubt.number)
            try:
                here, point = looking.position(), doubt.look_from
                if drives and here and point and math.dist(here[:2], point[:2]) < LONGEST_DETOUR:
                    mission.say(f'looking again at event {doubt.number} in {mission.place}')
                    looking.drive(point, interrupt)
                mission.clock.sleep(SETTLE, interrupt)
            except CallInterruptedError:
                raise
            except CallError as error:
                mission.say(f'event {doubt.number} is not looked at again: {error}', warning=True)
                continue
            still = any(each.number == doubt.number for each in looking.doubts(mission.place))
            found = 'is still in doubt' if still else 'is settled'
            mission.note('verify', place=mission.place, number=doubt.number, found=found)
            mission.say(f'looked again: event {doubt.number} {found}')

    def _stand(self, seconds: float, interrupt: Interrupt) -> None:
        """Stand for a look, at most so many seconds."""
        self._mission.clock.sleep(min(SETTLE, max(0.0, seconds)), interrupt)

    def _way(self, here: Point, point: Point) -> float:
        """Return the seconds to a point in the same room."""
        speed = max(1e-3, self._mission.settings.choice.speed)
        return DETOUR * math.dist(here[:2], point[:2]) / speed + 2.0

    def _next(self, here: Point, points: Sequence[Point], seconds: float) -> Point | None:
        """Return the viewpoint to drive to; None where the way to none fits into the time.

        The nearest one while there is time for all, else the first one that fits: the order in
        which they are told is by what they show.
        """
        at, needed, rest = here, 0.0, list(points)
        while rest:
            nearest = min(rest, key=lambda each: math.dist(at[:2], each[:2]))
            needed += self._way(at, nearest) + SETTLE
            rest.remove(nearest)
            at = nearest
        if needed <= seconds:
            return min(points, key=lambda each: math.dist(here[:2], each[:2]))
        fits = (each for each in points if self._way(here, each) + SETTLE <= seconds)
        return next(fits, None)

    def _turn(
        self, looking: Looking, seconds: float, drives: bool, interrupt: Interrupt
    ) -> list[str]:
        """Turn the camera as far as there is time; return the sides that it looked at."""
        if looking.sees_around():
            return []
        if looking.has_arm():
            return self._turn_arm(looking, seconds, interrupt)
        if not drives or seconds < self._turn_seconds:
            return []
        elapsed = elapsed_of(self._mission.clock)
        began = elapsed()
        looking.turn(interrupt)
        # The next turn takes as long as this one, so that it fits into its time.
        self._turn_seconds = 1.2 * (elapsed() - began)
        return [str(each) for each in Side]

    def _turn_arm(self, looking: Looking, seconds: float, interrupt: Interrupt) -> list[str]:
        """Point the arm to as many sides as there is time for, those first that wait longest.

        It passes them in one sweep and never turns back, and ends ahead.
        """
        place = self._mission.place
        step = self._arm_seconds + DWELL
        count = min(len(SWEEP), int((seconds - self._arm_seconds) // step))
        if count < 1:
            return []
        waiting = sorted(SWEEP, key=lambda each: self._seen.get((place, each), 0))
        chosen = [each for each in SWEEP if each in waiting[:count]]
        elapsed = elapsed_of(self._mission.clock)
        end = elapsed() + seconds
        looked: list[str] = []
        try:
            for side in chosen:
                # Also where the arm is slower than it was.
                if looked and end - elapsed() < self._arm_seconds + step:
                    break
                began = elapsed()
                looking.point_arm(side, interrupt)
                self._arm_seconds = max(0.1, 0.5 * (self._arm_seconds + elapsed() - began))
                self._mission.clock.sleep(DWELL, interrupt)
                self._turns += 1
                self._seen[place, side] = self._turns
                looked.append(str(side))
        finally:
            looking.point_arm(Side.FRONT, interrupt)
        return looked
