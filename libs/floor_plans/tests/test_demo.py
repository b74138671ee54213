"""The demo: each of its steps leaves what it says, and the README shows it."""

from __future__ import annotations

from pathlib import Path

import pytest

from floor_plans import demo, read_place

README = Path(__file__).parent.parent / 'README.md'


def test_a_map_becomes_a_place_that_is_changed_and_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    demo.main(tmp_path / 'demo')
    said = capsys.readouterr().out
    assert '4 rooms, 1 corridor, 4 doors' in said
    assert '(20, 1) lies in no room' in said
    assert 'R2 is cut: the new part is R4, joined by D5' in said
    assert 'undone: R2 is cut' in said
    assert set(read_place(tmp_path / 'demo/place.yaml').place.rooms) == {
        *('office', 'R1', 'R2', 'R3', 'C1')
    }
    for name in ('map.png', 'place.png', 'drawn.png'):
        assert (tmp_path / 'demo' / name).stat().st_size > 300
    demo.main(tmp_path / 'demo')  # once more


def test_the_readme_names_it() -> None:
    assert 'python -m floor_plans.demo' in README.read_text(encoding='utf-8')
