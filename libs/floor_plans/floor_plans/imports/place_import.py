"""A place made of a robot's map, of a drawn building, or of another program's graph of places."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from PIL import Image

from floor_plans import ROBOT_RADIUS, read_place
from floor_plans.drawing import draw_place
from floor_plans.facts import counted, facts
from floor_plans.imports.graphs import SUFFIXES, read_graph
from floor_plans.imports.rmf_building import RmfLevel, is_rmf_building, read_rmf_building
from floor_plans.map_rooms import Proposal, propose
from floor_plans.occupancy_grid import distance_to
from floor_plans.occupancy_map import (
    OccupancyMap,
    is_picture,
    read_map,
    write_map,
)
from floor_plans.parameters import problem_in_name
from floor_plans.writing import format_place
from strict_files.files import FileError, in_one_line, read_file, replace_text

MOST_BYTES = 20_000_000
"""Of a YAML file; a picture may be larger."""


@dataclass(frozen=True)
class ImportRequest:
    """What a place is to be made of.

    Attributes:
        source: A map in map_server's format, a picture, a building or a graph.
        out: The place's file; None: named after the source, in the working directory.
        radius: Of the robot, metres.
        resolution: Side of a picture's pixel, metres.
        level: The level of a building that has several.
        labels: Where to write the rooms as a picture; None: nowhere.
        force: Whether to write over a place that is there already.
        command: What a person typed, for the head of the place's file; empty: nothing.
        kept: Files that are not written over, whatever was asked for.
    """

    source: Path
    out: Path | None = None
    radius: float = ROBOT_RADIUS
    resolution: float | None = None
    level: str = ''
    labels: Path | None = None
    force: bool = False
    command: str = ''
    kept: tuple[Path, ...] = ()

    @property
    def place(self) -> Path:
        """The place's file."""
        return self.out or Path(f'{self.source.stem.removesuffix(".building")}_place.yaml')

    @property
    def origin(self) -> str:
        """Where the place comes from, for the head of its file."""
        return f'Written by: {self.command}' if self.command else f'Made of: {self.source}'


def import_place(request: ImportRequest) -> list[str]:
    """Make the place, write and draw it; return what there is to say.

    Raises:
        FileError: A file cannot be read or written.
        ValueError: The robot fits nowhere, or a file is there already.
    """
    out, source = request.place, request.source
    if out.suffix not in ('.yaml', '.yml'):
        raise ValueError(f'--out {out}: expected a name that ends in .yaml')
    _is_free(out, request)
    if request.labels is not None and request.labels.suffix.lower() != '.png':
        raise ValueError(f'--labels {request.labels}: expected a name that ends in .png')
    levels = source.suffix in ('.yaml', '.yml') and _levels_in(source)
    if levels and is_rmf_building(levels):
        return _import_building(request, read_rmf_building(source, levels, request.level))
    if source.suffix in SUFFIXES or levels:
        return _import_graph(request, levels or None)
    if request.level:
        raise ValueError(f'{source}: has no levels: expected no --level')
    building = read_map(source, resolution=request.resolution).as_saved()
    proposal = _proposed(request, building, {})
    beside = os.path.relpath(building.path.resolve(), out.resolve().parent)
    reference: dict[str, object] = {'map_file': beside}
    if is_picture(building.path):
        reference['map_file_resolution'] = building.resolution
    if building.picture is not None:
        request = replace(request, kept=(building.picture,))
    return _written(request, proposal, reference, proposal.parameters, list(building.notes))


def _is_free(path: Path, request: ImportRequest) -> None:
    if path.exists() and not request.force:
        raise ValueError(f'{path}: is there already; expected another --out, or --force')


def is_levels(data: bytes) -> bool:
    """Tell whether a YAML file's text is taken for Open-RMF's, which has levels, and no map's."""
    return re.search(rb'^levels:', data, re.MULTILINE) is not None


def _levels_in(path: Path) -> Any:
    """Return what a YAML file of Open-RMF says; None: it is none, or no YAML at all."""
    try:
        data = read_file(path, MOST_BYTES)
        if not is_levels(data):
            return None
        return yaml.load(data, Loader=getattr(yaml, 'CSafeLoader', yaml.SafeLoader))
    except FileError:
        return None  # whoever reads it as a map says why it cannot be read
    except yaml.YAMLError as error:
        raise FileError(f'{path}: no YAML: {str(error).splitlines()[0]}') from None


def _proposed(request: ImportRequest, building: OccupancyMap, doors: Mapping[str, Any]) -> Proposal:
    try:
        return propose(building, request.radius, doors)
    except ValueError as error:
        raise ValueError(f'{request.source}: {error}') from None


def _written(
    request: ImportRequest,
    proposal: Proposal,
    reference: Mapping[str, object],
    parameters: Mapping[str, Any],
    more: list[str],
) -> list[str]:
    """Write the place's file and draw it; return what there is to say."""
    out, found = request.place, _found(proposal)
    lines = []
    if request.labels is not None:
        write_labels(proposal, request.labels)
        lines.append(f'rooms as a picture: {request.labels}')
    title = (
        f'{found}\n{request.origin}\n'
        'Metres and radians in the frame of the map. Rename rooms and doors as you like;\n'
        'a door is x, y, direction of the opening, width.'
    )
    picture = out.with_suffix('.png')
    kept = {request.source, request.source.with_suffix('.png'), *request.kept}
    if picture.resolve() in {each.resolve() for each in kept}:
        picture = out.with_name(out.stem + '_drawn.png')
    text = format_place({**reference, **parameters}, title)
    return [f'{request.source}: {found}', *more, *lines, *_draw(request, text, picture)]


def _draw(request: ImportRequest, text: str, picture: Path) -> list[str]:
    """Write a place's text, read it as a robot would, and draw what it means."""
    out = request.place
    try:
        replace_text(out, text)
    except OSError as error:
        raise FileError(in_one_line(error)) from None
    plan = read_place(out, radius=request.radius).plan
    title = out.stem.replace('_', ' ')
    image = draw_place(plan, title[:1].upper() + title[1:], facts(plan))
    try:
        image.save(picture)
    except OSError as error:
        raise FileError(f'{picture}: cannot be written: {error.strerror or error}') from None
    return [f'place: {out}', f'drawn: {picture}']


def _import_graph(request: ImportRequest, document: Any) -> list[str]:
    source = request.source
    if request.labels is not None or request.resolution is not None:
        raise ValueError(
            f'{source}: a graph has no pixels: expected neither --labels nor --resolution'
        )
    parameters = read_graph(source, document, request.level)
    said = f'{counted(len(parameters["map"]), "room")} of a graph'
    title = f'{said}\n{request.origin}'
    text = format_place(parameters, title)
    return [f'{source}: {said}', *_draw(request, text, request.place.with_suffix('.png'))]


def _import_building(request: ImportRequest, level: RmfLevel) -> list[str]:
    if request.resolution is not None:
        raise ValueError(f'{request.source}: measures its pixels itself: expected no --resolution')
    drawn = request.place.with_name(f'{request.place.stem}_map.yaml')
    for path in (drawn, drawn.with_suffix('.png')):
        _is_free(path, request)
    doors = {_as_name(name): line for name, line in level.doors.items()}
    doors = {name: line for name, line in doors.items() if not problem_in_name('door', name)}
    proposal = _proposed(request, level.map, doors)
    parameters = _with_names(proposal, level, request.radius)
    write_map(drawn, level.map.cells, level.map.resolution, level.map.origin)
    left = sorted(doors.keys() - parameters.get('doors', {}).keys())
    more = [f'level {level.name} as a map: {drawn}']
    if left:
        more.append(f'{counted(len(left), "door")} that join no two rooms: {", ".join(left)}')
    return _written(request, proposal, {'map_file': drawn.name}, parameters, more)


def _with_names(proposal: Proposal, level: RmfLevel, radius: float) -> dict[str, Any]:
    """Return a place's parameters with the names, points and chargers that a building has.

    A room in which one point has a name is called so, and the robot drives to that point.
    """
    grid = level.map.own_grid
    clearance = distance_to(~grid.free, grid.resolution)
    fits = (clearance > radius + grid.resolution).astype(np.uint8)
    pieces = cv2.connectedComponents(fits, connectivity=8)[1]
    parameters = dict(proposal.parameters)
    positions: dict[str, list[float]] = dict(parameters['room_positions'])
    x, y = level.map.to_own([next(iter(positions.values()))])[0]
    reached = grid.at(pieces, x, y)

    def room_of(at: tuple[float, float]) -> str:
        """Return the room of a point that the robot can be at, empty: none."""
        x, y = level.map.to_own([at])[0]
        number = grid.at(proposal.segmentation.labels, x, y)
        return proposal.names.get(number, '') if number and grid.at(pieces, x, y) == reached else ''

    doors = {door for listed in parameters['map'].values() for door in listed}
    named: dict[str, list[str]] = {}
    for name, at in level.places.items():
        if (room := room_of(at)) and not problem_in_name('room', _as_name(name)):
            named.setdefault(room, []).append(name)
    called: dict[str, str] = {}
    for room, names in named.items():
        taken = {*called.values(), *(positions.keys() - {room}), *doors}
        if len(names) == 1 and (name := _as_name(names[0])) not in taken:
            called[room] = name
            positions[room] = [round(each, 3) for each in level.places[names[0]]]
    stations: dict[str, list[float]] = {}
    for at in level.chargers:
        if room := room_of(at):
            stations.setdefault(room, [*(round(each, 3) for each in at), 0.0])

    def now(room: str) -> str:
        return called.get(room, room)

    parameters['map'] = {now(room): doors for room, doors in parameters['map'].items()}
    parameters['room_positions'] = {now(room): at for room, at in positions.items()}
    parameters['robot_room'] = now(parameters['robot_room'])
    parameters['recharge_rooms'] = [now(room) for room in parameters['recharge_rooms']]
    if stations:
        parameters['recharge_rooms'] = [now(room) for room in stations]
        parameters['robot_room'] = parameters['recharge_rooms'][0]
        if len(stations) == 1:
            parameters['station'] = next(iter(stations.values()))
        else:
            del parameters['station']
            parameters['stations'] = {now(room): {'pose': at} for room, at in stations.items()}
    return parameters


def _as_name(given: str) -> str:
    """Return a name as rooms and doors have them, where a few signs are all that differs."""
    return re.sub(r'[^A-Za-z0-9_-]+', '_', given.strip()).strip('_')


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
    said = [counted(rooms, 'room')]
    if corridors:
        said.append(counted(corridors, 'corridor'))
    said.append(counted(len(proposal.parameters.get('doors', {})), 'door'))
    if proposal.left_out:
        said.append(f'{len(proposal.left_out)} left out that the robot cannot reach')
    return ', '.join(said)
