"""The command `explore`: the robot maps a building by itself, and the map becomes a place."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from launcher.environment import COMMAND, PROGRAM
from launcher.run import NOT_RECORDED, Run, shared_options, wanted_run
from surveillance_runtime.command_line import EXIT_BAD_INPUT, CommandParser
from surveillance_runtime.node_table import DEFAULT_MODE, EXPLORER

EXIT_NOTHING_SEEN = 1
"""Of a run that ended before there was a map."""
_MODES = ('SIMULATED', 'ROBOT')
_USAGE = '%(prog)s [--map PLACE | --mode ROBOT --robot NAME|FILE] [options]'
_DESCRIPTION = """\
Drives through a building that nobody has mapped until nothing is left to see, drives back, writes
the map and makes a place of it as `import` does. Ctrl-C ends it earlier, with the map as it is
then. In mode SIMULATED the building is the place of --map, and the robot is not told it."""


def options_of(argv: Sequence[str]) -> argparse.Namespace:
    """Return what the command line of `explore` says.

    Raises:
        ValueError: Something cannot be used.
    """
    parser = CommandParser(
        prog=f'{PROGRAM} explore',
        usage=_USAGE,
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        parents=[shared_options()],
    )
    parser.add_argument(
        '--out',
        type=Path,
        default=Path('building.yaml'),
        metavar='MAP',
        help='the map (default: %(default)s); with building.pgm, building_place.yaml and '
        'building_place.png beside it',
    )
    parser.add_argument(
        '--slam',
        action='store_true',
        help='another program maps, as slam_toolbox: follow its topic map, and map -> odom on tf '
        'or its topic pose',
    )
    parser.add_argument('--force', action='store_true', help='write over what is there already')
    parser.add_argument(
        '--for', dest='seconds', type=float, metavar='SECONDS', help='end after this time'
    )
    parser.add_argument(
        '--record',
        default=NOT_RECORDED,
        metavar='off|DIR',
        help="record as `run` does; the run's folder is made below DIR (default: %(default)s)",
    )
    options = parser.parse_args(argv)
    if options.out.suffix not in ('.yaml', '.yml'):
        raise ValueError(f'--out {options.out}: expected a name that ends in .yaml')
    folder = options.out.absolute().parent
    if not folder.is_dir():
        raise ValueError(f'--out {options.out}: there is no folder {options.out.parent}')
    # Said now and not after hours of driving.
    if not os.access(folder, os.W_OK | os.X_OK):
        raise ValueError(f'--out {options.out}: nothing can be written into {options.out.parent}')
    if folders := [str(file) for file in files_of(options.out) if file.is_dir()]:
        raise ValueError(f'--out {options.out}: {", ".join(folders)}: expected no folder there')
    if options.seconds is not None and not 0.0 < options.seconds < 1e9:
        raise ValueError(f'--for {options.seconds:g}: expected a positive number of seconds')
    mode = options.mode or DEFAULT_MODE
    if mode not in _MODES:
        raise ValueError(f'--mode {mode}: expected {" or ".join(_MODES)}: others do not drive')
    if mode == 'ROBOT' and options.place is not None:
        raise ValueError('--map: expected with --mode SIMULATED only, as the building to explore')
    if options.robots is not None:
        raise ValueError('--robots: one robot explores; expected no such option')
    there = [str(file) for file in files_of(options.out) if file.exists()]
    if there and not options.force:
        raise ValueError(f'{", ".join(there)}: there already; expected another --out, or --force')
    return options


def files_of(out: Path) -> tuple[Path, ...]:
    """Return the files that are written: map, its picture, place, its picture."""
    place = place_of(out)
    return out, out.with_suffix('.pgm'), place, place.with_suffix('.png')


def place_of(out: Path) -> Path:
    """Return the file of the place that is made of a map."""
    return out.with_name(f'{out.stem}_place.yaml')


def run_exploration(options: argparse.Namespace, config: Path, runs: Path) -> int:
    """Explore, and make a place of the map; return the exit code."""
    from launcher.run_mission import RunJob, run_mission
    from surveillance_runtime.configuration import Entry
    from surveillance_runtime.run_parameters import for_node

    mode = options.mode or DEFAULT_MODE
    nodes = ('simulator', 'collision_monitor', EXPLORER)
    run: Run = replace(
        wanted_run(options),
        mode=mode,
        only=nodes if mode == 'SIMULATED' else nodes[1:],
        fresh=True,
    )

    def entries(folder: Path) -> Iterator[Entry]:
        said = f'{PROGRAM} explore'
        yield for_node(EXPLORER, 'folder', str(folder.resolve()), said)
        yield for_node(EXPLORER, 'mapping', 'topic' if options.slam else 'own', said)
        yield for_node('simulator', 'publish_map', False, said)

    job = RunJob(
        'exploring',
        EXPLORER,
        lambda folder: tuple(entries(folder)),
        lambda folder: close(folder, options, config),
    )
    return run_mission(run, config, runs, job=job)


def close(folder: Path, options: argparse.Namespace, config: Path) -> int:
    """Take the map out of the run's folder, make a place of it; return the exit code."""
    from floor_plans.imports import ImportRequest, import_place
    from floor_plans.occupancy_map import read_map, write_map
    from launcher.run_configuration import profile_of
    from surveillance_controllers.explorer_node import DONE_FILE, MAP_FILE

    found = folder / MAP_FILE
    if not found.exists():
        print(f'{PROGRAM}: nothing was mapped: see {folder / "launch.log"}', file=sys.stderr)
        return EXIT_NOTHING_SEEN
    seen = read_map(found)
    try:
        write_map(options.out, seen.cells, seen.resolution, seen.origin, 'pgm')
    except ValueError as error:
        raise ValueError(f'{error}; the map is kept in {found}') from None
    left = folder / DONE_FILE
    print(f'map: {options.out}' + ('' if left.exists() else ' (not all of the building)'))
    for line in left.read_text('utf-8').splitlines() if left.exists() else ():
        print(f'left: {line}')
    radius = profile_of(config, wanted_run(options)).profile.body.reach
    request = ImportRequest(options.out, place_of(options.out), radius, force=True)
    try:
        report = import_place(request)
    except ValueError as error:
        print(f'{PROGRAM}: {error}', file=sys.stderr)
        return EXIT_BAD_INPUT
    print(report)
    patrol = [*COMMAND, '--mode', options.mode or DEFAULT_MODE]
    if options.mode == 'ROBOT' or options.robot != Run().robot:
        patrol += ['--robot', options.robot]
    print(f'mend it: {shlex.join([*COMMAND, "edit", str(place_of(options.out))])}')
    print(f'patrol: {shlex.join([*patrol, "--map", str(place_of(options.out))])}')
    return 0
