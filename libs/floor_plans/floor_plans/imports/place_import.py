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
from numpy.typing import NDArray
from PIL import Image

from floor_plans import ROBOT_RADIUS, read_place
from floor_plans.description import described_in
from floor_plans.drawing import draw_place
from floor_plans.editor import PlaceEditor
from floor_plans.facts import counted, facts
from floor_plans.imports.graphs import SUFFIXES, read_graph
from floor_plans.imports.plan_photo import SIDE, PlanPhoto, read_photo, walls_of_photo
from floor_plans.imports.renewal import Alignment, Renewal, changes_since, renewed
from floor_plans.imports.rmf_building import RmfLevel, is_rmf_building, read_rmf_building
from floor_plans.map_rooms import LeftOut, Proposal, propose
from floor_plans.map_rooms.confidence import DOUBTFUL
from floor_plans.map_rooms.halls import Hall
from floor_plans.map_rooms.proposal import OUTSIDE
from floor_plans.occupancy_grid import distance_to, looked_up
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
        with_outside: What is outside of the building is a room, too.
        aisles: The aisles of a hall are places of their own.
        photo: How the picture shows a floor plan, whose walls are to be found in it; None: it is a
            map.
        update: The place of an older map of the building, from which rooms keep their names;
            None: there is none.
        keep_old: Names of rooms and doors that have changed since then and are to be as they were;
            `all` stands for all of them.
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
    with_outside: bool = False
    aisles: bool = False
    photo: PlanPhoto | None = None
    update: Path | None = None
    keep_old: tuple[str, ...] = ()
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


@dataclass(frozen=True)
class ImportReport:
    """What an import made, and what it believes.

    Attributes:
        found: What there is, in one line.
        lines: What there is to say, for a person.
        content: The same and more for a program, as plain values: rooms and doors with their
            confidence, entrances, what is outside, what is left out and why.
    """

    found: str
    lines: tuple[str, ...]
    content: Mapping[str, Any]

    def __str__(self) -> str:
        return '\n'.join(self.lines)


def import_place(request: ImportRequest) -> ImportReport:
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
    notes: list[str] = []
    if request.photo is not None:
        source = _map_of_photo(request, request.photo)
        notes.append(f'the walls of the plan as a map: {source}')
    building = read_map(source, resolution=request.resolution).as_saved()
    proposal = _proposed(request, building, {})
    beside = os.path.relpath(building.path.resolve(), out.resolve().parent)
    reference: dict[str, object] = {'map_file': beside}
    if is_picture(building.path):
        reference['map_file_resolution'] = building.resolution
    if building.picture is not None:
        request = replace(request, kept=(building.picture,))
    large = proposal.halls(building)
    # What an older place says of sweeping stays as it is.
    sweep = {'sweep': list(large)} if large and request.update is None else {}
    parameters: Mapping[str, Any] = {**proposal.parameters, **sweep}
    halls = [_hall_in_words(name, hall) for name, hall in large.items()]
    notes += building.notes
    if request.update is None:
        return _written(request, proposal, reference, parameters, [*notes, *halls], large)
    renewal = _renewed(request.update, request, building, proposal)
    notes += [*renewal.said, *halls]
    report = _written(request, proposal, reference, renewal.parameters, notes, large)
    return _decided(request, request.update, renewal.lies, proposal, report)


def _map_of_photo(request: ImportRequest, photo: PlanPhoto) -> Path:
    """Write the walls of a photographed plan as a map beside the place; return its file."""
    if not is_picture(request.source) or request.resolution is not None:
        raise ValueError(
            f'{request.source}: expected the picture of a plan, whose scale two points say '
            '(no --resolution)'
        )
    drawn = request.place.with_name(f'{request.place.stem}_map.yaml')
    for path in (drawn, drawn.with_suffix('.png')):
        _is_free(path, request)
    try:
        cells = walls_of_photo(read_photo(request.source), photo)
    except FileError:
        raise
    except ValueError as error:
        raise ValueError(f'{request.source}: {error}') from None
    write_map(drawn, cells[::-1], SIDE, (0.0, 0.0, 0.0))
    return drawn


def _hall_in_words(name: str, hall: Hall) -> str:
    said = f'{name} is a hall of {hall.area:.0f} m2: a visit sweeps all of it (sweep)'
    if hall.aisles:
        said += f'; it has {counted(hall.aisles, "aisle")}, --aisles makes places of them'
    return said


def _renewed(
    older: Path, request: ImportRequest, building: OccupancyMap, proposal: Proposal
) -> Renewal:
    """Return a place's parameters with what an older place says, and what has changed."""
    plan = read_place(older, radius=request.radius).plan
    if not plan.is_enclosed:
        raise ValueError(f'--update {older}: has neither walls nor a map: expected one to compare')
    try:
        return renewed(plan, described_in(older)[1], building, proposal)
    except ValueError as error:
        raise ValueError(f'--update {older}: {error}') from None


def _decided(
    request: ImportRequest,
    older: Path,
    lies: Alignment,
    proposal: Proposal,
    report: ImportReport,
) -> ImportReport:
    """Bring back what is to be as in the older place; tell of each change how it was decided."""
    editor = PlaceEditor(request.place, radius=request.radius)
    changes = changes_since(older, editor.now.plan, request.radius, lies)
    editor.decide(changes)
    back = [each.name for each in changes if each.keep]
    known = {each.name for each in changes}
    every = request.keep_old == ('all',)
    lines = []
    for name in back if every else request.keep_old:
        if name in known - {each.name for each in editor.changes}:
            continue  # came back with another one
        try:
            lines.append(editor.keep_old(name))
        except ValueError as error:
            if not every:
                raise ValueError(f'--keep-old: {error}; {request.place} is as the map') from None
            lines.append(f'{name} cannot be as before: {error}')
    if editor.is_changed:
        _draw(request, editor.text(), Path(report.content['drawn']), proposal)
    still = {each.name for each in editor.changes}
    listed = [
        {
            **{'kind': each.kind, 'name': each.name, 'is_new': each.is_new, 'said': each.said},
            **{'can_keep_old': bool(each.keep), 'kept': 'new' if each.name in still else 'old'},
        }
        for each in changes
    ]
    told = [f'{each["said"]} (kept: {each["kept"]})' for each in listed]
    if still & set(back):
        told.append('--keep-old NAME,... brings such a room or door back as it was')
    return ImportReport(
        report.found, (*report.lines, *told, *lines), {**report.content, 'changes': listed}
    )


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
        return propose(
            building,
            request.radius,
            doors,
            with_outside=request.with_outside,
            aisles=request.aisles,
        )
    except ValueError as error:
        raise ValueError(f'{request.source}: {error}') from None


def _written(
    request: ImportRequest,
    proposal: Proposal,
    reference: Mapping[str, object],
    parameters: Mapping[str, Any],
    notes: list[str],
    large: Mapping[str, Hall] | None = None,
) -> ImportReport:
    """Write the place's file and draw it; return what there is to say."""
    out, found = request.place, _found(proposal)
    if request.labels is not None:
        write_labels(proposal, request.labels)
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
    _draw(request, text, picture, proposal)
    content = {
        **_content(proposal, parameters),
        'halls': [
            {'name': name, 'area': hall.area, 'seen': hall.seen, 'aisles': hall.aisles}
            for name, hall in (large or {}).items()
        ],
        'notes': notes,
        'place': str(out),
        'drawn': str(picture),
    }
    labels = [] if request.labels is None else [f'rooms as a picture: {request.labels}']
    lines = [f'{request.source}: {found}', *notes, *_explained(proposal, content), *labels]
    return ImportReport(found, (*lines, f'place: {out}', f'drawn: {picture}'), content)


_MOST_POINTS = 6


def _explained(proposal: Proposal, content: Mapping[str, Any]) -> list[str]:
    """Return the lines on what is doubtful, outside, or left out with its reason."""
    lines = []
    doubtful = [
        f'{each["name"]} ({each["confidence"]:g})'
        for each in (*content['rooms'], *content['doors'])
        if each['confidence'] < DOUBTFUL
    ]
    if doubtful:
        lines.append(f'doubtful, look at these first: {", ".join(doubtful)}')
    for each in content['entrances']:
        lines.append(f'{each["wall"]}: a wall that closes the way out of {each["room"]}')
    reasons: dict[str, list[LeftOut]] = {}
    for part in proposal.left_out:
        reasons.setdefault(part.reason, []).append(part)
    for reason, parts in reasons.items():
        points = ', '.join(
            f'({x:.1f}, {y:.1f})' for x, y in (each.at for each in parts[:_MOST_POINTS])
        )
        more = f' and {len(parts) - _MOST_POINTS} more' if len(parts) > _MOST_POINTS else ''
        area = sum(each.area for each in parts)
        undo = '; --with-outside makes it a room' if reason == OUTSIDE else ''
        lines.append(f'left out, {reason}: {area:.1f} m2 at {points}{more}{undo}')
    return lines


def _content(proposal: Proposal, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return a proposal as plain values: metres, square metres, confidence from 0.5 to 1."""
    areas, sure = proposal.areas(), proposal.confidence()
    # A building's own names stand in the place's parameters, in the order of the proposal's.
    renamed = dict(zip(proposal.parameters['map'], parameters['map'], strict=True))
    joins: dict[str, list[str]] = {}
    for room, doors in parameters['map'].items():
        for door in doors:
            joins.setdefault(door, []).append(room)
    corridors = {proposal.names[n] for n in proposal.segmentation.corridors & proposal.names.keys()}
    return {
        'rooms': [
            {
                'name': renamed[name],
                'kind': 'corridor' if name in corridors else 'room',
                'area': round(areas[name], 2),
                'at': list(parameters['room_positions'][renamed[name]][:2]),
                'doors': list(parameters['map'][renamed[name]]),
                'confidence': sure[name],
            }
            for name in proposal.parameters['map']
        ],
        'doors': [
            {
                'name': name,
                'joins': joins[name],
                'at': list(row[:2]),
                'width': row[3],
                'confidence': sure[proposed],
            }
            for proposed, (name, row) in zip(
                proposal.parameters.get('doors', {}),
                parameters.get('doors', {}).items(),
                strict=True,
            )
        ],
        'entrances': [
            {'wall': wall, 'room': renamed[room], 'line': parameters['walls'][wall]}
            for wall, room in proposal.entrances.items()
        ],
        'outside': [_part(each) for each in proposal.left_out if each.reason == OUTSIDE],
        'left_out': [_part(each) for each in proposal.left_out if each.reason != OUTSIDE],
    }


def _part(part: LeftOut) -> dict[str, Any]:
    return {'reason': part.reason, 'area': part.area, 'at': list(part.at)}


def _draw(
    request: ImportRequest, text: str, picture: Path, proposal: Proposal | None = None
) -> None:
    """Write a place's text, read it as a robot would, and draw what it means and leaves out."""
    out = request.place
    try:
        replace_text(out, text)
    except OSError as error:
        raise FileError(in_one_line(error)) from None
    plan = read_place(out, radius=request.radius).plan
    title = out.stem.replace('_', ' ')
    aside = {} if proposal is None or plan.map is None else _aside(proposal, plan.map)
    image = draw_place(plan, title[:1].upper() + title[1:], facts(plan), aside=aside)
    try:
        image.save(picture)
    except OSError as error:
        raise FileError(f'{picture}: cannot be written: {error.strerror or error}') from None


def _aside(proposal: Proposal, building: OccupancyMap) -> dict[str, NDArray[np.bool_]]:
    """Return the cells of the place's map that are outside, and those that are left out."""
    own, grid = building.own_grid, building.grid
    labels = proposal.segmentation.labels
    if grid.cells.shape != own.cells.shape or building.origin[2]:
        cells = np.argwhere(np.ones_like(grid.cells, np.bool_))
        where = own.cells_of(building.to_own(grid.centres_of(cells)))
        inside = own.contains(where)
        turned = np.zeros(grid.cells.size, labels.dtype)
        turned[inside] = labels[where[inside, 0], where[inside, 1]]
        labels = turned.reshape(grid.cells.shape)
    outside = set(proposal.outside)
    left = {each.number for each in proposal.left_out} - {0, *outside}
    masks = {}
    for word, numbers in (('outside', outside), ('left out', left)):
        table = np.zeros(proposal.segmentation.rooms + 1, np.bool_)
        table[list(numbers)] = True
        mask = looked_up(table, labels) & grid.free
        if mask.any():
            masks[word] = mask
    return masks


def _import_graph(request: ImportRequest, document: Any) -> ImportReport:
    source = request.source
    if request.labels is not None or request.resolution is not None:
        raise ValueError(
            f'{source}: a graph has no pixels: expected neither --labels nor --resolution'
        )
    parameters = read_graph(source, document, request.level)
    said = f'{counted(len(parameters["map"]), "room")} of a graph'
    title = f'{said}\n{request.origin}'
    picture = request.place.with_suffix('.png')
    _draw(request, format_place(parameters, title), picture)
    lines = (f'{source}: {said}', f'place: {request.place}', f'drawn: {picture}')
    content = {
        'rooms': [
            {'name': room, 'at': list(parameters['room_positions'][room]), 'doors': list(doors)}
            for room, doors in parameters['map'].items()
        ],
        'place': str(request.place),
        'drawn': str(picture),
    }
    return ImportReport(said, lines, content)


def _import_building(request: ImportRequest, level: RmfLevel) -> ImportReport:
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
    exits = len(proposal.entrances)
    said.append(counted(len(proposal.parameters.get('doors', {})) + exits, 'door'))
    if exits:
        one = 'one of them leads' if exits == 1 else f'{exits} of them lead'
        said.append(f'{one} outside and {"is" if exits == 1 else "are"} closed')
    left = len(proposal.left_out) - len(proposal.outside)
    if left:
        said.append(f'{counted(left, "part")} of the floor left out')
    return ', '.join(said)
