"""What the keeper of the map asks of the ontology and says, call by call."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import pytest

from armor_service.client import ArmorServiceCallError, ArmorServiceInternalError
from floor_plans import Place, PlaceError
from floor_plans.parameters import make_place
from surveillance_ontology.map_keeper import MapKeeper, Reports, RoomNote, Source
from surveillance_ontology.map_ontology import MapOntology
from surveillance_ontology.patrol_vocabulary import never_visited

AWAY = ArmorServiceCallError('no server')
GONE = ArmorServiceInternalError("unknown reference 'map'", 204)
REFUSED = ArmorServiceInternalError('no such file', 205)


def rooms(**positions: float) -> Place:
    """Return a row of rooms A, B ..., each with a door to the next one."""
    names = sorted(positions) or ['A', 'B', 'C']
    doors: dict[str, list[str]] = {name: [] for name in names}
    for first, second in pairwise(names):
        for name in (first, second):
            doors[name].append(f'{first}{second}')
    return make_place(
        doors, {name: (positions.get(name, 0.0), 0.0) for name in names}, names[0], []
    )


@dataclass
class Scripted:
    """An ontology whose answers are told beforehand; each list is used up from its front."""

    builds: list[Exception | None] = field(default_factory=list)
    changes: list[Exception | None] = field(default_factory=list)
    contradictions: list[Any] = field(default_factory=list)
    loaded: list[bool] = field(default_factory=list)
    calls: list[tuple[Any, ...]] = field(default_factory=list)
    robots: tuple[str, ...] = ()

    def build(self, place: Place, path: str, uri: str, first: int, now: int, gone: Any) -> Place:
        self.calls.append(('build', sorted(place.rooms), path, uri, first, now, sorted(gone)))
        self._fail(self.builds)
        return place

    def change(self, before: Place, after: Place, first: int) -> None:
        self.calls.append(('change', sorted(before.rooms), sorted(after.rooms), first))
        self._fail(self.changes)

    def contradiction(self) -> str:
        found = self.contradictions.pop(0) if self.contradictions else ''
        if isinstance(found, Exception):
            raise found
        return str(found)

    def forget(self) -> None:
        self.calls.append(('forget',))

    def is_loaded(self) -> bool:
        return self.loaded.pop(0) if self.loaded else True

    def robot_places(self) -> tuple[str, ...]:
        return self.robots

    @staticmethod
    def _fail(errors: list[Exception | None]) -> None:
        if errors and (error := errors.pop(0)) is not None:
            raise error


class Kept:
    """A keeper with its scripted ontology; time goes on by a second whenever it is asked."""

    def __init__(
        self,
        ontology: Scripted,
        place: Place | None,
        *,
        stop_after: int = 1000,
        **source: Any,
    ) -> None:
        self.ontology, self.time, self.built = ontology, 1000, 0
        self.said: list[str] = []
        self._left = stop_after

        def report(kind: str) -> Any:
            return lambda line: self.said.append(f'{kind}: {line}')

        self.keeper = MapKeeper(
            cast(MapOntology, ontology),
            Source('file.owl', 'iri', **source),
            place,
            self._now,
            self._stopping,
            Reports(*(report(kind) for kind in ('info', 'warn', 'refused', 'failed'))),
            self._on_built,
        )

    def _now(self) -> int:
        self.time += 1
        return self.time

    def _stopping(self) -> bool:
        self._left -= 1
        return self._left < 0

    def _on_built(self) -> None:
        self.built += 1

    def calls(self) -> list[tuple[Any, ...]]:
        """Return what was asked since the last time."""
        found, self.ontology.calls = self.ontology.calls, []
        return found

    def lines(self) -> list[str]:
        """Return what was said since the last time."""
        found, self.said = self.said, []
        return found


BUILT = 'info: the map is built: 3 rooms, 2 doors'


def test_a_map_is_built_once_and_again_when_the_server_has_lost_it() -> None:
    kept = Kept(Scripted(loaded=[True, False, True]), rooms(), urgent_at_start=False)
    kept.keeper.ensure_built()
    assert kept.calls() == [('build', ['A', 'B', 'C'], 'file.owl', 'iri', 1001, 1002, [])]
    assert (kept.lines(), kept.built, kept.keeper.is_built) == ([BUILT], 1, True)
    kept.keeper.ensure_built()
    assert (kept.calls(), kept.lines(), kept.built) == ([], [], 1)
    kept.keeper.ensure_built()
    # Places count as visited when the map was first built.
    assert kept.calls() == [('build', ['A', 'B', 'C'], 'file.owl', 'iri', 1001, 1003, [])]
    assert (kept.lines(), kept.built) == ([BUILT], 2)
    urgent = Kept(Scripted(), rooms())
    urgent.keeper.ensure_built()
    ((_, _, _, _, first, now, _),) = urgent.calls()
    assert (first, now) == (never_visited(1002), 1003)
    nothing = Kept(Scripted(), None)
    nothing.keeper.ensure_built()
    assert (nothing.calls(), nothing.lines(), nothing.keeper.is_built) == ([], [], False)
    assert nothing.keeper.edit(lambda place: place) == 'there is no map yet'


def test_a_server_that_is_away_is_waited_for_and_told_once() -> None:
    kept = Kept(Scripted(builds=[AWAY, AWAY, AWAY, None]), rooms())
    kept.keeper.ensure_built()
    assert kept.lines() == ['warn: waiting for the armor server: no server', BUILT]
    ended = Kept(Scripted(builds=[AWAY] * 99), rooms(), stop_after=3)
    ended.keeper.ensure_built()
    assert ended.lines() == ['warn: waiting for the armor server: no server']
    assert (ended.built, ended.keeper.is_built) == (0, False)
    assert len(ended.calls()) <= 3
    at_once = Kept(Scripted(builds=[AWAY] * 99), rooms(), stop_after=1)
    at_once.keeper.ensure_built()
    assert at_once.lines() == [], 'who stops says nothing any more'


@pytest.mark.parametrize(('times', 'gives_up'), [(1, False), (9, False), (10, True)])
def test_servers_may_lose_the_map_ten_times_in_a_row(times: int, gives_up: bool) -> None:
    kept = Kept(Scripted(builds=[GONE] * times), rooms())
    kept.keeper.ensure_built()
    again = "warn: the map is built again: unknown reference 'map'"
    expected = [again] * (times - gives_up)
    last = "failed: cannot build the map: unknown reference 'map'" if gives_up else BUILT
    assert kept.lines() == [*expected, last]
    assert kept.built == (not gives_up)
    refused = Kept(Scripted(builds=[REFUSED, None]), rooms())
    refused.keeper.ensure_built()
    assert refused.lines() == ['failed: cannot build the map: no such file']
    assert (refused.built, refused.keeper.is_built) == (0, False)


def test_a_map_grows_by_messages_in_place_or_is_built_anew() -> None:
    kept = Kept(Scripted(), rooms(A=0.0, B=1.0), urgent_at_start=False)
    note = [RoomNote('C', (2.0, 0.0, 0.0), (('B', 'BC'),))]
    kept.keeper.extend(note, '')
    assert [each[0] for each in kept.calls()] == ['build'], 'it was not built yet'
    assert kept.lines() == [BUILT]
    kept.keeper.extend([RoomNote('D', (3.0, 0.0, 0.0), (('C', 'CD'),))], '')
    assert kept.calls() == [('change', ['A', 'B', 'C'], ['A', 'B', 'C', 'D'], 1001)]
    assert (kept.lines(), kept.built) == ([], 1)
    kept.ontology.changes = [AWAY]
    kept.keeper.extend([RoomNote('E', (4.0, 0.0, 0.0), (('D', 'DE'),))], '')
    assert [each[0] for each in kept.calls()] == ['change', 'build']
    assert kept.lines() == [
        'warn: the map is built again: no server',
        'info: the map is built: 5 rooms, 4 doors',
    ]
    kept.keeper.extend([], 'nowhere')
    assert kept.lines() == [
        "refused: the map that was sent is not used: robot_room: no room 'nowhere' in the map"
    ]
    assert kept.calls() == []
    first = Kept(Scripted(), None)
    first.keeper.extend([RoomNote('A', (0.0, 0.0, 0.0), (('B', 'AB'),))], 'A')
    assert [each[0] for each in first.calls()] == ['build']
    assert first.keeper.place is not None
    assert first.keeper.place.start == 'A'


def test_an_edit_is_kept_before_the_ontology_has_it_and_taken_back_when_it_refuses(
    tmp_path: Path,
) -> None:
    file = tmp_path / 'state.json'
    kept = Kept(Scripted(), rooms(), state_file=str(file))
    kept.keeper.ensure_built()
    kept.calls()

    def grown(place: Place) -> Place:
        return place.with_room('X', (5.0, 5.0, 0.0), ['AX'])

    def stored() -> tuple[list[str], list[str]]:
        content = json.loads(file.read_text())
        return sorted(content['edited']['map']), content['by_hand']

    assert stored() == (['A', 'B', 'C'], [])
    kept.ontology.changes = [AWAY]
    assert kept.keeper.edit(grown) == 'the ontology was not changed: no server'
    assert stored() == (['A', 'B', 'C'], [])
    assert kept.keeper.place == rooms()
    assert kept.keeper.edit(grown) == ''
    assert stored() == (['A', 'B', 'C', 'X'], ['X'])
    assert [each[0] for each in kept.calls()] == ['change', 'change']
    before = file.stat().st_mtime_ns
    assert kept.keeper.edit(lambda place: place.with_door('AB', is_open=False)) == ''
    assert file.stat().st_mtime_ns == before, 'a door that is closed is no change of the map'

    def wrong(place: Place) -> Place:
        raise PlaceError(('map', 'Y'), 'no such room')

    assert kept.keeper.edit(wrong) == 'map.Y: no such room'
    assert kept.keeper.place is not None
    assert sorted(kept.keeper.place.rooms) == ['A', 'B', 'C', 'X']
    assert kept.keeper.edit(lambda place: place.without_room('C')) == ''
    assert stored() == (['A', 'B', 'X'], ['C', 'X'])
    # A map that is sent again brings back nothing that was taken away by hand.
    kept.keeper.extend([RoomNote('C', (2.0, 0.0, 0.0), (('B', 'BC'),))], 'C')
    assert sorted(kept.keeper.place.rooms) == ['A', 'B', 'X']
    kept.calls()
    again = Kept(Scripted(), rooms(), state_file=str(file))
    again.keeper.ensure_built()
    ((_, names, *_, gone),) = again.calls()
    assert (names, gone) == (['A', 'B', 'X'], ['C'])
    assert again.lines() == ['info: the map is built: 3 rooms, 3 doors']
    other = Kept(Scripted(), rooms(A=0.0, B=7.0), state_file=str(file))
    assert len(other.lines()) == 1
    other.keeper.ensure_built()
    ((_, names, *_, gone),) = other.calls()
    assert (names, gone) == (['A', 'B'], ['AX', 'BC', 'X']), (
        'what the other place had leaves the ontology'
    )


def test_a_room_with_a_robot_in_it_is_not_removed() -> None:
    kept = Kept(Scripted(robots=('C',)), rooms())
    with pytest.raises(PlaceError, match=r'map\.C: the robot is in it, it cannot be removed'):
        kept.keeper.without_room(rooms(), 'C')
    kept.ontology.robots = ('B',)
    assert sorted(kept.keeper.without_room(rooms(), 'C').rooms) == ['A', 'B']


def test_an_ontology_that_contradicts_itself_is_built_anew_once() -> None:
    kept = Kept(Scripted(), rooms())
    kept.keeper.ensure_built()
    kept.calls(), kept.lines()
    kept.ontology.contradictions = ['A is B', '']
    kept.keeper.end_contradiction()
    assert [each[0] for each in kept.calls()] == ['forget', 'build']
    assert kept.lines() == ['warn: the ontology contradicts itself and is built again: A is B']
    kept.ontology.contradictions = ['A is B', 'A is B']
    kept.keeper.end_contradiction()
    assert kept.lines()[1:] == ['refused: the ontology still contradicts itself: A is B']
    kept.calls()
    kept.ontology.contradictions = ['A is B']
    kept.keeper.end_contradiction()
    assert (kept.calls(), kept.lines()) == ([], []), 'it is done once'
    kept.keeper.end_contradiction()
    kept.ontology.contradictions = ['A is C', '']
    kept.keeper.end_contradiction()
    assert [each[0] for each in kept.calls()] == ['forget', 'build'], 'once it had ended'
    kept.lines()
    kept.ontology.contradictions = [AWAY]
    kept.ontology.loaded = [False]
    kept.keeper.end_contradiction()
    assert [each[0] for each in kept.calls()] == ['build']
    kept.ontology.contradictions = [GONE]
    kept.keeper.end_contradiction()
    assert kept.calls() == []


def test_the_file_of_another_place_is_kept_aside(tmp_path: Path) -> None:
    """What a person edited there is not lost when this place is written over it."""
    file = tmp_path / 'state.json'
    first = Kept(Scripted(), rooms(), state_file=str(file))
    first.keeper.ensure_built()
    first.keeper.edit(lambda place: place.with_room('X', (5.0, 5.0, 0.0), ['AX']))
    edited = file.read_text()
    other = Kept(Scripted(), rooms(A=0.0, B=7.0), state_file=str(file))
    other.keeper.ensure_built()
    assert (tmp_path / 'state.json.unread').read_text() == edited
    assert json.loads(file.read_text())['by_hand'] == []
    # A file without the names that were edited by hand is not one of a place with none.
    content = json.loads(file.read_text())
    del content['by_hand']
    file.write_text(json.dumps(content))
    again = Kept(Scripted(), rooms(A=0.0, B=7.0), state_file=str(file))
    assert "expected 'by_hand' in it" in again.lines()[0]
