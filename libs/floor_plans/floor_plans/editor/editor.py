"""An edited place: its history, its checks, its file."""

from __future__ import annotations

import codecs
import copy
import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from floor_plans.description import described_in, map_file_beside
from floor_plans.editor.changes import PlaceChange
from floor_plans.editor.operations import OPERATIONS, Draft, checked_fields
from floor_plans.floor_plan import FloorPlan
from floor_plans.map_rooms.confidence import DOUBTFUL, confidence
from floor_plans.occupancy_grid import totals
from floor_plans.occupancy_map import OccupancyMap
from floor_plans.patrol_rules import PatrolRules, patrol_rules
from floor_plans.room_map import ROBOT_RADIUS, FloorPart, RoomMap, check_passable
from floor_plans.rooms import Place, PlaceError
from floor_plans.writing import updated_text
from strict_files.files import FileError, in_one_line, read_file
from strict_files.regular_files import alone_in, replace_file
from strict_files.suggestions import nearest
from strict_files.yaml_file import MAX_BYTES

MOST_UNDONE = 200
"""Changes that are kept to be undone."""


@dataclass(frozen=True)
class Moment:
    """The place at one moment of its history.

    Attributes:
        described: What its file says below `ros__parameters`.
        renamed: Entries with another name than in the file that was read.
        plan, regions, rules: What that means.
        said: What led there.
    """

    described: Mapping[str, Any]
    renamed: Mapping[tuple[str, str], str]
    plan: FloorPlan
    regions: RoomMap
    rules: PatrolRules
    said: str = ''

    @cached_property
    def left_out(self) -> tuple[FloorPart, ...]:
        """The parts of the floor that are no rooms, largest first."""
        return self.regions.left_out()

    @cached_property
    def confidence(self) -> Mapping[str, float]:
        """How sure each room and door of a map is, from 0.5 to 1; nothing of a place without."""
        if self.plan.map is None:
            return {}
        labels, names = self.regions.numbers()
        floor = np.where(self.regions.grid.free, np.maximum(labels, 0), 0)
        counts = totals(floor, max([*names, int(floor.max()), 0]) + 1)
        side = self.regions.grid.resolution
        areas = {name: float(counts[number]) * side**2 for number, name in names.items()}
        doors = {
            name: (self.plan.place.doors[name], door.width)
            for name, door in self.plan.doors.items()
            if len(self.plan.place.doors[name]) == 2
        }
        return confidence(areas, doors)

    def is_doubtful(self, name: str) -> bool:
        """Tell whether a room or a door is to be looked at."""
        return self.confidence.get(name, 1.0) < DOUBTFUL

    @cached_property
    def doubtful(self) -> tuple[tuple[str, str], ...]:
        """The doors of a map to be looked at first, the least sure first; what makes a room
        doubtful is one of them.
        """
        sure = self.confidence
        found = sorted((sure[name], name) for name in self.plan.doors if name in sure)
        return tuple(('door', name) for each, name in found if each < DOUBTFUL)


class PlaceEditor:
    """Changes a place's file; every state that it can be in is one that the file may have.

    One call at a time.

    Args:
        path: The place's file.
        radius: Of the robot that is to get everywhere, metres.
        more_checks: Looks at the place, too; raises a `PlaceError`.

    Raises:
        FileError: The file cannot be read, or is no sound place.
    """

    def __init__(
        self,
        path: Path,
        *,
        radius: float = ROBOT_RADIUS,
        more_checks: Callable[[Place], Any] = lambda _: None,
    ) -> None:
        self.path = path
        self._changes: dict[str, PlaceChange] = {}
        self._radius = radius
        self._more_checks = more_checks
        self._map: OccupancyMap | None = None
        self._open()

    def _open(self) -> None:
        # First: what somebody writes meanwhile must not look as if it had been read.
        self._written = self._read()
        file, described = described_in(self.path)
        self._text, self._form = _plain_text(self._written)
        self._map = None
        try:
            first = self._moment(described, {}, '')
        except PlaceError as error:
            raise file.error(error.where, error.problem) from None
        self._map = first.plan.map
        self._history = [first]
        self._at = self._saved = 0

    def _read(self) -> bytes:
        return read_file(self.path, MAX_BYTES)

    @property
    def now(self) -> Moment:
        """The place as it is."""
        return self._history[self._at]

    @property
    def is_changed(self) -> bool:
        """Whether the file says something else."""
        return self._at != self._saved

    @property
    def undoable(self) -> str:
        """What would be undone; empty: nothing."""
        return self.now.said

    @property
    def redoable(self) -> str:
        """What would be done again; empty: nothing."""
        return self._history[self._at + 1].said if self._at + 1 < len(self._history) else ''

    def apply(self, operation: str, fields: Mapping[str, Any]) -> str:
        """Carry a change out, and return what was done in one line.

        Raises:
            ValueError: It cannot be done, or the place would not be sound; nothing has changed.
        """
        moment = self._tried(operation, fields)
        del self._history[self._at + 1 :]
        if self._saved > self._at:
            self._saved = -1
        self._history.append(moment)
        self._at += 1
        if len(self._history) > MOST_UNDONE:
            del self._history[0]
            self._at, self._saved = self._at - 1, self._saved - 1
        return moment.said

    def problem_with(self, operation: str, fields: Mapping[str, Any]) -> str:
        """Return why a change could not be carried out, empty where it could; changes nothing."""
        try:
            self._tried(operation, fields)
        except ValueError as error:
            return str(error)
        return ''

    @property
    def changes(self) -> tuple[PlaceChange, ...]:
        """What has changed since an older place and nobody has decided yet."""
        return tuple(each for each in self._changes.values() if each.is_open(self.now.plan))

    def decide(self, changes: Sequence[PlaceChange]) -> None:
        """Have each of these decided by a person: `keep_old` or `take_new`."""
        self._changes = {each.name: each for each in changes}

    def keep_old(self, name: str) -> str:
        """Have the room or door of a change as the older place had it.

        Raises:
            ValueError: That cannot be; nothing has changed.
        """
        change = self._change(name)
        if not change.keep:
            raise ValueError(f'{change.said}; nothing here can bring the older state back')
        before = self._at, self._saved, list(self._history)
        try:
            for operation, fields in change.keep:
                self.apply(operation, fields)
        except ValueError:
            self._at, self._saved, self._history = before
            raise
        return f'as before: {change.kind} {name}'

    def take_new(self, name: str) -> str:
        """Have the room or door of a change as it is now."""
        change = self._change(name)
        del self._changes[name]
        return f'taken: {change.said}'

    def _change(self, name: str) -> PlaceChange:
        known = {each.name: each for each in self.changes}
        if name not in known:
            raise ValueError(f'no change {name!r}: expected {nearest(name, known)}')
        return known[name]

    def undo(self) -> str:
        """Take the last change back.

        Raises:
            ValueError: There is none.
        """
        if not self._at:
            raise ValueError('nothing to undo')
        said = self.now.said
        self._at -= 1
        return f'undone: {said}'

    def redo(self) -> str:
        """Carry the change out that was undone last.

        Raises:
            ValueError: There is none.
        """
        if not self.redoable:
            raise ValueError('nothing to do again')
        self._at += 1
        return f'done again: {self.now.said}'

    def text(self) -> str:
        """Return the file as it is to be: what is not changed keeps its comments and its order."""
        return updated_text(self._text, self.now.described, self.now.renamed)

    def whole(self) -> dict[str, Any]:
        """Return all parameters of the place as it is, the map's file by its absolute path."""
        return self._whole(self.now.described)

    def _whole(self, described: Mapping[str, Any]) -> dict[str, Any]:
        whole = dict(described)
        if isinstance(name := whole.get('map_file'), str) and name:
            whole['map_file'] = map_file_beside(self.path, name)
        return whole

    def save(self) -> str:
        """Write the file.

        Raises:
            FileError: It cannot be written, or somebody else has changed it.
        """
        text = self.text()
        data = self._form.encoded(text)
        try:
            # Another editor compares and writes in its turn.
            with alone_in(self.path.resolve().parent):
                if self._read() != self._written:
                    raise FileError(
                        f'{self.path}: changed by somebody else since it was opened: expected it '
                        'as it was; open it anew'
                    )
                replace_file(self.path, data)
        except OSError as error:
            raise FileError(in_one_line(error)) from None
        self._text, self._written = text, data
        # From now on the file has the names of this moment.
        written = self.now.renamed
        self._history = [
            replace(moment, renamed=_renamed_since(written, moment.renamed))
            for moment in self._history
        ]
        self._saved = self._at
        return f'written: {self.path}'

    def reload(self) -> str:
        """Read the file anew; what was not saved is lost.

        Raises:
            FileError: It is no sound place any more.
        """
        self._open()
        return f'read: {self.path}'

    def _tried(self, operation: str, fields: Mapping[str, Any]) -> Moment:
        carry_out = OPERATIONS.get(operation)
        if carry_out is None:
            raise ValueError(f'no change {operation!r}: expected {nearest(operation, OPERATIONS)}')
        now = self.now
        draft = Draft(
            copy.deepcopy(dict(now.described)),
            dict(now.renamed),
            now.plan,
            now.regions,
            self._radius,
        )
        given = checked_fields(fields)
        try:
            inspect.signature(carry_out).bind(draft, **given)
        except TypeError as error:
            raise ValueError(f'{operation}: {error}') from None
        said = carry_out(draft, **given)
        for table in list(draft.described):
            if isinstance(draft.described[table], dict) and not draft.described[table]:
                del draft.described[table]
        return self._moment(draft.described, draft.renamed, said)

    def _moment(
        self, described: dict[str, Any], renamed: Mapping[tuple[str, str], str], said: str
    ) -> Moment:
        whole = self._whole(described)
        plan = FloorPlan.from_parameters(whole, self._map)
        regions = RoomMap(plan)
        check_passable(plan, self._radius)
        rules = patrol_rules(whole, plan.place.rooms)
        self._more_checks(plan.place)
        return Moment(described, renamed, plan, regions, rules, said)


@dataclass(frozen=True)
class _TextForm:
    """How a file writes its text, which stays as it is.

    Attributes:
        mark: What it begins with, a byte order mark or nothing.
        line_end: How its lines end.
    """

    mark: bytes
    line_end: str

    def encoded(self, text: str) -> bytes:
        return self.mark + text.replace('\n', self.line_end).encode('utf-8')


def _plain_text(data: bytes) -> tuple[str, _TextForm]:
    """Return a file's text with the line ends of this system, and how the file writes it."""
    mark = codecs.BOM_UTF8 if data.startswith(codecs.BOM_UTF8) else b''
    text = data[len(mark) :].decode('utf-8')
    line_end = '\r\n' if '\r\n' in text else '\n'
    return text.replace('\r\n', '\n'), _TextForm(mark, line_end)


def _renamed_since(
    written: Mapping[tuple[str, str], str], renamed: Mapping[tuple[str, str], str]
) -> dict[tuple[str, str], str]:
    """Return what was renamed as seen from a file that was written in between.

    Args:
        written: What had another name in it than in the file before, by table and new name.
        renamed: The same of some moment.
    """
    in_file = {(table, old): new for (table, new), old in written.items()}
    names = {(table, old): new for (table, new), old in renamed.items()}
    found = {}
    for table, old in {*in_file, *names}:
        new, before = names.get((table, old), old), in_file.get((table, old), old)
        if new != before:
            found[table, new] = before
    return found
