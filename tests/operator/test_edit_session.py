"""One place that people edit: each change is checked, written and told."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from floor_plans import read_place
from floor_plans.editor import PlaceEditor
from floor_plans.imports import changes_since
from surveillance_operator.place_page.edit_session import EditSession

SEVEN = Path(__file__).parents[2] / 'config' / 'seven_rooms.yaml'


@pytest.fixture
def file(tmp_path: Path) -> Path:
    shutil.copy(SEVEN, tmp_path / 'place.yaml')
    return tmp_path / 'place.yaml'


def test_a_change_is_shown_undone_and_saved_and_whoever_asks_is_told(file: Path) -> None:
    saved: list[Any] = []
    session = EditSession(PlaceEditor(file), lambda editor: saved.append(editor) or 'told')
    act = session.actions
    fields = {'kind': 'room', 'name': 'R1', 'new': 'kitchen'}
    assert act['check_edit']('rename', {**fields, 'new': 'R2'})['problem']
    done = act['edit']('rename', fields)
    assert 'kitchen' in done['place']['rooms']
    assert done['place']['changed']
    assert 'R1' in act['undo_edit']()['place']['rooms']
    act['redo_edit']()
    assert act['save_place']()['text'].endswith('; told')
    assert len(saved) == 1
    assert 'kitchen' in read_place(file).plan.place.rooms
    assert session.questions['room_at']('12', '12') == {'ok': True, 'room': 'C2'}


def test_a_change_at_once_that_cannot_be_written_is_taken_back(file: Path) -> None:
    session = EditSession(PlaceEditor(file))
    file.write_text(file.read_text() + '# by somebody else\n')
    with pytest.raises(ValueError, match='changed by somebody else'):
        session.change_now('remove_room', {'room': 'R3'})
    assert 'R3' in session.questions['place']()['place']['rooms']
    session.check_saved()


def test_without_a_place_there_is_nothing_to_edit() -> None:
    session = EditSession(None)
    assert session.questions['place']() == {'ok': True, 'place': None}
    with pytest.raises(ValueError, match='drop a map on the page'):
        session.actions['undo_edit']()


def test_what_a_newer_map_changes_is_taken_or_brought_back_each_on_its_own(tmp_path: Path) -> None:
    older = tmp_path / 'older.yaml'
    shutil.copy(SEVEN, older)
    editor = PlaceEditor(older)
    editor.apply('cut', {'x1': 15, 'y1': 10, 'x2': 15, 'y2': 14.5})
    editor.apply('join_at', {'name': 'D1'})
    editor.path = tmp_path / 'newer.yaml'
    shutil.copy(older, editor.path)
    editor.save()
    newer = PlaceEditor(editor.path)
    newer.decide(changes_since(older, newer.now.plan, 0.22))
    session = EditSession(newer)
    shown = session.questions['place']()['place']['changes']
    assert {(each['kind'], each['name']): each['back'] for each in shown} == {
        ('room', 'R5'): True,
        ('room', 'R1'): True,
    }
    with pytest.raises(ValueError, match="no change 'R4': expected one of R5, R1"):
        session.actions['keep_old']('R4')
    done = session.actions['keep_old']('R1')
    assert set(done['place']['doors']['D1']['joins']) == {'R1', 'C1'}
    assert [each['name'] for each in done['place']['changes']] == ['R5']
    while newer.undoable:
        done = session.actions['undo_edit']()
    assert [each['name'] for each in done['place']['changes']] == ['R5', 'R1']
    assert [each['name'] for each in session.actions['take_new']('R5')['place']['changes']] == [
        'R1'
    ]
