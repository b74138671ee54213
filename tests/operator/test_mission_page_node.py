"""What a person changes on the page is changed everywhere: in the mission, the file, the editor."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from floor_plans import read_place
from floor_plans.editor import PlaceEditor
from surveillance_operator.mission_page_node import MissionPage, RoomChanges
from surveillance_operator.place_page.edit_session import EditSession

SEVEN = Path(__file__).parents[2] / 'config' / 'seven_rooms.yaml'


class Mission:
    """A mission that removes each room but the robot's."""

    def __init__(self) -> None:
        self.removed: list[str] = []

    def remove_room(self, name: str) -> str:
        if name == 'R2':
            raise ValueError('the robot is in it, it cannot be removed')
        self.removed.append(name)
        return f'{name} removed'

    def add_room(self, name: str, x: float, y: float, doors: Any) -> str:
        return f'{name} added'


@pytest.fixture
def file(tmp_path: Path) -> Path:
    shutil.copy(SEVEN, tmp_path / 'place.yaml')
    return tmp_path / 'place.yaml'


@pytest.fixture
def told() -> list[set[str]]:
    """Return where the rooms are kept that the running mission was told of, each time."""
    return []


@pytest.fixture
def session(file: Path, told: list[set[str]]) -> EditSession:
    def tell(editor: PlaceEditor) -> str:
        told.append(set(editor.whole()['map']))
        return ''

    return EditSession(PlaceEditor(file), tell)


def changes(session: EditSession | None) -> tuple[RoomChanges, Mission]:
    mission: Any = Mission()
    return RoomChanges(mission, session), mission


def rooms_of(file: Path) -> set[str]:
    return set(read_place(file).plan.place.rooms)


def shown(session: EditSession) -> set[str]:
    return set(session.questions['place']()['place']['rooms'])


def test_a_room_that_is_removed_on_the_page_is_in_the_file_and_the_editor_no_more(
    file: Path, session: EditSession, told: list[set[str]]
) -> None:
    rooms, mission = changes(session)
    said = rooms.remove('R3')
    assert said == 'R3 removed; also in the file: the editor can undo it'
    assert mission.removed == ['R3']
    assert 'R3' not in rooms_of(file) | shown(session)
    assert 'R3' not in told[-1]
    session.actions['undo_edit']()
    session.actions['save_place']()
    assert 'R3' in rooms_of(file) & shown(session) & told[-1]


def test_what_the_mission_refuses_changes_no_file(file: Path, session: EditSession) -> None:
    rooms, _ = changes(session)
    with pytest.raises(ValueError, match='the robot is in it'):
        rooms.remove('R2')
    assert 'R2' in rooms_of(file) & shown(session)


def test_what_nobody_has_saved_yet_is_not_written_with_a_room_that_goes(
    file: Path, session: EditSession
) -> None:
    rooms, mission = changes(session)
    session.actions['edit']('set_keep_out', {'room': 'R1', 'on': True})
    with pytest.raises(ValueError, match='not saved: save or undo'):
        rooms.remove('R3')
    assert mission.removed == []
    assert 'R3' in rooms_of(file)


def test_a_room_of_this_run_alone_is_said_to_be_so(session: EditSession) -> None:
    rooms, _ = changes(None)
    assert rooms.remove('R3') == 'R3 removed; for this run'
    assert rooms.add('R9', 1.0, 2.0, ['D1']) == 'R9 added'
    rooms, _ = changes(session)
    assert 'for this run' in rooms.add('R9', 1.0, 2.0, ['D1'])


def test_the_token_is_in_no_log_and_on_no_topic(graph: Any, tmp_path: Path) -> None:
    said = graph.said()
    token_file = tmp_path / 'token'
    parameters = {'port': 0, 'control': True, 'token_file': str(token_file)}
    node = graph.add(MissionPage, parameters=parameters)
    graph.until(lambda: any('the mission is shown at' in line for line in said))
    (line,) = (each for each in said if 'the mission is shown at' in each)
    assert line.endswith(f'{node.page.open_address} (its token is in {token_file})')
    token = token_file.read_text().strip()
    assert node.page.address.endswith(f'?token={token}')
    assert not any(token in each for each in said)
    assert token_file.stat().st_mode & 0o077 == 0
