"""Looking at a room: from its viewpoints, all around, within the time that there is; and again.

From where a room is to be looked at, and which alerts wait for a second look, says who watches (the
port `Looking`). What cannot be driven to or turned is left out: a look is never a reason to stop
patrolling. In a room with a charging station the robot keeps its place, so that it may charge.
"""

from __future__ import annotations

import math

from state_machines import Interrupt
from state_machines.clock import elapsed_of
from state_machines.exceptions import CallError
from surveillance_behaviour.mission.mission import Mission
from surveillance_behaviour.ports import Looking, Point

SETTLE = 4.0
"""Seconds for which the robot stands at a viewpoint, so that sweeps and pictures are compared."""
BASE_TURN, ARM_TURN = 12.0, 30.0
"""So long the first turn of the base, or of the arm, is taken to last, seconds."""
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
        self._turn_seconds = 0.0
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
            self._turn(looking, end - elapsed(), drives, interrupt)
            points = list(looking.viewpoints(mission.place)) if drives else []
            while points:
                here = looking.position()
                if here is None:
                    return
                point = min(points, key=lambda each: math.dist(here[:2], each[:2]))
                points.remove(point)
                if self._way(here, point) + SETTLE > end - elapsed():
                    continue
                looking.drive(point, interrupt)
                mission.note('viewpoint', place=mission.place, point=list(point[:2]))
                if not self._turn(looking, end - elapsed(), drives, interrupt):
                    mission.clock.sleep(min(SETTLE, max(0.0, end - elapsed())), interrupt)
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
            except CallError as error:
                mission.say(f'event {doubt.number} is not looked at again: {error}', warning=True)
                continue
            still = any(each.number == doubt.number for each in looking.doubts(mission.place))
            found = 'is still in doubt' if still else 'is settled'
            mission.note('verify', place=mission.place, number=doubt.number, found=found)
            mission.say(f'looked again: event {doubt.number} {found}')

    def _way(self, here: Point, point: Point) -> float:
        """Return the seconds to a point in the same room."""
        speed = max(1e-3, self._mission.settings.choice.speed)
        return DETOUR * math.dist(here[:2], point[:2]) / speed + 2.0

    def _turn(self, looking: Looking, seconds: float, drives: bool, interrupt: Interrupt) -> bool:
        """Turn the camera all around if there is time; return whether it did."""
        has_arm = looking.has_arm()
        needed = self._turn_seconds or (ARM_TURN if has_arm else BASE_TURN)
        if seconds < needed or not (drives or has_arm):
            return False
        elapsed = elapsed_of(self._mission.clock)
        began = elapsed()
        looking.turn(interrupt)
        # The next turn takes as long as this one, so that it fits into its time.
        self._turn_seconds = 1.2 * (elapsed() - began)
        return True
