"""The command `import` of the robot: the library's, with the words of the robot's commands."""

from __future__ import annotations

from pathlib import Path

import pytest

from floor_plans import read_place
from floor_plans.occupancy_map import write_map
from surveillance_operator.import_command import main

CONFIG = Path(__file__).parents[2] / 'config'


def test_a_robots_map_becomes_a_place_that_says_how(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    grid = read_place(CONFIG / 'seven_rooms.yaml').plan.grid()
    write_map(tmp_path / 'flat.yaml', grid.cells[::-1], grid.resolution, (*grid.origin, 0.0))
    assert main(['flat.yaml']) == 0
    assert 'Written by: launch.py import flat.yaml' in (tmp_path / 'flat_place.yaml').read_text()


def test_an_unknown_option_is_answered_with_the_nearest(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(['map.yaml', '--lable', 'rooms.png'])
    assert ended.value.code == 2
    assert "unknown option '--lable': expected '--labels'" in capsys.readouterr().err
