"""One place that people edit in their browsers: what they see of it, and what they can do.

The browser draws and sends; what a change means is decided here, by a `PlaceEditor`.
"""

from __future__ import annotations

import base64
import io
import math
import threading
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from PIL import Image, ImageColor

from floor_plans.editor import PlaceEditor
from floor_plans.parameters import CLASSES
from surveillance_operator.page.server import Action

_MOST_PIXELS = 1_500_000
"""The picture of a larger map shows several cells as one pixel."""
_UNKNOWN, _WALL, _FLOOR, _LEFT_OUT, _OUTSIDE, _FIRST = range(6)
_COLOURS = (
    *('#fbe3d4', '#d9ecd2', '#d6e6f7', '#f6efc4', '#e7dcf3', '#cfeeea', '#f7d9e3', '#e3e6d0'),
)


class EditSession:
    """Lets any number of browsers edit one place, one change after the other.

    Args:
        editor: The place; None: none is open yet.
        on_saved: Told when the file was written; returns what else there is to say.
        import_map: Makes a place of files that were dropped, and opens it; returns what was found;
            None: the place that is open stays.
    """

    def __init__(
        self,
        editor: PlaceEditor | None,
        on_saved: Callable[[PlaceEditor], str] = lambda _: '',
        import_map: Callable[..., tuple[PlaceEditor, str]] | None = None,
    ) -> None:
        self._open = editor
        self._on_saved = on_saved
        self._import_map = import_map
        self._lock = threading.Lock()

    @property
    def questions(self) -> dict[str, Action]:
        """What whoever may look can ask, by name."""
        return {'place': self._place, 'room_at': self._room_at}

    @property
    def actions(self) -> dict[str, Action]:
        """What whoever may act can do, by name."""
        actions: dict[str, Action] = {
            'edit': lambda operation, fields: self._done(
                lambda: self._editor.apply(operation, fields)
            ),
            'check_edit': self._check,
            'undo_edit': lambda: self._done(lambda: self._editor.undo()),
            'redo_edit': lambda: self._done(lambda: self._editor.redo()),
            'reload_place': lambda: self._done(lambda: self._editor.reload()),
            'save_place': lambda: self._done(self._save),
            'keep_old': lambda name: self._done(lambda: self._editor.keep_old(str(name))),
            'take_new': lambda name: self._done(lambda: self._editor.take_new(str(name))),
        }
        if self._import_map is not None:
            actions['import_map'] = self._import
        return actions

    def check_saved(self) -> None:
        """Make sure that the file has all that the editor shows.

        Raises:
            ValueError: The place has changes that nobody has saved.
        """
        with self._lock:
            if self._editor.is_changed:
                raise ValueError(
                    'the editor has changes of the place that are not saved: save or undo them'
                )

    def change_now(self, operation: str, fields: Mapping[str, Any]) -> str:
        """Change the place and write it, for a person who sees another page than the editor.

        The change stands in the editor's history, where it can be undone.

        Raises:
            ValueError: It cannot be done, or the place has changes that nobody has saved.
        """
        self.check_saved()
        with self._lock:
            said = self._editor.apply(operation, fields)
            try:
                return f'{said}; {self._save()}'
            except ValueError:
                self._editor.undo()
                raise

    @property
    def _editor(self) -> PlaceEditor:
        if self._open is None:
            raise ValueError('no place is open yet: drop a map on the page')
        return self._open

    def _place(self) -> dict[str, Any]:
        with self._lock:
            return {'ok': True, 'place': None if self._open is None else shown(self._open)}

    def _import(
        self,
        files: Mapping[str, Any],
        resolution: str = '',
        level: str = '',
        corners: str = '',
        scale: str = '',
        keep: bool = False,
    ) -> dict[str, Any]:
        make = self._import_map
        if make is None or not isinstance(files, Mapping):
            raise ValueError('files: expected their contents by name')

        def change() -> str:
            if self._open is not None and self._open.is_changed:
                raise ValueError('the open place is not saved: save it, or undo its changes')
            older = self._open.path if keep and self._open is not None else None
            said_of_them = str(resolution), str(level), str(corners), str(scale)
            self._open, said = make(files, older, *said_of_them)
            return said

        return self._done(change)

    def _room_at(self, x: str, y: str) -> dict[str, Any]:
        at = float(x), float(y)
        if not all(map(math.isfinite, at)):
            raise ValueError(f'({x}, {y}): expected two numbers')
        with self._lock:
            return {'ok': True, 'room': self._editor.now.regions.room_at(*at)}

    def _check(self, operation: str, fields: Mapping[str, Any]) -> dict[str, Any]:
        with self._lock:
            return {'ok': True, 'problem': self._editor.problem_with(operation, fields)}

    def _save(self) -> str:
        said = self._editor.save()
        more = self._on_saved(self._editor)
        return f'{said}; {more}' if more else said

    def _done(self, change: Callable[[], str]) -> dict[str, Any]:
        with self._lock:
            said = change()
            return {'ok': True, 'text': said, 'place': shown(self._editor)}


def shown(editor: PlaceEditor) -> dict[str, Any]:
    """Return what a browser draws of a place: plain values for JSON, metres and rad."""
    now = editor.now
    plan, rules, described = now.plan, now.rules, now.described
    place, hours = plan.place, described.get('hours', {})
    return {
        'file': str(editor.path),
        'changed': editor.is_changed,
        'undo': editor.undoable,
        'redo': editor.redoable,
        'picture': _picture(editor),
        'rooms': {
            room: {
                'point': list(place.positions[room][:2]),
                'doors': list(doors),
                'class': rules.classes.get(room, ''),
                'by_doors': CLASSES[len(doors) > 1],
                'threshold': rules.thresholds.get(room),
                'exploration': rules.exploration.get(room),
                'hours': hours.get(room, ''),
                'keep_out': room in rules.calendar.keep_out,
                'sweep': room in rules.swept,
                'doubtful': now.is_doubtful(room),
            }
            for room, doors in place.rooms.items()
        },
        'doors': {
            name: {
                'at': [door.x, door.y, door.yaw, door.width],
                'line': list(door.segment),
                'joins': list(place.doors[name]),
                'doubtful': now.is_doubtful(name),
            }
            for name, door in plan.doors.items()
        },
        'zones': {
            zone.name: {
                'kind': 'slow' if zone.speed is not None else 'keep_out',
                'corners': [list(corner) for corner in zone.corners],
                'speed': zone.speed,
            }
            for zone in (*plan.zones.keep_out.values(), *plan.zones.slow.values())
        },
        'stations': {room: list(station.pose) for room, station in plan.stations.items()},
        'markers': {
            each.name: {'id': each.id, 'at': [each.x, each.y, each.z, each.yaw]}
            for each in plan.markers.values()
        },
        'left_out': {
            f'{number}': {
                'at': list(part.at),
                'area': round(part.area, 1),
                'reason': part.reason(plan),
            }
            for number, part in enumerate(now.left_out, start=1)
        },
        'changes': [
            {'kind': each.kind, 'name': each.name, 'said': each.said, 'back': bool(each.keep)}
            for each in editor.changes
        ],
        'doubtful': [f'{kind} {name}' for kind, name in now.doubtful],
        'start': place.start,
        'quiet_hours': described.get('quiet_hours', ''),
        'time_zone': described.get('time_zone', ''),
    }


def _picture(editor: PlaceEditor) -> dict[str, Any]:
    """Return rooms and walls as a PNG, and what it covers: west, south, east, north, metres."""
    regions, plan = editor.now.regions, editor.now.plan
    grid = regions.grid
    labels, names = regions.numbers()
    order = {name: index for index, name in enumerate(plan.place.rooms)}
    value = np.zeros(max([*names, int(labels.max()), 0]) + 1, np.uint8)
    for number, name in names.items():
        value[number] = _FIRST + order[name] % len(_COLOURS) if name in order else _FLOOR
    open_grid = plan.grid() if plan.is_enclosed else grid
    cells = np.where(open_grid.free, _FLOOR, _UNKNOWN).astype(np.uint8)
    same = open_grid.cells.shape == labels.shape and plan.is_enclosed
    if same:
        cells = np.where(open_grid.free & (labels >= 0), value[np.maximum(labels, 0)], cells)
    for part in editor.now.left_out:
        cells[part.cells] = _OUTSIDE if part.is_outside else _LEFT_OUT
    step = math.ceil(math.sqrt(cells.size / _MOST_PIXELS))
    rows, columns = (size // step * step for size in cells.shape)
    blocks = open_grid.occupied[:rows, :columns].reshape(rows // step, step, columns // step, step)
    pixels = cells[:rows:step, :columns:step].copy()
    pixels[blocks.any(axis=(1, 3))] = _WALL
    image = Image.fromarray(np.ascontiguousarray(pixels[::-1]), 'P')
    palette = ['#808080', '#3a4350', '#ffffff', '#f3c6c0', '#e4e8ec', *_COLOURS]
    image.putpalette([part for colour in palette for part in ImageColor.getrgb(colour)[:3]])
    data = io.BytesIO()
    image.save(data, 'PNG', transparency=_UNKNOWN, optimize=False)
    coded = base64.b64encode(data.getvalue()).decode('ascii')
    return {
        'png': f'data:image/png;base64,{coded}',
        'box': list(open_grid.box(0, 0, rows, columns)),
    }
