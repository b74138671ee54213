"""The messages of Nav2 beside this project's own."""

from __future__ import annotations

from pathlib import Path

from launcher.environment import complete
from launcher.nav2_messages import ACTIONS, write_package
from tests.launcher.conftest import ROOT


def test_the_package_has_the_actions_and_no_word_of_ours(tmp_path: Path) -> None:
    folder = tmp_path / 'sources'
    (folder / 'left').mkdir(parents=True)
    write_package(folder, ROOT / 'surveillance_interfaces')
    made = {path.stem for path in folder.glob('action/*.action')}
    assert made == set(ACTIONS) >= {'NavigateThroughPoses', 'DockRobot', 'UndockRobot', 'Spin'}
    assert not (folder / 'left').exists()
    cmake = (folder / 'CMakeLists.txt').read_text()
    for name in made:
        assert f'action/{name}.action' in cmake
    for file in folder.glob('*.*'):
        assert 'surveillance_' not in file.read_text()


def test_a_set_up_with_them_is_another_one() -> None:
    without, with_them = complete(ROOT, ['test']), complete(ROOT, ['nav2', 'test'])
    assert with_them.interfaces != without.interfaces
    assert with_them.packages == without.packages
