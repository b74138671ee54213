"""A robot visits two rooms again and again, and says what is not as it was.

    python -m indoor_watch.demo [--picture FILE]

The lidar is computed, everything else is the library's. The pose that is handed in is off by some
centimetres and half a degree, by another amount in each visit, as that of a real robot is. First
the robot learns what is normal. Then a box appears, the door is shut, and both are put right again.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from floor_plans import Grid
from indoor_watch.change_monitor import ChangeMonitor
from indoor_watch.events import Event, EventBook
from indoor_watch.evidence import sweep_picture
from indoor_watch.observations import Observation
from indoor_watch.watch_rules import rule_from

SIDE = 0.05
"""Of a cell of the map, metres."""
DOOR = (4.05, 1.55, 4.05, 2.45)
"""Its opening, between the rooms `hall` and `office`, metres."""
POINTS = {'hall': (2.0, 1.5), 'office': (6.0, 2.0)}
RULES = ({'object': 'none'}, {'door': 'D1', 'is': 'open'})
OFF = (0.05, math.radians(0.5))
"""Standard deviation of a visit's pose, metres and rad."""
SWEEPS = 12
RANGE = 8.0
_BEAMS = np.linspace(-math.pi, math.pi, 360, endpoint=False)


class TwoRooms:
    """Two rooms of 4 by 4 metres with a door between them."""

    def __init__(self) -> None:
        cells = np.zeros((80, 162), np.int8)
        cells[[0, 1, -1, -2], :] = cells[:, [0, 1, -1, -2, 80, 81]] = 100
        cells[31:49, 80:82] = 0
        self.grid = Grid(cells, SIDE, (0.0, 0.0))
        self.box: tuple[float, float, float] | None = None
        self.is_shut = False

    def place_at(self, point: Sequence[float]) -> str | None:
        """Return the place that a point lies in."""
        return 'hall' if point[0] < DOOR[0] else 'office'

    def cells_of(self, place: str) -> NDArray[np.bool_] | None:
        """Return the cells of a place."""
        west = np.arange(self.grid.cells.shape[1]) * SIDE < DOOR[0]
        return np.asarray(self.grid.free & (west if place == 'hall' else ~west))

    def measured(self, at: tuple[float, float], yaw: float) -> NDArray[np.float64]:
        """Return how far a lidar's beams go, (360,), metres."""
        along = np.arange(0.05, RANGE, SIDE / 3)
        x = at[0] + np.cos(_BEAMS + yaw)[:, None] * along
        y = at[1] + np.sin(_BEAMS + yaw)[:, None] * along
        cells = self.grid.cells_of(np.stack([x.ravel(), y.ravel()], axis=1))
        inside = self.grid.contains(cells)
        blocked = ~inside
        blocked[inside] = self.grid.occupied[cells[inside, 0], cells[inside, 1]]
        blocked = blocked.reshape(x.shape)
        if self.box is not None:
            left, low, side = self.box
            blocked |= (np.abs(x - left) < side / 2) & (np.abs(y - low) < side / 2)
        if self.is_shut:
            blocked |= (np.abs(x - DOOR[0]) < 0.03) & (y > DOOR[1]) & (y < DOOR[3])
        return np.where(blocked.any(axis=1), along[blocked.argmax(axis=1)], RANGE)


class Demo:
    """The robot, and what it says.

    Args:
        say: Called with each line.
        seed: Of the noise.
    """

    def __init__(self, say: object = print, seed: int = 3) -> None:
        self.rooms = TwoRooms()
        self.lines: list[str] = []
        self._say, self._noise = say, np.random.default_rng(seed)
        self.time = datetime(2026, 3, 2, 9, tzinfo=UTC).timestamp()
        self.book = EventBook(told=self._changed)
        self.monitor = ChangeMonitor(
            [rule_from(each) for each in RULES],
            self.book,
            local=lambda stamp: datetime.fromtimestamp(stamp, UTC),
            robot='Robot1',
            doors={'D1': DOOR},
            rooms=self.rooms,
            tell=self._seen,
        )
        self.monitor.use_map(self.rooms.grid)

    def visit(self, place: str) -> None:
        """Look at a place for some seconds, at a pose that is off."""
        true = POINTS[place]
        x, y = self._noise.normal(0.0, OFF[0], 2)
        turn = float(self._noise.normal(0.0, OFF[1]))
        sensor = float(true[0] + x), float(true[1] + y)
        self.monitor.arrive(place, self.time)
        for number in range(SWEEPS):
            self.time += 1.0
            yaw = 0.5 * number
            ranges = self.rooms.measured(true, yaw)
            met = ranges < RANGE
            ranges = ranges + self._noise.normal(0.0, 0.01, len(ranges))
            angles = _BEAMS + yaw + turn
            ends = np.stack([np.cos(angles), np.sin(angles)], axis=1) * ranges[:, None] + sensor
            self.monitor.sweep(sensor, ends, met, self.time)
            if number % 4 == 3:
                self.monitor.assess(self.time)

    def round(self, title: str) -> None:
        """Visit both rooms."""
        self.tell(title)
        for place in POINTS:
            self.visit(place)
        self.monitor.arrive('', self.time)
        self.time += 600.0

    def tell(self, line: str) -> None:
        """Say a line."""
        self.lines.append(line)
        if callable(self._say):
            self._say(line)

    def picture(self) -> NDArray[np.uint8]:
        """Return the map around the box, with what the lidar meets from the hall."""
        x, y = POINTS['hall']
        ranges = self.rooms.measured((x, y), 0.0)
        ends = np.stack([np.cos(_BEAMS), np.sin(_BEAMS)], axis=1) * ranges[:, None] + (x, y)
        middle = (x, y) if self.rooms.box is None else self.rooms.box[:2]
        return sweep_picture(self.rooms.grid, middle, (x, y), ends)

    def _changed(self, event: Event, _instead: Observation | None) -> None:
        self.tell(f'  event {event.words()}: {event.state}')

    def _seen(self, seen: Observation) -> None:
        if self.book.find(1) is None and seen.kind != 'door':
            self.tell(f'  {seen.words()}, confidence {seen.confidence:.2f}')


def run(say: object = print) -> Demo:
    """Let the robot go its rounds; return what came of it."""
    demo = Demo(say)
    demo.round('first round: all that stands there is normal')
    demo.round('second round: nothing has changed, and the pose is off by something else')
    demo.rooms.box = (1.0, 2.8, 0.3)
    demo.round('a box of 30 cm stands in the hall')
    demo.rooms.is_shut = True
    demo.round('the door is shut, too')
    demo.rooms.box, demo.rooms.is_shut = None, False
    demo.round('all is as it was')
    return demo


def main(args: Sequence[str] | None = None) -> int:
    """Run the demo."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument(
        '--picture', type=Path, help='write what the lidar meets with the box there'
    )
    options = parser.parse_args(args)
    demo = run()
    if options.picture is not None:
        demo.rooms.box = (1.0, 2.8, 0.3)
        cv2.imwrite(str(options.picture), demo.picture())
    return 0


if __name__ == '__main__':
    sys.exit(main())
