"""The tutorial and the pages for newcomers: their files are written and their commands run."""

from __future__ import annotations

import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from floor_plans import read_place
from floor_plans.occupancy_map import write_map
from launcher import cli
from libs.floor_plans.tests.test_plan_photo import CORNERS, plan
from libs.floor_plans.tests.test_rmf_building import building, level
from tests.launcher.conftest import ROOT, USER_ENVIRON, Started, gone

PROCESS = ROOT / 'tests' / 'launcher' / 'mission_process.py'
ELSEWHERE = ('git clone', 'python3 launch.py\n', 'launch.py --web\n', 'benchmarks/')
"""Commands that other tests run: a clone, a mission without end, a page, a benchmark."""

AS_FAST_AS_NODES = ('--for', '600', '-p', 'speed:=0.0', '-p', 'camera.rate:=1.0', '--domain')
"""Time waits for the nodes, for which ten times real time may be too fast on a busy machine; and a
mission ends when the test has seen enough, not when a minute is over."""


def blocks(page: str) -> list[tuple[str, str]]:
    """Return the language and text of each block of a page of the docs."""
    text = (ROOT / 'docs' / page).read_text(encoding='utf-8')
    return re.findall(r'^```(\w+)\n(.*?)^```', text, re.M | re.S)


def words_of(line: str, folder: Path) -> list[str]:
    """Return what Python gets to run a command of a page in a folder."""
    _, *words = shlex.split(line)
    if words[0] != 'launch.py':
        return words
    words = [str(ROOT / word) if word.startswith('config/') else word for word in words[1:]]
    return [str(PROCESS), str(folder / 'runs'), *words]


def carried_out(line: str, folder: Path, capfd: pytest.CaptureFixture[str]) -> str:
    """Run a command of a page in a folder; return what it prints.

    A command of the launcher runs in this process, which has imported what it needs.
    """
    if 'launch.py' in line:
        capfd.readouterr()
        assert cli._dispatch(words_of(line, folder)[2:]) == 0, line
        return capfd.readouterr().out
    done = subprocess.run(
        [sys.executable, *words_of(line, folder)],
        cwd=folder,
        env=USER_ENVIRON,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, (line, done.stdout[-2000:], done.stderr)
    return done.stdout


@pytest.mark.parametrize('page', ['tutorial/first_patrol.md', 'how-to/from_patrolling_sim.md'])
def test_the_page_does_what_it_says(
    page: str,
    tmp_path: Path,
    start: Callable[..., Started],
    ros_domain: int,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    said = ''
    for language, text in blocks(page):
        file = re.match(r'# (\S+?)(, below .*)?\n', text)
        if file is not None:
            path = tmp_path / file[1]
            before = path.read_text() if file[2] else ''
            path.write_text(before + text)
        if language == 'python':
            assert file is not None
            said += carried_out(f'python {file[1]}', tmp_path, capfd)
        elif language == 'sh' and not any(word in text for word in ELSEWHERE):
            for line in text.splitlines():
                if '--for' in line:
                    mission = start(*words_of(line, tmp_path), *AS_FAST_AS_NODES, str(ros_domain))
                    mission.until('arrived in (Lab|Kitchen)')
                    assert mission.end(signal.SIGINT)[0] == 0
                elif not line.startswith('.venv/bin/python'):
                    said += carried_out(line, tmp_path, capfd)
    if page == 'tutorial/first_patrol.md':
        assert (tmp_path / 'flat.png').exists()
        assert "beside a laboratory: ['Hall', 'Lab']" in said
    else:
        assert re.search(r'shortest tour 48 s, longest idleness 4\d s', said)


def test_the_page_about_your_building_does_what_it_says(
    tmp_path: Path,
    start: Callable[..., Started],
    ros_domain: int,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    grid = read_place(ROOT / 'config' / 'seven_rooms.yaml').plan.grid()
    write_map(tmp_path / 'building.yaml', grid.cells[::-1], 0.05, (*grid.origin, 0.0))
    (tmp_path / 'plan.png').write_bytes((tmp_path / 'building.png').read_bytes())
    building(tmp_path, level('L1', 0.0), level('L2', 4.0))
    on_the_wall = np.array([(210, 650), (2100, 640), (2160, 3020), (170, 3080)], np.float32)
    turn = cv2.getPerspectiveTransform(np.array(CORNERS, np.float32), on_the_wall)
    photo = cv2.warpPerspective(plan(24), turn, (2400, 3300), borderValue=(235, 240, 240))
    cv2.imwrite(str(tmp_path / 'photo.jpg'), photo)
    said, shown, driven = '', 0, 0
    for language, text in blocks('how-to/your_building.md'):
        if language == 'yaml':  # zones, which a person adds to the place
            with open('place.yaml', 'a', encoding='utf-8') as place:
                place.write(text)
        for line in text.splitlines() if language == 'sh' else ():
            if ' edit' in line:
                editor = start(*words_of(line, tmp_path))
                editor.until(r'is shown at (\S+)')
                editor.end(signal.SIGINT)
                shown += 1
            elif '--for' in line:
                # The tutorial's mission has a process for each node.
                words = [*words_of(line, tmp_path), '--composed']
                mission = start(*words, *AS_FAST_AS_NODES, str(ros_domain))
                mission.until('arrived in R')
                # The recorder and the alarm look on from a process of their own.
                found = re.findall(r'\(process (\d+)\)', '\n'.join(mission.lines))
                processes = sorted({int(process) for process in found})
                assert len(processes) == 2
                assert mission.end(signal.SIGTERM)[0] == 0
                assert gone(processes, 0)
                driven += 1
            else:
                said += carried_out(line, tmp_path, capfd)
    assert (shown, driven) == (2, 1)
    assert '7 doors' in said
    assert {path.name for path in tmp_path.glob('*_place.yaml')} == {
        *('plan_place.yaml', 'photo_place.yaml', 'clinic_place.yaml'),
    }
    assert (tmp_path / 'masks' / 'costmap_filters.yaml').exists()
