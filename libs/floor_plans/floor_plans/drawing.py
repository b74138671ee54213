"""Drawing of a place: its rooms, walls, doors, markers and graph, and a run through it.

The picture is drawn from the floor plan alone; what a run added (the driven ways, how long each
place waited) comes as `DrivenRun`. A `Canvas` draws in metres on a plane with y upwards, with
smooth edges: everything is drawn at a multiple of the picture's size and averaged down at the end.
Lengths named `points` are pixels of the finished picture.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image, ImageColor, ImageDraw, ImageFont

from floor_plans import shapes
from floor_plans.floor_plan import Door, FloorPlan, Marker
from floor_plans.occupancy_grid import looked_up
from floor_plans.room_map import RoomMap
from floor_plans.shapes import WALL_THICKNESS, Point

_PAPER, _INK, _SOFT = '#fbfaf7', '#2f3742', '#7d8794'
_ROOM, _CORRIDOR, _HOME = '#f6ecd9', '#e3ebf3', '#dff0dc'
_WALL, _LEAF, _ALARM = '#3a4350', '#b08a57', '#c0392b'
_GRAPH, _SIGN, _SIGN_HOME = '#7fa3c7', '#2c5d8f', '#2f8a4c'
_DRIVEN, _PLANNED, _CALM, _LATE = '#14717f', '#8a7fb8', '#fdf9f0', '#f2b287'
_ASIDE = ('#e4e8ec', '#f3c6c0')
_BARRED, _SLOW = '#c0392b', '#d08a1d'
_LONGEST_SIDE = 1180.0
_PANEL = 250
_WIDEST_NAME = 100.0
_FINE = 3


@dataclass(frozen=True)
class DrivenRun:
    """What a run adds to the picture of its place.

    Attributes:
        driven: The ways driven, each (n, 2) points in metres.
        planned: The ways planned, likewise.
        failures: Where a drive failed, (n, 2) points in metres.
        recharges: How often the robot charged in each place.
        threshold: Wait after which a place is urgent, seconds; None: not known.
        waits: Longest time each place went unvisited, seconds.
        visits: How often each place was visited.
        summary: One line about the whole run.
    """

    driven: Sequence[Sequence[Sequence[float]]] = ()
    planned: Sequence[Sequence[Sequence[float]]] = ()
    failures: Sequence[Sequence[float]] = ()
    recharges: Mapping[str, int] = field(default_factory=dict)
    threshold: float | None = None
    waits: Mapping[str, float] = field(default_factory=dict)
    visits: Mapping[str, int] = field(default_factory=dict)
    summary: str = ''


def draw_place(
    plan: FloorPlan,
    title: str,
    facts: str,
    run: DrivenRun | None = None,
    aside: Mapping[str, npt.NDArray[np.bool_]] | None = None,
) -> Image.Image:
    """Return the picture of a place.

    Args:
        plan: The place.
        title: Its name.
        facts: One line about it.
        run: A run through it, if there was one.
        aside: Cells of the place's map that are no part of it, by the word for the legend.
    """
    west, south, east, north = plan.bounds
    scale = min(64.0, _LONGEST_SIDE / max(east - west, north - south))
    right = _PANEL + 50 if run and run.waits else 40
    # Wide enough for the words above and the signs below, however small the place is.
    right += max(0, math.ceil(560 - (east - west) * scale))
    regions = RoomMap(plan)  # before there is a canvas: both take memory
    canvas = Canvas(plan.bounds, scale, (40, 96, right, 86), _PAPER)
    canvas.text((40, 22), title, 26, _INK)
    canvas.text((40, 58), facts if run is None else run.summary, 15, _SOFT)
    picture = _Picture(canvas, plan, regions)
    picture.floors(run)
    picture.set_aside(aside or {})
    if run is None:
        picture.graph()
    picture.zones()
    picture.walls()
    picture.doors()
    picture.markers()
    if run is not None:
        canvas.traces(run.planned, _PLANNED, max(1.2, scale / 40), 0.7)
        canvas.traces(run.driven, _DRIVEN, max(1.5, scale / 26), 0.5)
        picture.failures(run)
    picture.stations()
    if run is not None:
        picture.recharges(run)
    picture.signs()
    picture.legend(run)
    if run is not None and run.waits:
        picture.waits(run)
    return canvas.finished()


class _Picture:
    def __init__(self, canvas: Canvas, plan: FloorPlan, regions: RoomMap) -> None:
        self._canvas = canvas
        self._regions = regions
        self._plan = plan
        self._place = plan.place
        self._aside: dict[str, str] = {}
        self._size = min(15.0, max(9.0, canvas.scale / 3.4))

    def floors(self, run: DrivenRun | None) -> None:
        if not self._plan.is_enclosed:
            return  # where a room ends is not known
        grid = self._regions.grid
        longest = max(run.waits.values(), default=0.0) if run else 0.0

        def colour_of(name: str) -> str:
            if run is not None and longest > 0:
                return blend(_CALM, _LATE, run.waits.get(name, 0.0) / longest)
            return self._floor_colour(name)

        if self._plan.map is not None:
            # As cells: around what stands in a room, an outline has holes.
            labels, names = self._regions.numbers()
            colours = list(dict.fromkeys(colour_of(name) for name in names.values()))
            order = np.zeros(
                max([*names, int(labels.max()), 0]) + 1, np.min_scalar_type(len(colours))
            )
            for number, name in names.items():
                order[number] = 1 + colours.index(colour_of(name))
            which = looked_up(order, labels)
            which[~grid.free] = 0
            self._canvas.raster(which, grid.origin, grid.resolution, colours)
            return
        for name, mask in self._regions.masks().items():
            colour = colour_of(name)
            outlines = cv2.findContours(
                mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE
            )[0]
            for outline in outlines:
                cells = outline.reshape(-1, 2)
                if len(cells) < 3:
                    continue
                edge = [grid.centre_of(int(row), int(column)) for column, row in cells]
                self._canvas.polygon(edge, colour)
                # The outline runs through the middles of the outermost cells.
                width = 2 * grid.resolution * self._canvas.scale
                self._canvas.line([*edge, edge[0]], colour, width)

    def set_aside(self, aside: Mapping[str, npt.NDArray[np.bool_]]) -> None:
        """Draw what is no part of the place."""
        if self._plan.map is None or not aside:
            return
        self._aside = dict(zip(aside, _ASIDE, strict=False))
        grid = self._plan.map.grid
        which = np.zeros(grid.cells.shape, np.uint8)
        for number, mask in enumerate(aside.values(), start=1):
            which[mask] = number
        self._canvas.raster(which, grid.origin, grid.resolution, list(self._aside.values()))

    def _floor_colour(self, name: str) -> str:
        if name in self._place.recharge_rooms:
            return _HOME
        return _CORRIDOR if len(self._place.rooms[name]) > 1 else _ROOM

    def zones(self) -> None:
        zones = self._plan.zones
        for zone in (*zones.slow.values(), *zones.keep_out.values()):
            colour = _BARRED if zone.speed is None else _SLOW
            self._canvas.tint(zone.corners, colour, 0.22)
            outline = [*zone.corners, zone.corners[0]]
            self._canvas.line(outline, colour, max(1.5, self._canvas.scale / 30), dash=(7, 4))
            name = zone.name if zone.speed is None else f'{zone.name}: {zone.speed:g} m/s'
            corner = max(zone.corners, key=lambda each: each[1] - each[0])
            x, y = self._canvas.at(corner)
            self._canvas.text((x + 5, y + 4), name, self._size * 0.8, colour)

    def walls(self) -> None:
        if self._plan.map is not None:
            grid = self._plan.map.grid
            occupied = grid.occupied.astype(np.uint8)
            if grid.resolution * self._canvas.scale * _FINE < 1.0:
                # Walls of one cell stay, however small the picture.
                reach = 2 * math.ceil(0.5 / (grid.resolution * self._canvas.scale * _FINE)) + 1
                thicker = cv2.dilate(occupied, np.ones((reach, reach), np.uint8))
                occupied = np.asarray(thicker, dtype=np.uint8)
            self._canvas.raster(occupied, grid.origin, grid.resolution, [_WALL])
        solid = shapes.boxes_around(self._plan.wall_pieces(), WALL_THICKNESS)
        solid[:, 5] = max(WALL_THICKNESS / 2, 1.6 / self._canvas.scale)
        jambs = {end for door in self._plan.doors.values() for end in door.ends}
        for box, ends in zip(solid, self._plan.wall_pieces(), strict=True):
            # Corners are filled, doorways keep their width.
            grown = box.copy()
            if not any(math.dist(end, jamb) < 1e-3 for end in ends for jamb in jambs):
                grown[4] += box[5]
            self._canvas.polygon(shapes.corners(grown[None])[0].tolist(), _WALL)
        for wall in self._plan.walls.values():
            for end in (wall.start, wall.end):
                half = float(solid[0, 5])
                corner = np.array([[*end, 1.0, 0.0, half, half]])
                self._canvas.polygon(shapes.corners(corner)[0].tolist(), _WALL)

    def doors(self) -> None:
        for door in self._plan.doors.values():
            thin = max(1.0, self._canvas.scale / 40)
            hinge, _ = door.ends
            start = door.yaw + (0.0 if self._swings_left(door) else -math.pi / 2)
            open_at = door.yaw + (math.pi / 2 if self._swings_left(door) else -math.pi / 2)
            tip = (
                hinge[0] + door.width * math.cos(open_at),
                hinge[1] + door.width * math.sin(open_at),
            )
            self._canvas.arc(hinge, door.width, start, start + math.pi / 2, _LEAF, thin * 0.7)
            self._canvas.line([hinge, tip], _LEAF, thin * 1.8)
            if self._canvas.scale > 20:
                x, y = self._canvas.at((door.x, door.y))
                side = -1.0 if self._swings_left(door) else 1.0
                away, along = self._size * 0.85, self._canvas.scale * door.width * 0.31
                # Beside the middle, where the way leads through.
                at = (
                    x - side * away * math.sin(door.yaw) + along * math.cos(door.yaw),
                    y - side * away * math.cos(door.yaw) - along * math.sin(door.yaw),
                )
                self._canvas.text(at, door.name, self._size * 0.78, _SOFT, anchor='mm')

    def _swings_left(self, door: Door) -> bool:
        """Tell whether the leaf opens to the left of the door's direction: into the smaller
        place.
        """
        left, right = (
            self._regions.room_at(
                door.x - side * 0.2 * math.sin(door.yaw), door.y + side * 0.2 * math.cos(door.yaw)
            )
            for side in (1.0, -1.0)
        )
        doors = self._place.rooms
        return len(doors.get(left or '', ())) <= len(doors.get(right or '', ()))

    def graph(self) -> None:
        for name, sides in self._place.doors.items():
            if len(sides) < 2:
                continue
            first, second = sides
            door = self._plan.doors.get(name)
            way = [self._place.positions[first][:2], self._place.positions[second][:2]]
            if door is not None:
                way.insert(1, (door.x, door.y))
            self._canvas.line(way, _GRAPH, max(1.2, self._canvas.scale / 30), dash=(6, 4))

    def markers(self) -> None:
        for marker in self._plan.markers.values():
            self._marker(marker)

    def _marker(self, marker: Marker) -> None:
        side = max(4.0, self._canvas.scale * 0.09)
        x, y = self._canvas.at((marker.x, marker.y))
        x += side * math.cos(marker.yaw)
        y -= side * math.sin(marker.yaw)
        self._canvas.box(x - side, y - side, x + side, y + side, _INK)
        self._canvas.box(x - side * 0.4, y - side * 0.4, x + side * 0.4, y + side * 0.4, _PAPER)
        away = side + self._size * 0.9
        at = (x + away * math.cos(marker.yaw), y - away * math.sin(marker.yaw))
        self._canvas.text(at, str(marker.id), self._size * 0.8, _INK, anchor='mm')

    def stations(self) -> None:
        radius = max(9.0, self._canvas.scale * 0.24)
        for station in self._plan.stations.values():
            x, y, _ = station.pose
            # Below the sign of the place, which may stand at the same point.
            self._bolt(*self._canvas.at((x, y - (radius + self._size * 1.5) / self._canvas.scale)))

    def failures(self, run: DrivenRun) -> None:
        for x, y in run.failures:
            self._cross(*self._canvas.at((x, y)))

    def _cross(self, x: float, y: float) -> None:
        reach = max(5.0, min(9.0, self._canvas.scale * 0.12))
        for side in (1.0, -1.0):
            ends = [
                self._point(x - reach, y - side * reach),
                self._point(x + reach, y + side * reach),
            ]
            self._canvas.line(ends, _ALARM, 3.0)

    def _point(self, x: float, y: float) -> tuple[float, float]:
        """Return the point in metres of a place on the canvas."""
        west, north = self._canvas.at((0.0, 0.0))
        return (x - west) / self._canvas.scale, (north - y) / self._canvas.scale

    def recharges(self, run: DrivenRun) -> None:
        """Write beside each station's sign how often the robot charged there."""
        for room, count in run.recharges.items():
            if count and room in self._plan.stations:
                radius = max(9.0, self._canvas.scale * 0.24)
                x, y = self._canvas.at(self._plan.stations[room].pose[:2])
                at = (x + radius + 6, y + radius + self._size * 1.5)
                self._canvas.text(at, f'x {count}', self._size, _SIGN_HOME, anchor='lm')

    def _bolt(self, x: float, y: float) -> None:
        radius = max(8.0, min(14.0, self._canvas.scale * 0.24))
        point = self._point(x, y)
        self._canvas.disc(point, radius, _SIGN_HOME)
        shape = [(0.15, 0.7), (-0.42, -0.1), (-0.05, -0.1), (-0.15, -0.7), (0.42, 0.1), (0.05, 0.1)]
        unit = radius / self._canvas.scale
        self._canvas.polygon(
            [(point[0] + a * unit, point[1] + b * unit) for a, b in shape], 'white'
        )

    def signs(self) -> None:
        for name, (x, y, _) in self._place.positions.items():
            colour = _SIGN_HOME if name in self._place.recharge_rooms else _SIGN
            self._canvas.pill(self._canvas.at((x, y)), name, self._size, colour)

    def legend(self, run: DrivenRun | None) -> None:
        canvas = self._canvas
        y = canvas.size[1] - 34.0
        length = 1.0 if canvas.scale > 90 else 2.0 if canvas.scale > 30 else 5.0
        canvas.box(40, y - 1.5, 40 + length * canvas.scale, y + 1.5, _INK)
        for x in (40.0, 40 + length * canvas.scale):
            canvas.box(x - 1, y - 5, x + 1, y + 5, _INK)
        canvas.text((40, y + 8), f'{length:g} m', 12, _SOFT)
        x = 40 + max(length * canvas.scale, 40) + 40
        entries = [(_ROOM, 'room'), (_CORRIDOR, 'corridor'), (_HOME, 'charging station')]
        if run is not None and run.waits:
            entries = [(_CALM, 'visited often'), (_LATE, 'waited longest')]
        entries += [(colour, word) for word, colour in self._aside.items()]
        for colour, text in entries:
            canvas.box(x, y - 8, x + 16, y + 8, _SOFT)
            canvas.box(x + 1, y - 7, x + 15, y + 7, colour)
            x += self._word(x + 22, y, text) + 40
        if run is None:
            self._stroke(x, y, _GRAPH, dashed=True)
            x += self._word(x + 28, y, 'way between places') + 46
        else:
            for ways, colour, text in (
                (run.driven, _DRIVEN, 'driven'),
                (run.planned, _PLANNED, 'planned'),
            ):
                if ways:
                    self._stroke(x, y, colour, dashed=False)
                    x += self._word(x + 28, y, text) + 46
            if run.failures:
                self._cross(x + 6, y)
                x += self._word(x + 20, y, 'failure') + 40
        for zones, colour, text in (
            (self._plan.zones.keep_out, _BARRED, 'keep out'),
            (self._plan.zones.slow, _SLOW, 'slow'),
        ):
            if zones:
                self._stroke(x, y, colour, dashed=True)
                x += self._word(x + 28, y, text) + 46
        if self._plan.markers:
            canvas.box(x, y - 6, x + 12, y + 6, _INK)
            canvas.box(x + 3.5, y - 2.5, x + 8.5, y + 2.5, _PAPER)
            self._word(x + 20, y, 'marker')

    def _word(self, x: float, y: float, text: str) -> float:
        self._canvas.text((x, y), text, 13, _INK, anchor='lm')
        return self._canvas.text_width(text, 13)

    def _cut(self, text: str, size: float, width: float) -> str:
        """Return a text, or what of it is so wide at most."""
        whole = text
        while self._canvas.text_width(text, size) > width:
            text = whole[: len(text.removesuffix('...')) - 1] + '...'
        return text

    def _stroke(self, x: float, y: float, colour: str, *, dashed: bool) -> None:
        for start in (0, 8, 16) if dashed else (0, 6, 12, 18):
            self._canvas.box(x + start, y - 1.2, x + start + 6, y + 1.2, colour)

    def waits(self, run: DrivenRun) -> None:
        canvas = self._canvas
        left = canvas.at((self._plan.bounds[2], 0.0))[0] + 34.0
        top, bottom = 96.0, canvas.size[1] - 60.0
        canvas.text((left, top - 6), 'longest wait', 14, _INK)
        canvas.text((left + _PANEL - 16, top - 6), 'visits', 14, _INK, anchor='ra')
        ranked = sorted(run.waits, key=lambda name: -run.waits[name])
        step = min(30.0, (bottom - top - 24) / max(1, len(ranked)))
        size = min(14.0, max(7.0, step * 0.62))
        longest = max(*run.waits.values(), run.threshold or 0.0)
        names = {name: self._cut(name, size, _WIDEST_NAME) for name in ranked}
        widest = max(canvas.text_width(name, size) for name in names.values())
        begin = left + max(44.0, widest + 8.0)
        room = left + _PANEL - 106 - begin
        threshold = run.threshold or 0.0
        urgent = begin + (room * threshold / longest if longest else 0.0)
        for number, name in enumerate(ranked):
            y = top + 24 + (number + 0.5) * step
            share = run.waits[name] / longest if longest else 0.0
            canvas.text((left, y), names[name], size, _INK, anchor='lm')
            canvas.box(
                begin,
                y - step * 0.3,
                begin + max(2.0, room * share),
                y + step * 0.3,
                blend(_CALM, _LATE, 0.25 + 0.75 * share),
            )
            words, x = f'{run.waits[name]:.0f} s', begin + 6 + room * share
            if x - 6 < urgent < x + canvas.text_width(words, size) + 6:
                x = urgent + 5
            canvas.text((x, y), words, size, _SOFT, anchor='lm')
            visits = str(run.visits.get(name, 0))
            canvas.text((left + _PANEL - 16, y), visits, size, _SOFT, anchor='rm')
        if threshold:
            end = top + 24 + len(ranked) * step + 4
            canvas.box(urgent - 0.8, top + 18, urgent + 0.8, end, _ALARM)
            words = f'urgent after {threshold:.0f} s'
            canvas.text((begin, end + 6), words, 12, _ALARM)


class Canvas:
    """A picture of a piece of the plane.

    Attributes:
        scale: Points per metre.
        size: Width and height of the finished picture, points.
    """

    def __init__(
        self,
        bounds: tuple[float, float, float, float],
        scale: float,
        margins: tuple[int, int, int, int],
        background: str,
    ) -> None:
        """Begin an empty picture.

        Args:
            bounds: West, south, east and north edge of what is to be seen, metres.
            scale: Points per metre.
            margins: Left, top, right and bottom margin around that, points.
            background: Colour of the paper.
        """
        west, south, east, north = bounds
        left, top, right, bottom = margins
        self.scale = scale
        self.size = (
            math.ceil((east - west) * scale) + left + right,
            math.ceil((north - south) * scale) + top + bottom,
        )
        self._origin = (left - west * scale, top + north * scale)
        self._image = Image.new('RGB', (self.size[0] * _FINE, self.size[1] * _FINE), background)
        self._draw = ImageDraw.Draw(self._image)

    def at(self, point: Sequence[float]) -> Point:
        """Return where a point of the plane (metres) lies in the finished picture."""
        return (self._origin[0] + point[0] * self.scale, self._origin[1] - point[1] * self.scale)

    def polygon(self, outline: Iterable[Sequence[float]], colour: str) -> None:
        """Fill a polygon given in metres."""
        self._draw.polygon([self._fine(self.at(point)) for point in outline], fill=colour)

    def tint(self, outline: Iterable[Sequence[float]], colour: str, opacity: float) -> None:
        """Fill a polygon given in metres so that what is below shows through."""
        corners = [self._fine(self.at(point)) for point in outline]
        # Only what lies around the polygon is touched: a picture has many of them.
        left, top = (max(0, math.floor(min(each))) for each in zip(*corners, strict=True))
        ends = (math.ceil(max(each)) + 1 for each in zip(*corners, strict=True))
        right, bottom = map(min, ends, self._image.size)
        if right <= left or bottom <= top:
            return  # it lies beside the picture
        mask = Image.new('L', (right - left, bottom - top))
        shifted = [(x - left, y - top) for x, y in corners]
        ImageDraw.Draw(mask).polygon(shifted, fill=round(255 * opacity))
        self._image.paste(ImageColor.getrgb(colour), (left, top), mask)

    def box(self, left: float, top: float, right: float, bottom: float, colour: str) -> None:
        """Fill a rectangle given in points."""
        corners = (*self._fine((left, top)), *self._fine((right, bottom)))
        self._draw.rectangle(corners, fill=colour)

    def line(
        self,
        points: Sequence[Sequence[float]],
        colour: str,
        width: float,
        dash: tuple[float, float] | None = None,
    ) -> None:
        """Draw a line through points in metres; its width and dashes (on, off) are in points."""
        ends = [self.at(point) for point in points]
        pieces = [ends] if dash is None else _dashes(ends, *dash)
        for piece in pieces:
            self._draw.line(
                [self._fine(end) for end in piece],
                fill=colour,
                width=max(1, round(width * _FINE)),
                joint='curve',
            )

    def raster(
        self,
        values: npt.NDArray[np.unsignedinteger],
        origin: Point,
        resolution: float,
        colours: Sequence[str],
    ) -> None:
        """Fill cells of a map, row 0 in the south: those of value 1 with the first colour, ...

        Args:
            values: Shape (rows, columns); 0: not filled.
            origin: South-west corner, metres.
            resolution: Side of a cell, metres.
            colours: One for each value from 1.
        """
        left, bottom = self._fine(self.at(origin))
        side = resolution * self.scale * _FINE
        wide, high = self._image.size
        north = values[::-1]  # row 0 of a picture is in the north
        top = bottom - len(north) * side
        # Each fine pixel is what the cell is that its middle lies in; all others are off the map.
        column = np.floor((np.arange(wide) + 0.5 - left) / side).astype(np.intp)
        row = np.floor((np.arange(high) + 0.5 - top) / side).astype(np.intp)
        across = np.flatnonzero((column >= 0) & (column < north.shape[1]))
        down = np.flatnonzero((row >= 0) & (row < north.shape[0]))
        if not across.size:
            return
        palette = np.array([(0, 0, 0), *map(ImageColor.getrgb, colours)], np.uint8)
        for first in range(0, len(down), 256):
            some = down[first : first + 256]
            shown = north[row[some][:, None], column[across]]
            mask = Image.fromarray((shown > 0).astype(np.uint8) * np.uint8(255))
            corner = (int(across[0]), int(some[0]))
            self._image.paste(Image.fromarray(palette[shown]), corner, mask)

    def arc(
        self,
        centre: Sequence[float],
        radius: float,
        start: float,
        end: float,
        colour: str,
        width: float,
    ) -> None:
        """Draw an arc in metres, anticlockwise between two angles in rad."""
        steps = np.linspace(start, end, 24)
        points = [
            (centre[0] + radius * math.cos(a), centre[1] + radius * math.sin(a)) for a in steps
        ]
        self.line(points, colour, width)

    def disc(self, centre: Sequence[float], radius: float, colour: str) -> None:
        """Fill a circle around a point in metres; its radius is in points."""
        x, y = self.at(centre)
        corners = (*self._fine((x - radius, y - radius)), *self._fine((x + radius, y + radius)))
        self._draw.ellipse(corners, fill=colour)

    def pill(self, centre: Point, text: str, size: float, colour: str) -> None:
        """Write text on a rounded sign; its centre and size are in points."""
        width = self.text_width(text, size) + size * 1.1
        high = size * 1.75
        x, y = centre
        self._draw.rounded_rectangle(
            (
                *self._fine((x - max(width, high) / 2, y - high / 2)),
                *self._fine((x + max(width, high) / 2, y + high / 2)),
            ),
            radius=high / 2 * _FINE,
            fill=colour,
        )
        self.text(centre, text, size, 'white', anchor='mm')

    def text(self, at: Point, text: str, size: float, colour: str, anchor: str = 'la') -> None:
        """Write text at a point in points; `anchor` as Pillow has it."""
        self._draw.text(self._fine(at), text, fill=colour, font=_font(size), anchor=anchor)

    def text_width(self, text: str, size: float) -> float:
        """Return how wide a text is, points."""
        return float(self._draw.textlength(text, font=_font(size))) / _FINE

    def traces(
        self, lines: Iterable[Sequence[Sequence[float]]], colour: str, width: float, opacity: float
    ) -> None:
        """Draw lines in metres that show through: where many lie, the colour is stronger."""
        columns, rows = self.size
        count = np.zeros((rows, columns), np.float32)
        for points in lines:
            once = np.zeros((rows, columns), np.uint8)
            fixed = np.rint(np.array([self.at(point) for point in points]) * 16).astype(np.int32)
            thick = max(1, round(width))
            cv2.polylines(once, [fixed], False, 255, thick, cv2.LINE_AA, shift=4)
            count += once.astype(np.float32) / 255
        if not count.any():
            return
        share = 1.0 - (1.0 - opacity) ** count
        coarse = Image.fromarray((share * 255).astype(np.uint8))
        mask = coarse.resize(self._image.size, Image.Resampling.BOX)
        self._image.paste(ImageColor.getrgb(colour), (0, 0), mask)

    def finished(self) -> Image.Image:
        """Return the picture."""
        return self._image.reduce(_FINE)

    @staticmethod
    def _fine(point: Point) -> Point:
        return point[0] * _FINE, point[1] * _FINE


def blend(first: str, second: str, share: float) -> str:
    """Return the colour that lies between two, `share` of the way from the first to the second."""
    start: npt.NDArray[np.float64] = np.array(ImageColor.getrgb(first)[:3], dtype=float)
    end: npt.NDArray[np.float64] = np.array(ImageColor.getrgb(second)[:3], dtype=float)
    red, green, blue = np.rint(start + (end - start) * min(max(share, 0.0), 1.0)).astype(int)
    return f'#{red:02x}{green:02x}{blue:02x}'


def _font(size: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size * _FINE)


def _dashes(ends: Sequence[Point], on: float, off: float) -> list[list[Point]]:
    pieces = []
    for first, last in pairwise(ends):
        length = math.dist(first, last)
        position = 0.0
        while position < length:
            until = min(position + on, length)
            pieces.append([_between(first, last, s / length) for s in (position, until)])
            position = until + off
    return pieces


def _between(first: Point, last: Point, share: float) -> Point:
    return first[0] + share * (last[0] - first[0]), first[1] + share * (last[1] - first[1])
