"""Looking at a room: from its viewpoints, all around, within the time that there is; and again.

From where a room is to be looked at, and which alerts wait for a second look, says who watches (the
port `Looking`). What cannot be driven to or turned is left out: a look is never a reason to stop
patrolling. In a room with a charging station the robot keeps its place, so that it may charge.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from state_machines import Interrupt
from state_machines.clock import elapsed_of
from state_machines.exceptions import CallError, CallInterruptedError
from surveillance_behaviour.mission.mission import Mission
from surveillance_behaviour.ports import Doubt, Looking, Point

SETTLE = 4.0
"""Seconds for which the robot stands at a viewpoint, so that sweeps and pictures are compared."""
BASE_MOVE, ARM_MOVE = 4.0, 3.0
"""So long the first move to another side is taken to last, of the base and of the arm, seconds."""
DWELL = 4.5
"""The camera stands so long at each side: for two pictures of the observer, seconds."""
ARM_SWEEP = (math.pi / 2, math.pi, -math.pi / 2)
"""The sides in the order in which the arm passes them, from the robot's front, rad; ahead it looks
when it arrives."""
BASE_SIDES = (0.0, math.pi / 2, math.pi, -math.pi / 2)
"""Where a base without an arm turns its camera, map frame, rad: the same views in each visit."""
DETOUR = 1.3
"""A way in a room is so much longer than the straight line."""
LONGEST_DETOUR = 10.0
"""A second look takes the robot so far at most, metres."""
MOST_SECOND_LOOKS = 2
"""At one time."""
MOST_DOUBTS = 100
"""So many are remembered to have been looked at again."""
NOTE_SECONDS = 1.0
"""The shortest time between two notes of how far a place is explored, seconds."""
HERE = 0.05
"""A bearing that differs by less is looked at already, rad."""
POLL = 0.5
"""Seconds between two looks whether a doubt is settled."""


class RoomLook:
    """Looks at the rooms of a mission.

    Args:
        mission: The mission's memory and ports.
    """

    def __init__(self, mission: Mission) -> None:
        self._mission = mission
        self._moves = {True: ARM_MOVE, False: BASE_MOVE}
        self._looked_again: deque[int] = deque(maxlen=MOST_DOUBTS)
        self._elapsed = elapsed_of(mission.clock)
        self._began = 0.0

    def explore(self, seconds: float, interrupt: Interrupt) -> None:
        """Look at the place where the robot is, and stay for the rest of a time.

        What makes an alert that is not sure is looked at again at once. A place that was explored
        for a part of the time before, by a process that was killed, is explored for the rest of it.

        Args:
            seconds: How long, on the mission's clock.
            interrupt: Ends it.

        Raises:
            CallInterruptedError: The interrupt came.
        """
        mission, looking = self._mission, self._mission.ports.looking
        if looking is not None:
            looking.await_watcher(interrupt)
        self._began = self._elapsed() - min(mission.explored, seconds)
        mission.explored = 0.0
        end = self._began + seconds
        if looking is not None and seconds >= SETTLE:
            self._look(looking, end, interrupt)
        while (left := end - self._elapsed()) > 0.0:
            if looking is not None and seconds >= SETTLE:
                self.verify(interrupt)
            if not mission.clock.sleep(min(left, max(NOTE_SECONDS, seconds / 20.0)), interrupt):
                raise CallInterruptedError
            self._note_explored()
        mission.explored = math.inf

    def _note_explored(self, **side: int) -> None:
        seconds = round(self._elapsed() - self._began, 3)
        self._mission.note('exploring', place=self._mission.place, seconds=seconds, **side)

    def _look(self, looking: Looking, end: float, interrupt: Interrupt) -> None:
        """Look at the place from its viewpoints, as far as that goes until a time."""
        mission = self._mission
        if end - self._elapsed() < SETTLE:
            return
        drives = mission.place not in mission.settings.choice.recharge_rooms
        try:
            points = list(looking.viewpoints(mission.place)) if drives else []
            left_out = len(points)
            sides = self._turn(looking, points, end, drives, interrupt)
            if looking.sees_around():
                self._stand(end, interrupt)
            while points and (here := looking.position()) is not None:
                point = self._next(here, points, end - self._elapsed())
                if point is None:
                    break
                points.remove(point)
                looking.drive(point, interrupt)
                left_out -= 1
                mission.note('viewpoint', place=mission.place, point=list(point[:2]))
                turned = self._turn(looking, points, end, drives, interrupt)
                sides += turned
                if not turned:
                    self._stand(end, interrupt)
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
        waiting = looking.doubts(mission.place)
        fresh = [each for each in waiting if each.number not in self._looked_again]
        for doubt in fresh[:MOST_SECOND_LOOKS]:
            self._looked_again.append(doubt.number)
            try:
                self._look_again(looking, doubt, interrupt)
            except CallInterruptedError:
                raise
            except CallError as error:
                mission.say(f'event {doubt.number} is not looked at again: {error}', warning=True)
                continue
            found = 'is still in doubt' if self._doubted(looking, doubt) else 'is settled'
            mission.note('verify', place=mission.place, number=doubt.number, found=found)
            mission.say(f'looked again: event {doubt.number} {found}')

    def _look_again(self, looking: Looking, doubt: Doubt, interrupt: Interrupt) -> None:
        """Drive to where a doubt is looked at from, and stand until it is settled."""
        mission = self._mission
        drives = mission.place not in mission.settings.choice.recharge_rooms
        here, point = looking.position(), doubt.look_from
        if not (drives and here and point and math.dist(here[:2], point[:2]) < LONGEST_DETOUR):
            self._await_settled(looking, doubt, interrupt)
            return
        mission.say(f'looking again at event {doubt.number} in {mission.place}')
        looking.drive(point, interrupt)
        if doubt.position is not None and not looking.sees_around():
            dx, dy = doubt.position[0] - point[0], doubt.position[1] - point[1]
            try:
                looking.face(math.atan2(dy, dx), interrupt)
                self._await_settled(looking, doubt, interrupt)
            finally:
                looking.rest_arm()
        else:
            self._await_settled(looking, doubt, interrupt)

    def _await_settled(self, looking: Looking, doubt: Doubt, interrupt: Interrupt) -> None:
        """Stand until a doubt is settled, or for a look."""
        end = self._elapsed() + SETTLE
        while self._doubted(looking, doubt) and self._elapsed() < end:
            if not self._mission.clock.sleep(POLL, interrupt):
                raise CallInterruptedError

    def _doubted(self, looking: Looking, doubt: Doubt) -> bool:
        """Tell whether a doubt still waits."""
        return any(each.number == doubt.number for each in looking.doubts(self._mission.place))

    def _stand(self, end: float, interrupt: Interrupt) -> None:
        """Stand for a look, at most until a time."""
        seconds = min(SETTLE, max(0.0, end - self._elapsed()))
        if not self._mission.clock.sleep(seconds, interrupt):
            raise CallInterruptedError

    def _way(self, here: Point, point: Point) -> float:
        """Return the seconds to a point in the same room."""
        speed = max(1e-3, self._mission.settings.choice.speed)
        return DETOUR * math.dist(here[:2], point[:2]) / speed + 2.0

    def _next(self, here: Point, points: Sequence[Point], seconds: float) -> Point | None:
        """Return the viewpoint to drive to; None where the way to none fits into the time.

        The nearest one while there is time for all, else the first one that fits: the order in
        which they are told is by what they show.
        """
        if self._needed(here, points) <= seconds:
            return min(points, key=lambda each: math.dist(here[:2], each[:2]))
        fits = (each for each in points if self._way(here, each) + SETTLE <= seconds)
        return next(fits, None)

    def _needed(self, here: Point, points: Sequence[Point]) -> float:
        """Return the seconds for driving to points, the nearest first, and standing there."""
        at, needed, rest = here, 0.0, list(points)
        while rest:
            nearest = min(rest, key=lambda each: math.dist(at[:2], each[:2]))
            needed += self._way(at, nearest) + SETTLE
            rest.remove(nearest)
            at = nearest
        return needed

    def _turn(
        self,
        looking: Looking,
        points: Sequence[Point],
        end: float,
        drives: bool,
        interrupt: Interrupt,
    ) -> list[int]:
        """Turn the camera to as many sides as there is time for, those first that wait longest.

        Where there are viewpoints to drive to, all sides but one leave time for those.

        Returns:
            The sides that it looked at, whole degrees of the map frame.
        """
        has_arm = looking.has_arm()
        if looking.sees_around() or not (has_arm or drives):
            return []
        here, ahead = looking.position(), looking.heading()
        rest = 0.0 if here is None else self._needed(here, points)
        if not has_arm:
            return self._pass(looking, BASE_SIDES, end, rest, interrupt)
        try:
            # An arm looks ahead again at the end.
            sides = [ahead + each for each in ARM_SWEEP]
            looked = self._pass(looking, sides, end - self._moves[True], rest, interrupt)
            if looked:
                looking.face(looking.heading(), interrupt)
        except CallError:
            # Whatever ended the look: who drives next has the camera ahead.
            looking.rest_arm()
            raise
        return looked

    def _pass(
        self,
        looking: Looking,
        sides: Sequence[float],
        end: float,
        rest: float,
        interrupt: Interrupt,
    ) -> list[int]:
        """Turn the camera to those of some sides that wait longest, as many as time allows.

        They are passed in one sweep, which an arm, which has stops, makes in the order given.

        Args:
            looking: Who turns it.
            sides: Bearings in the map frame, rad.
            end: When the last one has been looked at.
            rest: All but the first one leave so many seconds until then.
            interrupt: Ends it.

        Returns:
            The bearings, whole degrees.
        """
        mission, has_arm = self._mission, looking.has_arm()
        step, left = self._moves[has_arm] + DWELL, end - self._elapsed()
        count = max(int(left >= step), int((left - rest) // step))
        waiting = sorted(sides, key=lambda each: mission.looked.rank(mission.place, each))
        chosen = [each for each in sides if each in waiting[:count]]
        looked: list[int] = []
        for side in chosen if has_arm else one_way(chosen, looking.heading()):
            # Also where it is slower than it was.
            if looked and end - rest - self._elapsed() < self._moves[has_arm] + DWELL:
                break
            began = self._elapsed()
            looking.face(side, interrupt)
            took = self._elapsed() - began
            self._moves[has_arm] = max(0.1, 0.5 * (self._moves[has_arm] + took))
            if not mission.clock.sleep(DWELL, interrupt):
                raise CallInterruptedError
            looked.append(mission.looked.note(mission.place, side))
            self._note_explored(bearing=looked[-1])
            self.verify(interrupt)
        return looked


def one_way(bearings: Sequence[float], ahead: float) -> list[float]:
    """Return bearings in the order in which the shorter turn from one passes them all, rad."""
    here = [each for each in bearings if abs(math.remainder(each - ahead, math.tau)) < HERE]
    aside = [each for each in bearings if each not in here]
    order = sorted(aside, key=lambda each: (each - ahead) % math.tau)
    if order and (order[-1] - ahead) % math.tau > (ahead - order[0]) % math.tau:
        order.reverse()
    return here + order
