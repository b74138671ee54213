#!/usr/bin/env python3
"""Measure how well rooms are found on maps with drawn truth, beside a plain watershed.

    .venv/bin/python benchmarks/rooms.py FOLDER [--doors] [--turned] [--quick]
    .venv/bin/python benchmarks/rooms.py --drawn COUNT [--seed N] [--doors] [--clicks]

FOLDER holds `NAME.png`, `NAME_furnitures.png` and `NAME_gt_segmentation.png`, as the collection of
Bormann et al., "Room Segmentation: Survey, Implementation, and Analysis" (ICRA 2016) has them:
0.05 m a pixel; in the truth, rooms are white and closed by black lines. Recall and precision are
that survey's; "matched" is the share of true rooms that a found one overlaps (intersection over
union) by at least 0.7. The peer: distance transform, the threshold with most components as seeds,
watershed. `--drawn` takes plans that are drawn from a seed (`drawn_plans`) in place of a folder.

`--doors` prints how many of the openings between true rooms are found: a line that was drawn
between two rooms, free in the map and wide enough for the robot, counts as found if the middle of a
proposed door lies within 0.5 m of it; a proposed door with no such line within 0.5 m is false.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.segmentation import watershed

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.drawn_plans import drawn_plan
from benchmarks.sizes import Size, sized_parser
from floor_plans.map_rooms import propose, segment
from floor_plans.occupancy_map import OccupancyMap, read_map

FREE = 205
RADIUS = 0.22
NEAR = 0.5
SMALLEST = 400
TRUTH = '_gt_segmentation.png'
Image = NDArray[np.uint8]
Labels = NDArray[np.int32]


def ours(image: Image, resolution: float) -> Labels:
    """Return the project's rooms of a picture, in the picture's order of rows: as people get it."""
    building = as_map(image, resolution)
    try:
        return propose(building, RADIUS).segmentation.labels[::-1]
    except ValueError:  # so small that no robot fits
        return segment(building.own_grid).labels[::-1]


def as_map(image: Image, resolution: float = 0.05) -> OccupancyMap:
    """Return a picture as the command `import` reads it."""
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / 'map.png'
        cv2.imwrite(str(picture), image)
        return read_map(picture, resolution=resolution)


def true_doors(image: Image, drawn: Image, truth: Labels) -> list[NDArray[np.float64]]:
    """Return the openings between true rooms at 0.05 m: the pixels of each drawn line, x and y."""
    line = ((drawn <= 230) & (image > FREE)).astype(np.uint8)
    line = np.asarray(cv2.morphologyEx(line, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)))
    count, pieces = cv2.connectedComponents(line, connectivity=8)
    away = cv2.distanceTransform((image > FREE).astype(np.uint8), cv2.DIST_L2, 5)
    found = []
    for piece in range(1, count):
        mask = pieces == piece
        around = cv2.dilate(mask.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
        rooms = set(np.unique(truth[around]).tolist()) - {0}
        # The robot has room at its freest pixel.
        if len(rooms) >= 2 and away[mask].max() * 0.05 > RADIUS:
            found.append(np.argwhere(mask)[:, ::-1].astype(float))
    return found


def door_scores(
    image: Image, resolution: float, lines: list[NDArray[np.float64]]
) -> tuple[int, int, int, int]:
    """Return how many true doors there are and are found, how many proposed and how many false."""
    placed = propose(as_map(image, resolution), RADIUS).parameters.get('doors', {})
    own = np.array([row[:2] for row in placed.values()]).reshape(-1, 2) / resolution
    own[:, 1] = image.shape[0] - own[:, 1]
    gaps = np.array([[np.hypot(*(line - door).T).min() for line in lines] for door in own]).reshape(
        len(own), len(lines)
    )
    near = gaps <= NEAR / resolution
    return len(lines), int(near.any(axis=0).sum()), len(own), int((~near.any(axis=1)).sum())


def corrections(found: Labels, truth: Labels) -> int:
    """Return the clicks in the editor that make the found rooms the true ones.

    Found rooms that lie in one true room are joined (one tap on the door between them), true rooms
    in one found room are cut apart (two taps each); each of the two tools is chosen once.
    """
    inside = (truth > 0) & (found > 0)
    pairs, areas = np.unique(np.stack([truth[inside], found[inside]]), axis=1, return_counts=True)
    shares = sorted(zip(areas.tolist(), *pairs.tolist(), strict=True), reverse=True)
    home: dict[int, int] = {}
    held: dict[int, int] = {}
    for _, room, segment_ in shares:  # the largest share first
        home.setdefault(segment_, room)
        held.setdefault(room, segment_)
    joins = len(home) - len(set(home.values()))
    cuts = sum(home[segment_] != room for room, segment_ in held.items())
    return joins + 2 * cuts + (joins > 0) + (cuts > 0)


def peer(image: Image, resolution: float) -> Labels:
    """Return the basins of the plain watershed."""
    free = image > FREE
    away = cv2.distanceTransform(free.astype(np.uint8), cv2.DIST_L2, 5)
    thresholds = np.arange(2, 60) * 0.05 / resolution
    best = max(thresholds, key=lambda t: cv2.connectedComponents((away > t).astype(np.uint8))[0])
    seeds = cv2.connectedComponents((away > best).astype(np.uint8))[1]
    return np.asarray(watershed(-away, seeds, mask=free), np.int32)


def true_rooms(image: Image) -> Labels:
    """Return the rooms of a truth picture at 0.05 m."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(
        (image > 230).astype(np.uint8), connectivity=4
    )
    small = stats[:, cv2.CC_STAT_AREA] < SMALLEST
    return np.where(small[labels], 0, labels).astype(np.int32)


def scores(found: Labels, truth: Labels) -> tuple[float, float, float]:
    """Return recall, precision and the share of true rooms that are matched."""
    inside = truth > 0
    pairs, areas = np.unique(np.stack([truth[inside], found[inside]]), axis=1, return_counts=True)
    of_truth = dict(zip(*np.unique(truth[inside], return_counts=True), strict=True))
    of_found = dict(zip(*np.unique(found[inside], return_counts=True), strict=True))
    of_found.pop(0, None)
    recall, precision, match = (dict[int, float]() for _ in range(3))
    for (room, segment_), area in zip(pairs.T.tolist(), areas.tolist(), strict=True):
        if segment_:
            union = of_truth[room] + of_found[segment_] - area
            for table, key, value in (
                (recall, room, area / of_truth[room]),
                (precision, segment_, area / of_found[segment_]),
                (match, room, area / union),
            ):
                table[key] = max(table.get(key, 0.0), value)
    matched = sum(value >= 0.7 for value in match.values())
    return (
        sum(recall.values()) / len(of_truth),
        sum(precision.values()) / max(1, len(of_found)),
        matched / len(of_truth),
    )


def variants(
    image: Image, resolution: float, truth: Labels, turned: bool
) -> Iterator[tuple[str, float, Image, Labels]]:
    """Yield a map and its truth as it is, and one of 0.05 m at other resolutions and turned."""
    yield 'as drawn', resolution, image, truth
    if not turned:
        return
    rows, columns = image.shape
    for name, side in (('0.025 m', 0.025), ('0.1 m', 0.1)):
        size = (round(columns * 0.05 / side), round(rows * 0.05 / side))
        how = cv2.INTER_NEAREST if side < 0.05 else cv2.INTER_AREA
        other = cv2.resize(image, size, interpolation=how)
        if side > 0.05:
            # A mapper marks a cell in which any ray ended.
            dark = cv2.erode(image, np.ones((2, 2), np.uint8), anchor=(0, 0))
            other = np.minimum(other, cv2.resize(dark, size, interpolation=cv2.INTER_NEAREST))
        yield name, side, other, truth
    span = int(np.hypot(rows, columns)) + 4
    turn = cv2.getRotationMatrix2D((columns / 2, rows / 2), 17.0, 1.0)
    turn[:, 2] += ((span - columns) / 2, (span - rows) / 2)
    flags = {'flags': cv2.INTER_NEAREST, 'borderMode': cv2.BORDER_CONSTANT}
    yield (
        'turned 17 deg',
        0.05,
        cv2.warpAffine(image, turn, (span, span), borderValue=128, **flags),
        cv2.warpAffine(truth, turn, (span, span), borderValue=0, **flags),
    )


def main() -> int:
    parser = sized_parser(__doc__, quick='the first three maps')
    parser.add_argument('folder', type=Path, nargs='?')
    parser.add_argument('--turned', action='store_true', help='other resolutions and directions')
    parser.add_argument('--doors', action='store_true', help='the doors, too')
    parser.add_argument('--clicks', action='store_true', help='corrections in the editor, too')
    parser.add_argument('--each', action='store_true', help='a line for each map')
    parser.add_argument('--drawn', type=int, metavar='COUNT', help='plans drawn from seeds')
    parser.add_argument('--seed', type=int, help='the first seed of those; none: any')
    options = parser.parse_args()
    cases: Iterable[Case]
    with tempfile.TemporaryDirectory() as example:
        if options.size is Size.SMOKE:
            options.doors = options.clicks = options.turned = True
            draw_example(Path(example))
            cases = chain(cases_of(Path(example), options.size), drawn_cases(1, 3))
        elif options.drawn:
            seed = random.randrange(1_000_000) if options.seed is None else options.seed
            print(f'seeds {seed} to {seed + options.drawn - 1}')
            options.turned = False
            cases = drawn_cases(options.drawn, seed)
        elif options.folder is None:
            parser.error('the folder with maps is missing, or --drawn')
        else:
            cases = cases_of(options.folder, options.size)
        measure(options, cases)
    return 0


def draw_example(folder: Path) -> None:
    """Draw two rooms with a door between them, and the truth of that."""
    truth = np.zeros((120, 220), np.uint8)
    truth[10:110, 10:106] = truth[10:110, 114:210] = 255
    image = truth.copy()
    image[48:72, 106:114] = 255
    for ending, picture in (('.png', image), ('_furnitures.png', image), (TRUTH, truth)):
        cv2.imwrite(str(folder / f'example{ending}'), picture)


@dataclass(frozen=True)
class Case:
    """A map with its truth: how it is called, what kind it is, the picture, rooms and doors."""

    name: str
    kind: str
    image: Image
    resolution: float
    truth: Labels
    doors: list[NDArray[np.float64]]


def cases_of(folder: Path, size: Size) -> Iterator[Case]:
    """Yield the maps of a folder, each empty and furnished."""
    names = sorted(path.name.removesuffix(TRUTH) for path in folder.glob('*' + TRUTH))
    for name in size.of(names, names[:3], names):
        drawn: Any = cv2.imread(str(folder / (name + TRUTH)), cv2.IMREAD_GRAYSCALE)
        truth = true_rooms(drawn)
        for kind, ending in (('empty', '.png'), ('furnished', '_furnitures.png')):
            image: Any = cv2.imread(str(folder / (name + ending)), cv2.IMREAD_GRAYSCALE)
            yield Case(name, kind, image, 0.05, truth, true_doors(image, drawn, truth))


def drawn_cases(count: int, seed: int) -> Iterator[Case]:
    """Yield plans drawn from a seed and those after it, each empty and furnished."""
    for number in range(seed, seed + count):
        for kind in ('empty', 'furnished'):
            plan = drawn_plan(number, kind == 'furnished')
            name = f'seed {number}'
            yield Case(name, kind, plan.image, plan.resolution, plan.truth, plan.doors)


def measure(options: argparse.Namespace, cases: Iterable[Case]) -> None:
    """Measure maps and print the tables."""
    methods: dict[str, Callable[[Image, float], Labels]] = {'watershed': peer, 'ours': ours}
    results: dict[tuple[str, str, str], list[tuple[float, ...]]] = {}
    doors: dict[str, list[tuple[int, ...]]] = {}
    clicks: dict[str, list[tuple[int, int]]] = {}
    for case in cases:
        name, kind, image, truth = case.name, case.kind, case.image, case.truth
        if options.doors:
            doors.setdefault(kind, []).append(door_scores(image, case.resolution, case.doors))
            if options.each:
                print(name, kind, 'doors', *doors[kind][-1])
        for variant, side, other, true in variants(image, case.resolution, truth, options.turned):
            for method, find in methods.items():
                begin = time.perf_counter()
                labels = find(other, side)
                seconds = time.perf_counter() - begin
                if labels.shape != true.shape:
                    size = (true.shape[1], true.shape[0])
                    labels = cv2.resize(
                        labels.astype(np.float32), size, interpolation=cv2.INTER_NEAREST
                    ).astype(np.int32)
                row = (*scores(labels, true), seconds)
                if options.clicks and (method, variant) == ('ours', 'as drawn'):
                    rooms = len(np.unique(true[true > 0]))
                    clicks.setdefault(kind, []).append((rooms, corrections(labels, true)))
                    if options.each:
                        print(name, kind, 'clicks', clicks[kind][-1][1], 'rooms', rooms)
                results.setdefault((kind, variant, method), []).append(row)
                if options.each and method == 'ours':
                    print(name, kind, variant, *(f'{value:.3f}' for value in row), flush=True)
    print(f'{"maps":10} {"variant":14} {"method":10} recall precision matched  seconds')
    for (kind, variant, method), rows in results.items():
        recall, precision, matched, seconds = np.mean(rows, axis=0)
        print(
            f'{kind:10} {variant:14} {method:10} {recall:6.3f} {precision:9.3f} {matched:7.3f} '
            f'{seconds:8.2f}'
        )
    for kind, counted in clicks.items():
        each = sorted(30 * taken / rooms for rooms, taken in counted)
        print(
            f'{kind:10} corrections for 30 rooms: median {np.median(each):.0f} clicks, '
            f'least {each[0]:.0f}, most {each[-1]:.0f}'
        )
    for kind, counts in doors.items():
        true_, found, proposed, false = np.sum(counts, axis=0)
        print(
            f'{kind:10} doors: {found} of {true_} found ({found / true_:.1%}), '
            f'{false} of {proposed} false ({false / proposed:.1%})'
        )


if __name__ == '__main__':
    sys.exit(main())
