"""The command that makes a place of a map: `python -m floor_plans.imports FILE`."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from floor_plans.imports.place_import import ImportRequest, import_place
from floor_plans.imports.plan_photo import PlanPhoto
from floor_plans.room_map import ROBOT_RADIUS

EXIT_BAD_INPUT = 2


def add_options(parser: argparse.ArgumentParser) -> None:
    """Give a command's parser the options of an import."""
    parser.description = (
        "Makes a place of a map: finds rooms and doors, writes the place's file and draws it."
    )
    parser.add_argument(
        'map',
        type=Path,
        metavar='FILE',
        help="a map in map_server's format, a picture, Open-RMF's building.yaml, or a graph of "
        'patrolling_sim, Nav2 or Open-RMF',
    )
    parser.add_argument(
        '--out', type=Path, metavar='PLACE', help="the place's file (default: FILE_place.yaml here)"
    )
    parser.add_argument(
        '--labels', type=Path, metavar='PNG', help='also write the rooms as a picture: 0 in none'
    )
    parser.add_argument(
        '--resolution', type=float, metavar='M', help="side of a picture's pixel, metres"
    )
    parser.add_argument(
        '--level', default='', metavar='NAME', help='the level of a building that has several'
    )
    parser.add_argument(
        '--robot-radius',
        type=float,
        default=ROBOT_RADIUS,
        metavar='M',
        help=f'radius of the robot, metres (default: {ROBOT_RADIUS:g})',
    )
    parser.add_argument(
        '--update',
        type=Path,
        metavar='PLACE',
        help='the place of an older map of this building: rooms that are still there keep their '
        'names and all that is said of them, and what has changed is told',
    )
    parser.add_argument(
        '--keep-old',
        default='',
        metavar='NAMES',
        help='rooms and doors of --update that have changed and are to be as they were: R5,D9; '
        'all: each of which that can be',
    )
    parser.add_argument(
        '--with-outside',
        action='store_true',
        help='make a room of what is outside of the building, up to the edge of the map',
    )
    parser.add_argument(
        '--aisles',
        action='store_true',
        help='make a place of each aisle of a hall, and of each way before and behind its shelves',
    )
    parser.add_argument(
        '--plan-scale',
        default='',
        metavar='TEXT',
        help='the picture is a photo or scan of a floor plan: two of its points and how far they '
        "are apart, in pixels and metres: '120,80 940,80 12.5'",
    )
    parser.add_argument(
        '--plan-corners',
        default='',
        metavar='TEXT',
        help='four corners of a rectangle of that plan, in turn, where the photo is not straight: '
        "'10,20 900,35 890,700 15,690'",
    )
    parser.add_argument(
        '--json', action='store_true', help='print what was found for a program, as JSON'
    )
    parser.add_argument(
        '--force', action='store_true', help='write over a place that is there already'
    )


def _photo(options: argparse.Namespace) -> PlanPhoto | None:
    if options.plan_corners and not options.plan_scale:
        raise ValueError('--plan-corners: expected --plan-scale with it')
    if not options.plan_scale:
        return None
    return PlanPhoto.from_words(options.plan_corners, options.plan_scale)


def _names(options: argparse.Namespace) -> tuple[str, ...]:
    if options.keep_old and options.update is None:
        raise ValueError('--keep-old: expected --update with it')
    return tuple(name for each in options.keep_old.split(',') if (name := each.strip()))


def main(argv: Sequence[str] | None = None, parser: argparse.ArgumentParser | None = None) -> int:
    """Make a place of a map and say what was found; the exit code is 2 for bad input.

    Args:
        argv: The words of the command line; None: those of the process.
        parser: Of a program whose command this is.
    """
    parser = parser or argparse.ArgumentParser(prog='python -m floor_plans.imports')
    add_options(parser)
    options = parser.parse_args(argv)
    if not 0.01 <= options.robot_radius <= 5.0:
        parser.error(f'--robot-radius {options.robot_radius:g}: expected 0.01 to 5')
    try:
        report = import_place(
            ImportRequest(
                source=options.map,
                out=options.out,
                radius=options.robot_radius,
                resolution=options.resolution,
                level=options.level,
                labels=options.labels,
                force=options.force,
                with_outside=options.with_outside,
                aisles=options.aisles,
                photo=_photo(options),
                update=options.update,
                keep_old=_names(options),
                command=f'{parser.prog} {options.map}',
            )
        )
    except ValueError as error:
        print(f'import: {error}', file=sys.stderr)
        return EXIT_BAD_INPUT
    print(json.dumps(report.content) if options.json else report)
    return 0
