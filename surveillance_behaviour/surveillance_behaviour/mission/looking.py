"""Looking at a room: at what the rules ask for, from its viewpoints, all around, within the time
that there is; and again.

From where a room is to be looked at, and which alerts wait for a second look, says who watches (the
port `InspectionPort`). What cannot be driven to or turned is left out: a look is never a reason to
stop patrolling. In a room with a charging station the robot keeps its place, so that it may charge.

What does not fit into one stay comes first in the next one, also after a restart. A side counts as
looked at in the record once a picture of it was looked at, not when the camera was turned there.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

from state_machines import Interrupt
from state_machines.clock import elapsed_of
from state_machines.exceptions import CallError, CallInterruptedError
from surveillance_behaviour.mission.mission import Mission
from surveillance_behaviour.mission.mission_log import side_name, stand_name
from surveillance_behaviour.mission.sweeping import PlaceSweep
from surveillance_behaviour.ports import Check, Doubt, InspectionPort, Point

SETTLE = 4.0
"""Seconds for which the robot stands at a viewpoint, so that sweeps and pictures are compared."""
BASE_MOVE, ARM_MOVE = 4.0, 3.0
"""So long the first move to another side is taken to last, of the base and of the arm, seconds."""
DWELL = 4.5
"""The camera stands so long at each side: for two pictures of the observer, seconds."""
CHECK_DWELL, CHECK_PICTURES = 5.5, 3
"""At a check it stands so long, seconds, and for so many pictures, which must agree where a marker
hangs, and that it is gone."""
LONGEST_DWELL = 13.5
"""And so long where too few pictures of that side were looked at, or what a check found is not
settled, and there is time, seconds."""
MOST_INSISTED = 3
"""A check that is not settled comes before the others so many times in a row."""
LEAST_STAY = 12.0
"""A shorter stay may have no time for a side, seconds: that takes as long as the camera turns."""
VIEW = math.pi / 2
"""A picture is taken to show so much of the horizon where nobody says how much, rad."""
OVERLAP = 0.07
"""So far the pictures of neighbouring sides overlap, that none cuts a marker in two, rad."""
NEAR = 0.3
"""Who is so near to a point is there, metres."""
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
"""Seconds between two looks whether a doubt is settled, or a picture was looked at."""


@dataclass
class _Stay:
    """What was looked at in one stay.

    Attributes:
        own: Where the robot arrived: the place's own point.
        end: Until when it looks, seconds.
        drives: Whether it may drive about.
        sides: The bearings, whole degrees of the map frame.
        unseen: Those to which the camera was turned, and of which no picture was looked at.
        checks: The names of the checks.
        faced: Whether the camera is turned aside.
    """

    own: Point | None
    end: float
    drives: bool
    sides: list[int] = field(default_factory=list)
    unseen: list[int] = field(default_factory=list)
    checks: list[str] = field(default_factory=list)
    faced: bool = False


class RoomInspection:
    """Looks at the rooms of a mission.

    Args:
        mission: The mission's memory and ports.
    """

    def __init__(self, mission: Mission) -> None:
        self._mission = mission
        self._sweep = PlaceSweep(mission)
        self._moves = {True: ARM_MOVE, False: BASE_MOVE}
        self._looked_again: deque[int] = deque(maxlen=MOST_DOUBTS)
        self._insisted: Counter[tuple[str, str]] = Counter()
        self._short: set[str] = set()
        self._said_short = False
        self._elapsed = elapsed_of(mission.clock)
        self._began = 0.0

    def explore(self, seconds: float, interrupt: Interrupt) -> None:
        """Look at the place where the robot is, sweep it if that is to be, and stay for the rest of
        a time.

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
            least = SETTLE if looking.sees_around() else LEAST_STAY
            if seconds < least and not self._said_short:
                self._said_short = True
                short = 'is too short to look at anything'
                if seconds >= SETTLE:
                    short = 'may be too short to turn the camera to a side'
                mission.say(
                    f'a stay of {seconds:g} s {short}: '
                    f'exploration_seconds of {least:g} or more would do',
                    warning=True,
                )
        self._began = self._elapsed() - min(mission.explored, seconds)
        mission.explored = 0.0
        end = self._began + seconds
        if looking is not None and seconds >= SETTLE:
            self._look(looking, end, interrupt)
        self._sweep.run(interrupt)
        while (left := end - self._elapsed()) > 0.0:
            if looking is not None and seconds >= SETTLE:
                self.verify(interrupt)
            if not mission.clock.sleep(min(left, max(NOTE_SECONDS, seconds / 20.0)), interrupt):
                raise CallInterruptedError
            self._note_explored()
        mission.explored = math.inf

    def _note_explored(self, **side: object) -> None:
        seconds = round(self._elapsed() - self._began, 3)
        self._mission.note('exploring', place=self._mission.place, seconds=seconds, **side)

    def _look(self, looking: InspectionPort, end: float, interrupt: Interrupt) -> None:
        """Look at the place, as far as that goes until a time."""
        mission = self._mission
        if end - self._elapsed() < SETTLE:
            return
        drives = mission.place not in mission.settings.choice.recharge_rooms
        stay = _Stay(looking.position(), end, drives)
        has_arm = looking.has_arm()
        try:
            self._look_at_checks(looking, stay, interrupt)
            stands: list[Point | None] = [None]
            stands += looking.viewpoints(mission.place) if drives else []
            self._look_from(looking, stay, stands, interrupt)
            left_out = len(stands) - (None in stands)
            more = {
                name: found
                for name, found in (('unseen', stay.unseen), ('checks', stay.checks))
                if found
            }
            mission.note('look', place=mission.place, sides=stay.sides, left_out=left_out, **more)
        except CallInterruptedError:
            if has_arm and stay.faced:
                looking.rest_arm()
            raise
        except CallError as error:
            if has_arm and stay.faced:
                looking.rest_arm()
            mission.say(f'looking at {mission.place}: {error}', warning=True)

    def _look_from(
        self,
        looking: InspectionPort,
        stay: _Stay,
        stands: list[Point | None],
        interrupt: Interrupt,
    ) -> None:
        """Look at the place from its points, those first that wait longest; drop those done."""
        mission = self._mission
        while stands:
            here = looking.position()
            left = stay.end - self._elapsed()
            fits = self._next(here, stay, stands, left)
            if fits is None:
                break
            (point,) = fits
            stands.remove(point)
            at = point or stay.own
            away = at is not None and here is not None and math.dist(at[:2], here[:2]) > NEAR
            if at is not None and (away or point is not None):
                self._aim_ahead(looking, stay, interrupt)
                looking.drive(at, interrupt)
            if point is not None:
                mission.note('viewpoint', place=mission.place, point=list(point[:2]))
            others = [each for each in stands if each is not None]
            turned = self._turn(looking, stay, point, others, interrupt)
            if looking.sees_around() or not (turned or point is None):
                self._stand(stay.end, interrupt)
                mission.looked.note(mission.place, stand_name(point))
        self._aim_ahead(looking, stay, interrupt)
        self._say_short(looking, stay, stands)

    def _say_short(
        self, looking: InspectionPort, stay: _Stay, stands: Sequence[Point | None]
    ) -> None:
        """Say once of a place that a stay is too short to drive to some viewpoints at all."""
        mission, own = self._mission, stay.own
        if own is None or mission.place in self._short:
            return
        whole = stay.end - self._began
        needed = [self._way(own, each) + SETTLE for each in stands if each is not None]
        if too_long := [each for each in needed if each > whole]:
            self._short.add(mission.place)
            mission.say(
                f'{mission.place}: nobody looks from {len(too_long)} of {len(needed)} viewpoints: '
                f'a stay of {whole:.0f} s is too short to drive there, {max(too_long):.0f} s '
                'would do (exploration_seconds)'
            )

    def _look_at_checks(self, looking: InspectionPort, stay: _Stay, interrupt: Interrupt) -> None:
        """Look at what the rules ask for, what waits longest first, for half of the time.

        What was looked at and is not settled comes before that. Where there is no time for more
        than one thing, it is a check in every other stay.
        """
        mission = self._mission
        place, has_arm = mission.place, looking.has_arm()
        checks = sorted(
            looking.checks(place),
            key=lambda each: (not self._insists(each), mission.looked.rank(place, each.name)),
        )
        if not checks or looking.sees_around() or not (has_arm or stay.drives):
            return
        spare = self._moves[True] if has_arm else 0.0
        one = self._moves[has_arm] + CHECK_DWELL
        left = stay.end - self._elapsed() - spare
        names = {each.name for each in checks}
        is_turn = mission.looked.latest(place) not in names or self._insists(checks[0])
        if left < 2.0 * one and not is_turn:
            return
        half = self._elapsed() + left / 2.0
        for check in checks:
            here = looking.position()
            if here is None or (stay.checks and self._elapsed() >= half):
                break
            point = (check.look_from or stay.own) if stay.drives else None
            way = 0.0
            if point is not None and math.dist(point[:2], here[:2]) > NEAR:
                way = self._way(here, point)
            if self._elapsed() + way + one > stay.end - spare:
                way = 0.0  # from here it is seen less well, and better than never
            if self._elapsed() + one > stay.end - spare:
                break
            if point is not None and way:
                self._aim_ahead(looking, stay, interrupt)
                looking.drive(point, interrupt)
                here = looking.position() or point
            bearing = math.atan2(check.point[1] - here[1], check.point[0] - here[0])
            key = place, check.name
            self._insisted[key] = self._insisted[key] + 1 if check.is_open else 0
            seen = self._face(
                looking,
                stay,
                bearing,
                stay.end - spare,
                interrupt,
                CHECK_DWELL,
                partial(self._is_checked, looking, check.name),
            )
            mission.looked.note(place, check.name)
            if seen:
                stay.checks.append(check.name)
                self._note_explored(check=check.name)
            self.verify(interrupt)

    def _insists(self, check: Check) -> bool:
        """Tell whether a check comes before those that wait longer."""
        key = self._mission.place, check.name
        return check.is_open and self._insisted[key] < MOST_INSISTED

    def _is_checked(self, looking: InspectionPort, name: str, pictures: int) -> bool:
        """Tell whether so many pictures are enough for a check, and what they show is settled."""
        now = looking.checks(self._mission.place)
        is_open = any(each.name == name and each.is_open for each in now)
        return pictures >= CHECK_PICTURES and not is_open

    def _aim_ahead(self, looking: InspectionPort, stay: _Stay, interrupt: Interrupt) -> None:
        """Have the arm look ahead, if it looks elsewhere."""
        if stay.faced and looking.has_arm():
            looking.face(looking.heading(), interrupt)
        stay.faced = False

    def _face(
        self,
        looking: InspectionPort,
        stay: _Stay,
        bearing: float,
        latest: float,
        interrupt: Interrupt,
        dwell: float = DWELL,
        is_enough: Callable[[int], bool] = bool,
    ) -> bool:
        """Turn the camera to a bearing, and stand until enough pictures of it were looked at.

        Returns:
            Whether one was: within the dwell, or a little later if there is time until `latest`.
        """
        has_arm, began = looking.has_arm(), self._elapsed()
        stay.faced = True
        looking.face(bearing, interrupt)
        faced = self._elapsed()
        self._moves[has_arm] = max(0.1, 0.5 * (self._moves[has_arm] + faced - began))
        seconds = dwell
        while True:
            if not self._mission.clock.sleep(seconds, interrupt):
                raise CallInterruptedError
            seen, now = looking.saw(bearing), self._elapsed()
            if is_enough(seen) or now + POLL > min(latest, faced + LONGEST_DWELL):
                return seen > 0
            seconds = POLL

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

    def _look_again(self, looking: InspectionPort, doubt: Doubt, interrupt: Interrupt) -> None:
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

    def _await_settled(self, looking: InspectionPort, doubt: Doubt, interrupt: Interrupt) -> None:
        """Stand until a doubt is settled, or for a look."""
        end = self._elapsed() + SETTLE
        while self._doubted(looking, doubt) and self._elapsed() < end:
            if not self._mission.clock.sleep(POLL, interrupt):
                raise CallInterruptedError

    def _doubted(self, looking: InspectionPort, doubt: Doubt) -> bool:
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

    def _next(
        self,
        here: Point | None,
        stay: _Stay,
        stands: Sequence[Point | None],
        seconds: float,
    ) -> tuple[Point | None] | None:
        """Return the point to look from, None for the place's own; None where no way fits.

        While there is time for all, that is the own one and then the nearest. Otherwise it is the
        one that waits longest, and of those that never had their turn the first one: the order in
        which they are told is by what they show.
        """
        if here is None:
            return (None,) if None in stands else None
        points = [each for each in stands if each is not None]
        at_own = stay.own is None or math.dist(here[:2], stay.own[:2]) <= NEAR
        if self._needed(here, points) <= seconds:
            if None in stands and at_own:
                return (None,)
            if points:
                return (min(points, key=lambda each: math.dist(here[:2], each[:2])),)
        looked, place = self._mission.looked, self._mission.place
        for each in sorted(stands, key=lambda each: looked.rank(place, stand_name(each))):
            at = each or stay.own
            if at is None or (each is None and at_own) or self._way(here, at) + SETTLE <= seconds:
                return (each,)
        return None

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
        looking: InspectionPort,
        stay: _Stay,
        point: Point | None,
        others: Sequence[Point],
        interrupt: Interrupt,
    ) -> bool:
        """Turn the camera to as many sides as there is time for, those first that wait longest.

        Where there are viewpoints to drive to, all sides but one leave time for those. The sides
        are the same ones in each visit, as many as show the whole horizon. An arm, which has
        stops, passes them anticlockwise from the robot's front, and that last.

        Args:
            looking: Who turns it.
            stay: What was looked at in this stay.
            point: From where; None: from the place's own point.
            others: The viewpoints that are left.
            interrupt: Ends it.

        Returns:
            Whether the camera was turned at all.
        """
        mission, has_arm = self._mission, looking.has_arm()
        place = mission.place
        if looking.sees_around() or not (has_arm or stay.drives):
            return False
        here, ahead = looking.position(), looking.heading()
        rest = 0.0 if here is None else self._needed(here, others)
        end = stay.end - (self._moves[True] if has_arm else 0.0)
        view = looking.camera_angle()
        part = VIEW if view is None else max(0.2, view - OVERLAP)
        count = max(1, math.ceil(math.tau / part - 1e-6))
        sides = [math.tau * index / count for index in range(count)]
        sides.sort(key=lambda each: (each - ahead - HERE) % math.tau)
        step, left = self._moves[has_arm] + DWELL, end - self._elapsed()
        most = max(int(left >= step), int((left - rest) // step))

        def name(side: float) -> str:
            return side_name(round(math.degrees(side)), point)

        waiting = sorted(sides, key=lambda each: mission.looked.rank(place, name(each)))
        chosen = [each for each in sides if each in waiting[:most]]
        is_first = True
        for side in chosen if has_arm else one_way(chosen, ahead):
            # Also where it is slower than it was.
            if not is_first and end - rest - self._elapsed() < self._moves[has_arm] + DWELL:
                break
            is_first = False
            seen = self._face(looking, stay, side, end - rest, interrupt)
            mission.looked.note(place, stand_name(point), name(side))
            bearing = round(math.degrees(side))
            if seen:
                stay.sides.append(bearing)
                at = {} if point is None else {'point': list(point[:2])}
                self._note_explored(bearing=bearing, **at)
            else:
                stay.unseen.append(bearing)
            self.verify(interrupt)
        return bool(chosen)


def one_way(bearings: Sequence[float], ahead: float) -> list[float]:
    """Return bearings in the order in which the shorter turn from one passes them all, rad."""
    here = [each for each in bearings if abs(math.remainder(each - ahead, math.tau)) < HERE]
    aside = [each for each in bearings if each not in here]
    order = sorted(aside, key=lambda each: (each - ahead) % math.tau)
    if order and (order[-1] - ahead) % math.tau > (ahead - order[0]) % math.tau:
        order.reverse()
    return here + order
