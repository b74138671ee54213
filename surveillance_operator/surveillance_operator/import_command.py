"""The command `import`: makes a place of a robot's map, or of another program's file of places."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from surveillance_operator.graph_import import SUFFIXES, is_rmf_graph, read_graph
from surveillance_operator.map_command import facts
from surveillance_runtime.command_line import EXIT_BAD_INPUT, CommandParser
from surveillance_runtime.files import FileError, in_one_line, replace_text
from surveillance_runtime.map_rooms import Proposal, propose
from surveillance_runtime.place import PlaceFile, read_place_file
from surveillance_runtime.place.drawing import draw_place
from surveillance_runtime.place.occupancy_map import OccupancyMap, is_picture, read_map
from surveillance_runtime.place.writing import format_place
from surveillance_runtime.robot_base import ROBOT_RADIUS


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = CommandParser(
        prog='launch.py import',
        description="Makes a place of a map: finds rooms and doors, writes the place's file and "
        'draws it.',
    )
    parser.add_argument(
        'map',
        type=Path,
        metavar='FILE',
        help="a map in map_server's format, a picture, or a graph of "
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
        '--robot-radius',
        type=float,
        default=ROBOT_RADIUS,
        metavar='M',
        help=f'radius of the robot, metres (default: {ROBOT_RADIUS:g})',
    )
    parser.add_argument(
        '--force', action='store_true', help='write over a place that is there already'
    )
    options = parser.parse_args(argv)
    if not 0.01 <= options.robot_radius <= 5.0:
        parser.error(f'--robot-radius {options.robot_radius:g}: expected 0.01 to 5')
    return options


def import_map(options: argparse.Namespace) -> list[str]:
    """Make the place, write and draw it; return what there is to say.

    Raises:
        FileError: A file cannot be read or written.
        ValueError: The robot fits nowhere, or a file is there already.
    """
    out: Path = options.out or Path(f'{options.map.stem}_place.yaml')
    if out.suffix not in ('.yaml', '.yml'):
        raise ValueError(f'--out {out}: expected a name that ends in .yaml')
    if out.exists() and not options.force:
        raise ValueError(f'{out}: is there already; expected another --out, or --force')
    if options.map.suffix in SUFFIXES or is_rmf_graph(options.map):
        return _import_graph(options, out)
    building = read_map(options.map, resolution=options.resolution)
    if options.labels is not None and options.labels.suffix.lower() != '.png':
        raise ValueError(f'--labels {options.labels}: expected a name that ends in .png')
    try:
        proposal = propose(building, options.robot_radius)
    except ValueError as error:
        raise ValueError(f'{options.map}: {error}') from None
    lines = []
    if options.labels is not None:
        write_labels(proposal, options.labels)
        lines.append(f'rooms as a picture: {options.labels}')
    try:
        replace_text(out, place_text(building, proposal, options, out))
    except OSError as error:
        raise FileError(in_one_line(error)) from None
    written = read_place_file(out, radius=options.robot_radius)
    picture = out.with_suffix('.png')
    if picture.resolve() == building.path.resolve():
        picture = out.with_name(out.stem + '_drawn.png')
    _draw(written, out, picture)
    return [f'{options.map}: {_found(proposal)}', *lines, f'place: {out}', f'drawn: {picture}']


def _import_graph(options: argparse.Namespace, out: Path) -> list[str]:
    parameters = read_graph(options.map)
    if options.labels is not None or options.resolution is not None:
        raise ValueError(
            f'{options.map}: a graph has no pixels: expected neither --labels nor --resolution'
        )
    said = f'{_count(len(parameters["map"]), "room")} of a graph'
    title = f'{said}\nWritten by: python3 launch.py import {options.map}'
    text = format_place(parameters, title)
    try:
        replace_text(out, text)
        written = read_place_file(out, radius=options.robot_radius)
    except OSError as error:
        raise FileError(in_one_line(error)) from None
    _draw(written, out, out.with_suffix('.png'))
    return [f'{options.map}: {said}', f'place: {out}', f'drawn: {out.with_suffix(".png")}']


def place_text(
    building: OccupancyMap, proposal: Proposal, options: argparse.Namespace, out: Path
) -> str:
    """Return the place's file: what `import` proposes for a map."""
    beside = os.path.relpath(building.path.resolve(), out.resolve().parent)
    reference: dict[str, object] = {'map_file': beside}
    if is_picture(building.path):
        reference['map_file_resolution'] = building.resolution
    title = (
        f'{_found(proposal)}\nWritten by: python3 launch.py import {options.map}\n'
        'Metres and radians in the frame of the map. Rename rooms and doors as you like;\n'
        'a door is x, y, direction of the opening, width.\n'
        '`python3 launch.py map FILE` checks and draws it.'
    )
    return format_place({**reference, **proposal.parameters}, title)


def write_labels(proposal: Proposal, path: Path) -> None:
    """Write the rooms as a picture of the map's size: 0 in none, else the room's number.

    Raises:
        FileError: It cannot be written.
    """
    labels = proposal.segmentation.labels[::-1]
    kind = np.uint8 if labels.max() < 256 else np.uint16
    try:
        Image.fromarray(labels.astype(kind)).save(path)
    except OSError as error:
        raise FileError(f'{path}: cannot be written: {error.strerror or error}') from None


def _found(proposal: Proposal) -> str:
    corridors = sum(name.startswith('C') for name in proposal.names.values())
    rooms = len(proposal.names) - corridors
    said = [_count(rooms, 'room')]
    if corridors:
        said.append(_count(corridors, 'corridor'))
    said.append(_count(len(proposal.parameters.get('doors', {})), 'door'))
    if proposal.left_out:
        said.append(f'{len(proposal.left_out)} left out that the robot cannot reach')
    return ', '.join(said)


def _count(number: int, word: str) -> str:
    return f'{number} {word}{"" if number == 1 else "s"}'


def _draw(written: PlaceFile, out: Path, picture: Path) -> None:
    title = out.stem.replace('_', ' ')
    image = draw_place(written.plan, title[:1].upper() + title[1:], facts(written.plan))
    try:
        image.save(picture)
    except OSError as error:
        raise FileError(f'{picture}: cannot be written: {error.strerror or error}') from None


def main(argv: Sequence[str] | None = None) -> int:
    """Make a place of a map and say what was found; the exit code is 2 for bad input."""
    options = _parse(argv)
    try:
        lines = import_map(options)
    except ValueError as error:
        print(f'import: {error}', file=sys.stderr)
        return EXIT_BAD_INPUT
    print('\n'.join(lines))
    return 0
