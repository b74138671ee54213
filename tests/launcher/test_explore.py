"""The command `explore`: what it refuses, and what it makes of the map that the robot built."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from floor_plans import read_place
from floor_plans.occupancy_map import write_map
from launcher.explore import EXIT_NOTHING_SEEN, close, options_of
from launcher.run import MARKERS, RECORDER, wanted_run
from surveillance_controllers.explorer_node import DONE_FILE, MAP_FILE
from surveillance_runtime.node_table import EXPLORER

CONFIG = Path(__file__).parents[2] / 'config'


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        (['--out', 'map.png'], 'expected a name that ends in .yaml'),
        (['--out', 'nowhere/map.yaml'], 'there is no folder nowhere'),
        (['--mode', 'RANDOM'], 'expected SIMULATED or ROBOT'),
        (['--mode', 'ROBOT', '--map', 'a.yaml'], 'the building to explore'),
        (['--robots', '2'], 'one robot explores'),
        (['--for', '0'], 'expected a positive number'),
    ],
)
def test_what_cannot_be_is_said_in_one_line(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=said):
        options_of(words)


def test_nothing_is_written_over_unasked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path('building_place.yaml').write_text('mine')
    with pytest.raises(ValueError, match=r'building_place\.yaml: there already'):
        options_of([])
    assert options_of(['--force']).out == Path('building.yaml')


def test_what_cannot_be_written_is_said_before_the_robot_drives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path('building.pgm').mkdir()
    with pytest.raises(ValueError, match=r'building\.pgm: expected no folder there'):
        options_of(['--force'])
    monkeypatch.setattr('os.access', lambda *_: False)  # root may write everywhere
    with pytest.raises(ValueError, match=r'--out hut\.yaml: nothing can be written into \.'):
        options_of(['--out', 'hut.yaml'])


def explored(folder: Path) -> None:
    """Leave what a run leaves: two rooms with a door of 1 m."""
    cells = np.zeros((82, 162), np.int8)
    cells[[0, 1, -1, -2]] = 100
    cells[:, [0, 1, -1, -2]] = 100
    cells[:, 80:82] = 100
    cells[30:50, 80:82] = 0
    write_map(folder / MAP_FILE, cells, 0.05, (-2.0, -2.0, 0.0), 'pgm')


def test_the_map_becomes_a_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    run = tmp_path / 'run'
    run.mkdir()
    explored(run)
    (run / DONE_FILE).write_text('(1.0, 2.0), 0.5 m: the robot does not fit there\n')
    assert close(run, options_of(['--out', 'hut.yaml']), CONFIG) == 0
    said = capsys.readouterr().out
    assert 'left: (1.0, 2.0), 0.5 m: the robot does not fit there' in said
    assert 'patrol: python3 launch.py --mode SIMULATED --map hut_place.yaml' in said
    assert sorted(each.name for each in tmp_path.glob('hut*')) == [
        'hut.pgm',
        'hut.yaml',
        'hut_place.png',
        'hut_place.yaml',
    ]
    place = read_place(tmp_path / 'hut_place.yaml')
    assert len(place.plan.place.rooms) == 2
    assert len(place.plan.doors) == 1
    assert place.plan.start[:2] == (0.0, 0.0)


def test_a_map_may_have_any_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    run = tmp_path / 'run'
    run.mkdir()
    explored(run)
    options = options_of(['--out', "# Anna's hut: 2.yaml", '--robot', 'turtlebot4'])
    assert close(run, options, CONFIG) == 0
    assert '--mode SIMULATED --robot turtlebot4 --map' in capsys.readouterr().out
    assert read_place(tmp_path / "# Anna's hut: 2_place.yaml").plan.doors


def test_a_map_that_cannot_be_written_is_not_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    run = tmp_path / 'run'
    run.mkdir()
    explored(run)
    options = options_of([])
    Path('building.pgm').mkdir()
    with pytest.raises(ValueError, match=r'the map is kept in .*run/map\.yaml'):
        close(run, options, CONFIG)


def test_a_run_that_saw_nothing_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert close(tmp_path, options_of([]), CONFIG) == EXIT_NOTHING_SEEN
    assert 'nothing was mapped' in capsys.readouterr().err


def test_an_exploration_is_recorded_where_somebody_asks_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    only = ('simulator', EXPLORER)
    for words, names in (([], []), (['--record', 'rec'], [RECORDER, MARKERS])):
        run = replace(wanted_run(options_of(words)), only=only)
        started = {node.name for node in run.observers()} & {RECORDER, MARKERS}
        assert started == set(names)
