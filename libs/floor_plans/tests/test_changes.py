"""What differs between two places of one building, and what brings the older state back."""

from __future__ import annotations

import shutil
from pathlib import Path

from floor_plans import read_place
from floor_plans.editor import PlaceEditor, changes_between
from floor_plans.imports.renewal import Alignment

SEVEN = Path(__file__).with_name('places') / 'seven_rooms.yaml'


def test_rooms_and_doors_that_came_and_went_are_told_each_with_its_way_back(tmp_path: Path) -> None:
    shutil.copy(SEVEN, tmp_path / 'place.yaml')
    editor = PlaceEditor(tmp_path / 'place.yaml')
    editor.apply('cut', {'x1': 15, 'y1': 10, 'x2': 15, 'y2': 14.5})
    editor.apply('join_at', {'name': 'D1'})
    lies = Alignment(0.0, (0.0, 0.0), 1.0)
    rules = {'thresholds': {'R1': 60.0}}
    found = changes_between(read_place(SEVEN).plan, rules, editor.now.plan, lies)
    new, gone = found
    assert new.said == 'room R5 is new: it was a part of C2'
    assert gone.said == 'room R1 is gone: it is a part of C1'
    assert [step[0] for step in gone.keep] == ['cut', 'set_rule']
    assert new.is_open(editor.now.plan)
    assert not new.is_open(read_place(SEVEN).plan)
    editor.decide(found)
    assert editor.keep_old('R1') == 'as before: room R1'
    assert editor.now.rules.thresholds['R1'] == 60.0
    assert editor.changes == (new,)
    assert editor.take_new('R5') == 'taken: room R5 is new: it was a part of C2'
    assert editor.changes == ()
