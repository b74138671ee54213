"""The command `edit`: a place in the browser, to be changed and saved."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from floor_plans import ROBOT_RADIUS
from floor_plans.editor import PlaceEditor
from floor_plans.imports import changes_since
from surveillance_ontology.patrol_vocabulary import checked_names
from surveillance_operator.page.broadcaster import Broadcaster
from surveillance_operator.page.server import Page
from surveillance_operator.place_page.dropped_map import MOST_BYTES, import_dropped
from surveillance_operator.place_page.edit_session import EditSession
from surveillance_runtime.command_line import EXIT_BAD_INPUT, CommandParser


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = CommandParser(
        prog='launch.py edit',
        description='Shows a place in a browser: rooms, doors, zones, stations and rules can be '
        'changed there and saved.',
    )
    parser.add_argument(
        'place',
        type=Path,
        nargs='?',
        metavar='PLACE',
        help="the place's file; without one, a map is dropped on the page, and a place made of it",
    )
    parser.add_argument(
        '--older',
        type=Path,
        metavar='PLACE',
        help='the place of an older map of the building: what has changed since is listed, each '
        'to be taken or brought back',
    )
    parser.add_argument(
        '--web-address',
        default='127.0.0.1:0',
        metavar='HOST:PORT',
        help='where to serve the page (default: this machine alone, any port)',
    )
    parser.add_argument(
        '--robot-radius',
        type=float,
        default=ROBOT_RADIUS,
        metavar='M',
        help=f'radius of the robot, metres (default: {ROBOT_RADIUS:g})',
    )
    options = parser.parse_args(argv)
    if not 0.01 <= options.robot_radius <= 5.0:
        parser.error(f'--robot-radius {options.robot_radius:g}: expected 0.01 to 5')
    if options.older and not options.place:
        parser.error('--older: expected the newer place with it')
    host, _, port = options.web_address.rpartition(':')
    if not host or not port.isdecimal() or int(port) > 65535:
        parser.error(f'--web-address {options.web_address}: expected HOST:PORT')
    options.host, options.port = host.strip('[]'), int(port)
    return options


def editor_page(
    place: Path | None,
    host: str,
    port: int,
    radius: float,
    token: str = '',
    older: Path | None = None,
) -> Page:
    """Return the page on which a place is edited, not started yet.

    Args:
        place: The place's file; None: it is made of a map that is dropped on the page.
        host, port: Where to serve it; port 0 takes any.
        radius: Of the robot, metres.
        token: What gives access; one is made unless given.
        older: The place of an older map of the building; None: none is compared with.

    Raises:
        FileError: A file cannot be read or is no sound place.
        ValueError: The older place has too little in common with it.
        OSError: The address cannot be used.
    """
    folder = Path.cwd() if place is None else place.parent

    def opened(path: Path, older: Path | None) -> PlaceEditor:
        editor = PlaceEditor(path, radius=radius, more_checks=checked_names)
        if older is not None:
            editor.decide(changes_since(older, editor.now.plan, radius))
        return editor

    def import_map(
        files: Mapping[str, Any], older: Path | None, *said_of_them: str
    ) -> tuple[PlaceEditor, str]:
        resolution, level, corners, scale = said_of_them
        path, said = import_dropped(files, folder, radius, resolution, level, corners, scale, older)
        return opened(path, older), said

    session = EditSession(None if place is None else opened(place, older), import_map=import_map)
    return Page(
        Broadcaster(),
        questions=session.questions,
        actions=session.actions,
        host=host,
        port=port,
        token=token,
        front='edit.html',
        longest={'import_map': 2 * MOST_BYTES},
        report=lambda line: print(f'edit: {line}', file=sys.stderr),
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Serve the page until Ctrl-C; the exit code is 2 for bad input."""
    options = _parse(argv)
    try:
        page = editor_page(
            options.place,
            options.host,
            options.port,
            options.robot_radius,
            older=options.older,
        )
    except (ValueError, OSError) as error:
        print(f'edit: {error}', file=sys.stderr)
        return EXIT_BAD_INPUT
    shown = options.place or 'a map can be dropped on the page; it'
    print(f'{shown} is shown at {page.address} (Ctrl-C ends)', flush=True)
    page.run()
    return 0
