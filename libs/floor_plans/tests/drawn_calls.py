"""What the pictures of two places are drawn of, call by call, as text.

`python -m libs.floor_plans.tests.drawn_calls` writes the texts anew, after a change that is meant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from floor_plans import read_place
from floor_plans.drawing import Canvas, DrivenRun, draw_place
from floor_plans.parameters import zones_from

CONFIG = Path(__file__).with_name('places')
RECORDS = Path(__file__).with_name('drawn')


class Recorded(Canvas):
    """A canvas that writes down what it is told to draw, in points of the picture.

    A letter is as wide as half its size, so that the fonts of a machine make no difference.
    """

    def __init__(self, *where: Any) -> None:
        self.calls: list[str] = []
        super().__init__(*where)
        self.note('canvas', where[3], [*self.size, round(self.scale, 3)])

    def note(self, name: str, colour: str, numbers: Sequence[float], *more: object) -> None:
        """Write down one call."""
        shown = ' '.join(f'{round(float(each), 1) + 0.0:g}' for each in numbers)
        self.calls.append(' '.join([name, colour, shown, *map(str, more)]))

    def _points(self, points: Any) -> list[float]:
        """Return points in metres as numbers in the picture; of many where they lie and turn."""
        found = np.array([self.at(each) for each in points])
        if len(found) > 8:
            found = np.stack([found[0], found[-1], found.mean(axis=0), found.std(axis=0)])
        return [float(each) for each in found.ravel()]

    def polygon(self, outline: Any, colour: str) -> None:
        """Note a polygon."""
        self.note('polygon', colour, self._points(list(outline)))

    def tint(self, outline: Any, colour: str, opacity: float) -> None:
        """Note a tint."""
        self.note('tint', colour, self._points(outline), opacity)

    def box(self, left: float, top: float, right: float, bottom: float, colour: str) -> None:
        """Note a box."""
        self.note('box', colour, [left, top, right, bottom])

    def line(self, points: Any, colour: str, width: float, dash: Any = None) -> None:
        """Note a line."""
        self.note('line', colour, self._points(points), f'{width:.2f}', dash or '')

    def raster(self, values: Any, origin: Any, resolution: float, colours: Sequence[str]) -> None:
        """Note cells."""
        sums = [int((values == number).sum()) for number in range(1, len(colours) + 1)]
        self.note('raster', ','.join(colours), [*self.at(origin), *sums], resolution)

    def disc(self, centre: Any, radius: float, colour: str) -> None:
        """Note a disc."""
        self.note('disc', colour, [*self.at(centre), radius])

    def pill(self, centre: Any, text: str, size: float, colour: str) -> None:
        """Note a sign."""
        self.note('pill', colour, [*centre, size], text)

    def text(self, at: Any, text: str, size: float, colour: str, anchor: str = 'la') -> None:
        """Note a text."""
        self.note('text', colour, [*at, size], anchor, text)

    def text_width(self, text: str, size: float) -> float:
        """Return the same on every machine."""
        return 0.5 * size * len(text)

    def traces(self, lines: Any, colour: str, width: float, opacity: float) -> None:
        """Note lines that show through."""
        for each in lines:
            self.note('trace', colour, self._points(each), f'{width:.2f}', opacity)


def recorded(name: str, run: DrivenRun | None) -> list[str]:
    """Return what the picture of a place is drawn of."""
    plan = read_place(CONFIG / f'{name}.yaml').plan
    assert plan is not None
    zones = zones_from(
        {
            'keep_out_zones': {'wet': [8.0, 3.0, 9.0, 3.0, 9.0, 4.0, 8.0, 4.0]},
            'slow_zones': {'stairs': [0.2, 3.0, 8.0, 4.0, 8.0, 4.0, 9.0, 3.0, 9.0]},
        }
    )
    if run is not None:
        plan = replace(plan, zones=zones)
    made: list[Recorded] = []

    def canvas(*where: Any) -> Recorded:
        made.append(Recorded(*where))
        return made[0]

    with mock.patch('floor_plans.drawing.Canvas', canvas):
        draw_place(plan, 'The house', 'two words', run)
    return made[0].calls


RUN = DrivenRun(
    driven=[[(5.0, 10.0), (10.0, 8.0), (12.0, 8.0)]],
    planned=[[(5.0, 10.0), (12.0, 8.5)]],
    failures=[(10.0, 6.0), (4.0, 9.0)],
    recharges={'E': 3, 'R1': 0, 'R2': 2},
    threshold=100.0,
    waits={'R1': 200.0, 'R2': 50.0, 'C1': 0.0, 'a corridor with a long name': 120.0},
    visits={'R1': 1, 'R2': 12},
    summary='a long day',
)
HURRIED = replace(RUN, threshold=300.0, planned=(), failures=(), waits={'R1': 200.0, 'E': 299.0})
PICTURES: dict[str, tuple[str, DrivenRun | None]] = {
    'patrol_world': ('patrol_world', None),
    'seven_rooms': ('seven_rooms', None),
    'seven_rooms_run': ('seven_rooms', RUN),
    'seven_rooms_hurried': ('seven_rooms', HURRIED),
    'seven_rooms_short': ('seven_rooms', replace(RUN, threshold=None, waits={})),
}


def main() -> None:
    """Write what each picture is drawn of."""
    RECORDS.mkdir(exist_ok=True)
    for picture, (name, run) in PICTURES.items():
        (RECORDS / f'{picture}.txt').write_text('\n'.join(recorded(name, run)) + '\n', 'utf-8')


if __name__ == '__main__':
    main()
