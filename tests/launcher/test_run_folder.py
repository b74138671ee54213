"""Folders of runs: found again after a launcher that was killed, and kept to a size."""

from __future__ import annotations

import errno
import json
import os
import signal
from dataclasses import replace

import pytest

from launcher.cli import CONFIG
from launcher.run import (
    Run,
)
from launcher.run_configuration import configuration
from launcher.run_folder import (
    RunState,
    find,
    latest,
    look_into,
    make_folder,
    options_of,
    prune,
    resumed,
    run_from,
)
from surveillance_runtime.launch_protocol import NotNowError
from surveillance_runtime.run_files import STATE, in_order
from surveillance_runtime.run_parameters import write_parameters

HOLD = (
    'import sys, signal; from pathlib import Path; from launcher.run_folder import RunState\n'
    'state = RunState(Path(sys.argv[1]), {"mode": "RANDOM"}); print("held", flush=True)\n'
    'signal.pause()'
)


def begun(runs, name, size=0, *, ended=True):
    folder = runs / name
    folder.mkdir()
    (folder / 'data').write_bytes(b'x' * size)
    state = RunState(folder, {'mode': name})
    if ended:
        state.end()
    return folder


def test_each_run_has_a_folder_of_its_own(tmp_path):
    assert make_folder(tmp_path) != make_folder(tmp_path)


def test_runs_where_nothing_can_be_written(tmp_path):
    (tmp_path / 'runs').write_text('a file')
    with pytest.raises(NotNowError, match='cannot be made'):
        make_folder(tmp_path / 'runs')


def test_a_full_disk_takes_no_run_away_and_leaves_no_empty_one(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    old = begun(tmp_path, 'old')
    monkeypatch.setattr(os, 'pwrite', full)
    for folder in (make_folder(tmp_path), old):
        with pytest.raises(OSError, match=f'{folder / STATE}') as caught:
            RunState(folder, {})
        assert caught.value.errno == errno.ENOSPC
    assert list(tmp_path.iterdir()) == [old]
    assert look_into(old) is not None


def test_a_run_that_came_to_its_end_says_so(tmp_path):
    folder = begun(tmp_path, 'one')
    found = look_into(folder)
    assert found is not None
    assert (found.ended, found.running, found.options) == (True, False, {'mode': 'one'})


def test_the_run_that_was_started_last_is_gone_on_with_whatever_its_name_says(tmp_path):
    begun(tmp_path, '20260102-000000')
    behind = begun(tmp_path, '19700101-000000', ended=False)  # no battery keeps the clock
    assert latest(tmp_path).folder == behind
    first = tmp_path / '20260102-000000'
    RunState(first, {}).end()  # gone on with
    assert latest(tmp_path).folder == first
    assert in_order(tmp_path.iterdir()) == [behind, first]


def test_a_killed_launcher_leaves_a_run_that_did_not_end(start, tmp_path):
    launch = start('-c', HOLD, str(tmp_path))
    launch.until('held')
    found = look_into(tmp_path)
    assert found is not None
    assert found.running
    with pytest.raises(NotNowError, match='still going on'):
        RunState(tmp_path, {})
    launch.end(signal.SIGKILL)
    found = look_into(tmp_path)
    assert found is not None
    assert (found.ended, found.running, found.options) == (False, False, {'mode': 'RANDOM'})


def test_the_last_run_is_found_and_others_by_name_or_path(tmp_path):
    first, second = begun(tmp_path, '20260101-000000'), begun(tmp_path, '20260102-000000')
    (tmp_path / '20260103-000000').mkdir()  # not of a run
    found = latest(tmp_path)
    assert found is not None
    assert found.folder == second
    assert find(tmp_path, '').folder == second
    assert find(tmp_path, first.name).folder == first
    assert find(tmp_path, str(first)).folder == first
    for name in ('nothing', '20260103-000000'):
        with pytest.raises(ValueError, match='--resume: no run in'):
            find(tmp_path, name)
    with pytest.raises(ValueError, match='a run that can be gone on with'):
        find(tmp_path / 'none', '')


@pytest.mark.parametrize('content', ['', '{', '[]', '{"ended": true}', '\x00' * 100])
def test_a_damaged_state_is_no_run(tmp_path, content):
    (tmp_path / STATE).write_text(content)
    assert look_into(tmp_path) is None


def test_a_link_in_place_of_the_state_is_not_followed(tmp_path):
    (tmp_path / 'target').write_text('precious')
    (tmp_path / STATE).symlink_to(tmp_path / 'target')
    with pytest.raises(OSError, match='symbolic links'):
        RunState(tmp_path, {})
    assert (tmp_path / 'target').read_text() == 'precious'


def test_the_oldest_runs_go_first_and_the_last_and_the_running_stay(tmp_path):
    names = [f'2026010{number}-000000' for number in range(1, 6)]
    folders = [
        begun(tmp_path, name, 100_000, ended=number != 1) for number, name in enumerate(names)
    ]
    (tmp_path / 'notes').mkdir()
    assert prune(tmp_path, 10**9, folders[4]) == []
    deleted = prune(tmp_path, 350_000, folders[4])
    assert deleted == [folders[0], folders[2]]
    assert prune(tmp_path, 0, folders[4]) == [folders[3]]
    assert folders[4].exists()
    assert (tmp_path / 'notes').exists()


def test_the_run_that_is_gone_on_with_stays_though_it_is_the_oldest(tmp_path, monkeypatch):
    folders = [begun(tmp_path, f'2026010{number}-000000', 100_000) for number in range(1, 4)]
    monkeypatch.chdir(tmp_path)
    chosen = find(tmp_path, folders[0].name).folder
    assert prune(tmp_path, 0, chosen) == [folders[1]]


def test_a_state_nested_too_deep_holds_no_run(tmp_path):
    (tmp_path / STATE).write_text('[' * 200_000)
    assert look_into(tmp_path) is None


def test_a_run_folder_on_a_full_disk_is_named(tmp_path):
    (tmp_path / 'armor_server.yaml').symlink_to('/dev/full')
    run = Run()
    with pytest.raises(OSError, match=r'cannot be written: No space left.*armor_server.yaml'):
        write_parameters(tmp_path, None, configuration(CONFIG, run), run.nodes())


def test_options_of_a_run_survive_its_launcher(tmp_path):
    files = {name: tmp_path / name for name in ('place', 'parameters', 'notify', 'watch', 'stage')}
    run = replace(Run(mode='RANDOM', assignments=['a:=1'], only=['reasoner']), **files)
    stored = json.loads(json.dumps(options_of(run)))
    assert run_from(stored) == replace(run, without=[], remaps=[])
    with pytest.raises(ValueError, match='--resume'):
        run_from({'mode': 'RANDOM', 'place': None, 'seconds': None} | {'place': 7})


def test_a_resumed_run_keeps_what_is_not_given_anew(tmp_path):
    folder = make_folder(tmp_path)
    RunState(folder, options_of(Run(mode='RANDOM', namespace='robot1'))).end()
    run, found = resumed(Run(namespace='robot2'), Run(), tmp_path, '')
    assert (run.mode, run.namespace, found) == ('RANDOM', 'robot2', folder)
