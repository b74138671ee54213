"""The demo: its machine goes through all rooms, and what it prints is what its README shows."""

from __future__ import annotations

from pathlib import Path

import pytest

from state_machines import demo
from state_machines.export import to_mermaid

README = Path(__file__).parent.parent / 'README.md'


def test_it_runs_stops_and_goes_on(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(demo, 'LOOK_SECONDS', 0.01)
    demo.main()
    said = capsys.readouterr().out
    # Once in each whole run; the preempted one and what goes on from it may both look at a room.
    assert all(said.count(f'room: {room}') >= 2 for room in demo.ROOMS)
    assert "leads to 'INSPCET'" in said
    assert said.count('ended with preempted') == 1
    assert said.count('ended with finished') == 2


def test_the_readme_shows_its_machine() -> None:
    assert to_mermaid(demo.patrol()) in README.read_text(encoding='utf-8')
    assert 'python -m state_machines.demo' in README.read_text(encoding='utf-8')
