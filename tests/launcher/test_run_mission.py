"""One run from its start to its summary."""

from __future__ import annotations

import shlex

from launcher.fleet_launch import RobotProcesses
from launcher.run import Run
from launcher.run_folder import RunState, make_folder, options_of
from launcher.run_mission import (
    chosen_folder,
    stopped_ones,
    summary,
    watch_command,
    what_to_look_at,
)
from surveillance_behaviour.mission.mission_log import MissionRecord
from surveillance_runtime.event_log import record_in
from surveillance_runtime.node_table import BY_NAME
from surveillance_runtime.run_files import TIMELINE
from surveillance_runtime.stop_request import StopFile, StopRequest, own_file


def test_the_last_lines_of_a_run_can_be_typed_and_tell_what_could_not_be_written(tmp_path):
    folder = tmp_path / 'ein Lauf é'
    (folder / 'report.html').mkdir(parents=True)
    (folder / TIMELINE).touch()
    with MissionRecord(record_in(folder)) as record:
        record.write('start', 0.0, machine='surveillance', place='E', places=['E'])
        record.write('visit', 9.0, place='E', distance=1.0)
    report, replay = what_to_look_at(folder)
    assert report == f'report: {folder}/report.html: expected a file, got a folder'
    assert shlex.split(replay)[1:] == ['python3', 'launch.py', 'replay', str(folder)]
    assert what_to_look_at(tmp_path) == []


def test_a_summary_is_given_also_without_a_record(tmp_path):
    assert summary(tmp_path / 'none') == 'Mission: nothing was recorded.'
    with MissionRecord(tmp_path / 'record') as record:
        record.write('start', 0.0, machine='surveillance', place='E', places=['E', 'C1'])
        record.write('visit', 5.0, place='C1', distance=3.0)
    assert '2 places visited' in summary(tmp_path / 'record')
    (tmp_path / 'record').write_text('nonsense\n')
    assert 'Mission: ' in summary(tmp_path / 'record')


def test_the_hint_to_watch_leads_to_this_run(monkeypatch):
    monkeypatch.delenv('ROS_DOMAIN_ID', raising=False)
    assert watch_command(Run()) == 'python3 launch.py watch'
    named = Run(domain=7, namespace='robot2')
    assert watch_command(named) == 'python3 launch.py watch --domain 7 --namespace robot2'
    monkeypatch.setenv('ROS_DOMAIN_ID', '3')
    assert watch_command(Run()) == 'python3 launch.py watch --domain 3'


def test_a_robot_that_was_stopped_is_named_at_the_start(tmp_path):
    team = [RobotProcesses(run=Run(domain=7), nodes=(), observers=(BY_NAME['motion_controller'],))]
    environ = {'XDG_STATE_HOME': str(tmp_path), 'XDG_RUNTIME_DIR': str(tmp_path / 'none')}
    assert stopped_ones(Run(domain=7), team, environ) == []
    StopFile(own_file(7, '/', environ)).keep(StopRequest('the guard', '', 1.7e9))
    (line,) = stopped_ones(Run(domain=7), team, environ)
    assert line.startswith('the robot is stopped by the guard at ')
    assert line.endswith(', not released: it stands until somebody does')
    assert stopped_ones(Run(domain=8), team, environ) == []


def test_a_run_whose_state_is_damaged_is_named_at_the_start(tmp_path):
    old = make_folder(tmp_path)
    RunState(old, options_of(Run())).end(ended=False)
    (old / 'run.json').write_text('{"options')
    folder, how = chosen_folder(Run(), tmp_path, None)
    assert folder != old
    assert how == f'{old / "run.json"} is damaged: that run is not gone on with'
    RunState(folder, options_of(Run())).end()
    assert chosen_folder(Run(), tmp_path, None)[1] == '', 'it is told once'


def test_an_unfinished_run_of_other_options_is_told_at_the_start(tmp_path):
    old = make_folder(tmp_path)
    state = RunState(old, options_of(Run(seconds=3.0)))
    state.end(ended=False)
    assert chosen_folder(Run(), tmp_path, None)[0] == old
    folder, how = chosen_folder(Run(mode='MANUAL'), tmp_path, None)
    assert folder != old
    assert how.endswith(
        f'{old.name} was started with other options (mode was None, is MANUAL) and is not '
        'finished; --resume continues it'
    )
    assert chosen_folder(Run(mode='MANUAL', fresh=True), tmp_path, None)[1] == ''
