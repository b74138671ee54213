"""Published maps, imported and patrolled: what `launch.py import` makes of each, driven.

    .venv/bin/python benchmarks/published_maps.py FOLDER [--minutes 10] [--quick] [MAP ...]

FOLDER holds maps in map_server's format, in folders of their own or not: those of nav2_bringup
(depot, tb3_sandbox, warehouse), turtlebot3_navigation2, aws-robomaker-small-house-world and the
like; nothing in it is changed, and no file is touched by hand. Each map is imported as the command
does it, and the whole stack patrols the place on simulated time, in the walls of the map.
Collisions are the simulator's own count; rooms are those of the place, all of which the robot can
reach.
"""

from __future__ import annotations

import contextlib
import json
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.localisation import print_table
from benchmarks.sizes import Size, sized_parser
from benchmarks.whole_stack import ROOT, Stack
from floor_plans import read_place
from floor_plans.imports import ImportRequest, import_place
from floor_plans.occupancy_map import read_map, write_map

PATIENCE = 300.0
"""So long in real time without a simulated second, and the run has failed, seconds."""


@dataclass(frozen=True)
class Patrol:
    """What came of a patrol: simulated seconds, metres, collisions, rooms that were visited."""

    seconds: float
    metres: float
    collisions: int
    visited: frozenset[str]
    first_round: float
    error: str = ''


def patrolled(place: Path, seconds: float) -> Patrol:
    """Patrol a place for simulated seconds."""
    rooms = read_place(place).plan.place.rooms
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / 'events.jsonl'
        stack = Stack(place, {'robot_behavior': {'record': str(record)}})
        stack.start()
        error = ''
        try:
            begun = stack.robot.time
            last, heard = begun, time.monotonic()
            while stack.robot.time < begun + seconds:
                time.sleep(0.1)
                if stack.robot.time > last + 1.0:
                    last, heard = stack.robot.time, time.monotonic()
                if stack.error is not None or time.monotonic() - heard > PATIENCE:
                    error = repr(stack.error) if stack.error else 'time stands still'
                    break
            driven, collisions = stack.robot.base.travelled, stack.robot.base.collisions
            passed = stack.robot.time - begun
        finally:
            stack.close()
        events = [json.loads(line) for line in record.read_text().splitlines()]
    visits = [each for each in events if each['event'] in ('start', 'visit')]
    first = 0.0
    seen: set[str] = set()
    for each in visits:
        if each['place'] not in seen:
            seen.add(each['place'])
            first = each['time'] - visits[0]['time']
    return Patrol(passed, driven, collisions, frozenset(seen & set(rooms)), first, error)


def maps_in(folder: Path) -> list[Path]:
    """Return the descriptions of maps below a folder; masks of costmap filters are none."""
    found = []
    for path in sorted(folder.rglob('*.yaml')):
        try:
            read_map(path)
        except ValueError:
            continue
        if not path.stem.endswith(('_keepout', '_speed', '_mask')):
            found.append(path)
    return found


def main() -> int:
    """Import and patrol each map; print the table."""
    parser = sized_parser(__doc__, quick='two minutes each')
    parser.add_argument('folder', type=Path, nargs='?')
    parser.add_argument('only', nargs='*', metavar='MAP', help='names of maps; default: all')
    parser.add_argument('--minutes', type=float, default=10.0, help='simulated, each map')
    options = parser.parse_args()
    seconds = options.size.of(60.0 * options.minutes, 120.0, 5.0)
    if options.size is Size.SMOKE:
        with tempfile.TemporaryDirectory() as folder:
            plan = read_place(ROOT / 'config' / 'seven_rooms.yaml').plan
            grid = plan.grid()
            write_map(
                Path(folder) / 'map.yaml', grid.cells[::-1], grid.resolution, (*grid.origin, 0.0)
            )
            patrol_each(Path(folder), (), seconds)
    elif options.folder is None:
        parser.error('the folder with maps is missing')
    else:
        patrol_each(options.folder, options.only, seconds)
    return 0


def patrol_each(maps: Path, only: Sequence[str], simulated: float) -> None:
    """Import and patrol maps of a folder for simulated seconds each; print the table."""
    rows = []
    for path in maps_in(maps):
        name = str(path.relative_to(maps).with_suffix(''))
        if only and name not in only:
            continue
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder) / 'place.yaml'
            begun = time.perf_counter()
            try:
                import_place(ImportRequest(path, place))
            except ValueError as error:
                rows.append((name, '-', '-', str(error)[:60], '-', '-', '-', '-'))
                continue
            seconds = time.perf_counter() - begun
            rows_, columns = read_map(path).cells.shape
            rooms = read_place(place).plan.place.rooms
            with contextlib.chdir(folder):  # a map's file is named as seen from the place's
                run = patrolled(place, simulated)
        rows.append(
            (
                name,
                f'{columns} x {rows_}',
                f'{seconds:.1f}',
                run.error or f'{run.seconds / 60:.1f}',
                f'{run.metres:.0f}',
                str(run.collisions),
                f'{len(run.visited)} of {len(rooms)}',
                f'{run.first_round:.0f}',
            )
        )
        print(*rows[-1], ' '.join(sorted(set(rooms) - run.visited)), flush=True)
    print_table(
        'Published maps: imported and patrolled with no file touched by hand.',
        (
            *('map', 'cells', 'import s', 'simulated min', 'm', 'collisions', 'rooms visited'),
            'all seen s',
        ),
        rows,
    )


if __name__ == '__main__':
    sys.exit(main())
