"""From an unknown building to a patrol, as a user types it: explore, then patrol the result."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from benchmarks import regular_places
from floor_plans import read_place
from floor_plans.writing import format_place

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]
FAST = str(ROOT / 'config' / 'fast.yaml')


def launch(words: list[str], folder: Path) -> str:
    """Run the launcher in a folder to its end; return what it printed."""
    command = [sys.executable, str(ROOT / 'launch.py'), *words, '--params', FAST, '--domain', '88']
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_building_is_explored_and_patrolled(tmp_path: Path) -> None:
    building = tmp_path / 'unknown.yaml'
    building.write_text(format_place(regular_places.grid(2, 2), 'A building of four rooms'))
    said = launch(['explore', '--map', str(building)], tmp_path)
    assert 'patrol: python3 launch.py --mode SIMULATED --map building_place.yaml' in said
    place = read_place(tmp_path / 'building_place.yaml').plan
    assert len(place.place.rooms) == 4
    assert len(place.doors) == 4
    assert yaml.safe_load((tmp_path / 'building.yaml').read_text())['image'] == 'building.pgm'
    run = tmp_path / 'runs'
    patrol = ['--mode', 'SIMULATED', '--map', 'building_place.yaml', '--for', '60']
    said = launch([*patrol, '--record', str(run)], tmp_path)
    assert '4 of 4 places visited' in said
    assert 'failures: none' in said
    (state,) = run.glob('*/simulator.json')
    assert json.loads(state.read_text())['collisions'] == 0
