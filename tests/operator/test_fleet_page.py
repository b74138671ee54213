"""A fleet before a person: its robots on one page and in one time line, told one by one or all.

The page of a robot that is alone is that of a fleet of one; `test_page_states.py` has it.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import json
import os
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.qos import QoSProfile
from rich.console import Console
from std_msgs.msg import String, UInt8
from std_srvs.srv import SetBool, Trigger

from floor_plans import Grid
from patrol_policy.world import Decision
from state_machines import Interrupt
from state_machines.exceptions import CallError
from strict_files.files import FileError
from surveillance_behaviour.mission.mission_log import MissionRecord
from surveillance_interfaces.msg import DoorStates, FleetRobot, MissionStatus
from surveillance_operator import fleet_command, fleet_subscriber, node_graph_watch
from surveillance_operator.console_commands import answer, completions
from surveillance_operator.console_node import ConsoleNode
from surveillance_operator.fleet_actions import WORDS, FleetActions
from surveillance_operator.fleet_subscriber import FleetSubscriber
from surveillance_operator.fleet_table import fleet_lines
from surveillance_operator.mission_changes import follow
from surveillance_operator.mission_markers_node import markers_of
from surveillance_operator.mission_state import (
    MissionState,
    NodeReport,
    Notice,
    PatrolShare,
    Status,
)
from surveillance_operator.mission_words import doing, troubles
from surveillance_operator.page.broadcaster import Broadcaster
from surveillance_operator.page.server import Page
from surveillance_operator.page_state import health, merged_events
from surveillance_operator.recording.runs import find_recordings
from surveillance_operator.recording.timeline import TimelineWriter
from surveillance_operator.replay import open_player
from surveillance_operator.report import draw_picture, write_report
from surveillance_operator.watch.view import MissionView, show_once
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.rviz_layout import fleet_layout
from tests.launcher.conftest import ROOT
from tests.operator.browser import CHROMIUM, DESK, DRIVER, MISSING, PHONE, Viewer
from tests.operator.prompt import Prompt


def robot(name: str, place: str = 'A', x: float = 1.0) -> MissionState:
    """Return a robot of a fleet on its way from a place."""
    cells = np.zeros((20, 60), np.int8)
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = 100
    return MissionState().having(
        where='ROS domain 5',
        namespace=name,
        now=100.0,
        threshold=240.0,
        nodes={'robot_behavior': frozenset('1')},
        status=Status(90.0, 'surveillance', 'MOVE', place, 'B', False, '', ()),
        decision=Decision(95.0, place, 'B', 'B', 'URGENT', 'tour', f'B is for {name}', {}),
        decision_number=1,
        battery=80.0,
        grid=Grid(cells, 0.1),
        positions={'A': (1.0, 1.0), 'B': (5.0, 1.0)},
        pose=(x, 1.0, 0.0),
        plan=np.array([(x, 1.0), (5.0, 1.0)]),
        share=PatrolShare(('A', 'B'), 'B', heading_to='B', is_moving=True),
        notices=(
            Notice(f'{name} begins', at=1e9),
            Notice('door D closed', at=1e9 + 1.0, shared=True),
        ),
    )  # fmt: skip


FLEET = {
    '': MissionState(where='ROS domain 5').having(nodes={'armor_server': frozenset('1')}),
    'anna': robot('anna'),
    'bert': robot('bert', x=2.0),
    'carl': robot('carl', x=3.0),
}


# --- without ROS and without a browser ---


def test_one_time_line_names_each_robot_and_tells_of_the_place_once() -> None:
    told = {
        '': [[12.0, 'armor_server was started again']],
        'anna': [[10.0, 'arrived in A'], [11.0, 'door D closed', 1], [30.0, 'door D closed', 1]],
        'bert': [[9.0, 'arrived in A'], [11.4, 'door D closed', 1]],
    }
    assert merged_events(told) == [
        [9.0, 'bert', 'arrived in A'],
        [10.0, 'anna', 'arrived in A'],
        [11.0, '', 'door D closed'],
        [12.0, '', 'armor_server was started again'],
        [30.0, '', 'door D closed'],
    ]


def test_a_program_that_robots_share_stands_once_in_the_health_of_each() -> None:
    good = NodeReport(0, 'up', ())
    names = ('anna/planner_controller', 'anna/mission_markers', 'simulator', 'armor_server')
    anna = FLEET['anna'].having(
        nodes=dict.fromkeys(('simulator', 'planner_controller'), frozenset('1'))
    )
    found = health(anna.having(namespace='anna', reports=dict.fromkeys(names, good)))
    assert {name: len(node['reports']) for name, node in found['nodes'].items()} == {
        'planner_controller': 1,
        'simulator': 1,
    }
    assert found['others'].keys() == {'armor_server', 'mission_markers'}


def test_what_a_robot_does_and_what_is_wrong_with_it_is_said_in_words() -> None:
    anna = FLEET['anna']
    assert doing(anna) == 'on its way to B'
    share = anna.task.share
    assert share is not None
    assert doing(anna.having(share=replace(share, is_moving=False))) == 'waits to go to B'
    out = anna.having(share=PatrolShare(taken_out=True))
    assert doing(out) == 'taken out of the patrol'
    assert [each.text for each in follow(anna, out, 1.0)[1]] == ['taken out of the patrol']
    reports = {
        'anna/battery_controller': NodeReport(3, 'silent', ()),
        'anna/motion_controller': NodeReport(2, 'no odometry', ()),
        'bert/motion_controller': NodeReport(2, 'not mine', ()),
        'armor_server': NodeReport(2, 'of all', ()),
    }
    bad = anna.having(stopped=True, reports=reports, ended=frozenset({'robot_behavior'}))
    assert troubles(bad) == [
        'stopped until a person releases it',
        'ended: robot_behavior',
        'motion_controller: no odometry',
        'silent: battery_controller',
    ]
    assert troubles(anna.having(nodes={})) == ['none of its programs is heard']
    lines = fleet_lines({'anna': bad, '': FLEET[''].having(ended=frozenset({'simulator'}))})
    assert lines[0].split() == [
        'anna',
        'A',
        'battery',
        '80',
        '%',
        'stopped;',
        'shares',
        'A,',
        'B,',
        'next',
        'B',
    ]
    assert lines[-1] == 'shared  ! ended: simulator'


def test_a_viewer_gets_all_of_one_robot_and_a_glance_of_the_others() -> None:
    broadcaster = Broadcaster()
    for name, state in FLEET.items():
        broadcaster.show(state, name)

    async def look() -> tuple[Any, Any, Any]:
        first = broadcaster.stream('bert')
        usual = broadcaster.stream()
        read: list[Any] = []
        for stream in (first, usual):
            await anext(stream)
            read.append(json.loads((await anext(stream)).removeprefix('data: ')))
        broadcaster.show(FLEET['anna'].having(battery=79.0), 'anna')
        read.append(json.loads((await anext(first)).removeprefix('data: ')))
        return read[0], read[1], read[2]

    bert, usual, later = asyncio.run(look())
    assert (bert['robot'], usual['robot']) == ('bert', 'anna'), 'the first one, unless asked for'
    assert 'grid' in bert['p']
    assert bert['r'].keys() == {'', 'anna', 'carl'}
    assert bert['r']['anna']['pose'] == [1.0, 1.0, 0.0]
    assert 'grid' not in bert['r']['anna']
    assert ['anna begins' in each for each in bert['p']['events']].count(True) == 1
    assert [each[1:] for each in bert['p']['events']].count(['', 'door D closed']) == 1
    assert (later['p'], later['r']) == ({}, {'anna': {'brief': 'battery 79 %'}})


def test_a_viewer_of_a_robot_that_is_shown_no_longer_sees_another_one_whole() -> None:
    broadcaster = Broadcaster()
    for name, state in FLEET.items():
        broadcaster.show(state, name)

    async def look() -> list[Any]:
        stream = broadcaster.stream('bert')
        await anext(stream)
        read = []
        for leaves in ('nobody', 'bert', 'carl'):
            read.append(json.loads((await anext(stream)).removeprefix('data: ')))
            broadcaster.forget(leaves)
            if leaves == 'nobody':
                broadcaster.show(FLEET['anna'].having(battery=70.0), 'anna')
        return [*read, json.loads((await anext(stream)).removeprefix('data: '))]

    whole, same, other, last = asyncio.run(look())
    assert [(each['robot'], each['whole']) for each in (whole, same, other, last)] == [
        ('bert', 1),
        ('bert', 0),
        ('anna', 1),
        ('anna', 1),
    ], 'what is not told again is not known'
    assert 'grid' not in same['p']
    assert 'grid' in other['p']
    assert other['r'].keys() == {'', 'carl'}
    assert last['r'].keys() == {''}
    began = [each[1] for each in last['p']['events'] if each[2].endswith('begins')]
    assert began == ['anna'], 'nobody else is in the time line of all'


# --- among nodes ---


class Robot:
    """What others see of one robot.

    Args:
        graph: Where it lives.
        name: Its namespace.
        answers: What it says when it is stopped; None: it does not answer.
    """

    def __init__(self, graph: Any, name: str, answers: bool = True) -> None:
        self.node = graph.add(PatrolNode, name='robot_behavior', namespace=name)
        self.told: list[Any] = []
        status = MissionStatus(machine='surveillance', state='MOVE', place=f'place_of_{name}')
        pose = PoseWithCovarianceStamped()
        pose.pose.pose.position.x, pose.pose.pose.orientation.w = float(len(name)), 1.0
        self._publishers = [
            self.say('mission_status', status),
            self.say('amcl_pose', pose),
            self.say('battery_level', UInt8(data=10 * len(name))),
        ]
        fleet = self.node.create_publisher(FleetRobot, '/fleet_robots', QoSProfile(depth=10))
        word = FleetRobot(robot=name, place='A', tour=['A', name], stop=name, runs_until=9.0)
        self.node.create_timer(0.05, lambda: fleet.publish(word))
        self.node.create_service(SetBool, 'stop', self._obey if answers else self._refuse)
        self.node.create_service(SetBool, 'take_out', self._obey)
        self.node.create_service(Trigger, 'robot_behavior/fsm/pause', self._obey)

    def say(self, topic: str, message: Any) -> Any:
        publisher = self.node.create_publisher(type(message), topic, STATE_QOS)
        publisher.publish(message)
        return publisher

    def _obey(self, request: Any, response: Any) -> Any:
        self.told.append(getattr(request, 'data', 'pause'))
        response.success, response.message = True, 'done'
        return response

    def _refuse(self, _request: Any, response: Any) -> Any:
        response.success, response.message = False, 'no'
        return response


@pytest.fixture(autouse=True)
def _look_often(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (node_graph_watch, fleet_subscriber):
        monkeypatch.setattr(module, 'LOOK_PERIOD', 0.05)


def test_robots_are_found_and_told_apart_and_share_the_place(graph: Any) -> None:
    watcher = graph.add(PatrolNode, name='mission_page')
    heard: list[tuple[str, str]] = []
    feed = FleetSubscriber(
        watcher, 0.02, lambda name, _new, told: heard.extend((name, each.text) for each in told)
    )
    assert feed.robots == ('',), 'one that is alone has no name'
    robots = {name: Robot(graph, name) for name in ('anna', 'bertha')}
    doors = graph.node.create_publisher(DoorStates, 'door_states', STATE_QOS)
    doors.publish(DoorStates(closed=['D']))
    reports = graph.node.create_publisher(DiagnosticArray, '/diagnostics', 10)
    graph.until(lambda: feed.robots == ('anna', 'bertha'))

    def known() -> bool:
        names = ('anna/motion_controller', 'bertha/motion_controller', 'armor_server')
        reports.publish(DiagnosticArray(status=[DiagnosticStatus(name=name) for name in names]))
        seen = [feed.state(name) for name in robots]
        return all(
            each.task.status
            and each.sensors.pose
            and each.task.battery
            and each.task.share
            and each.place.doors
            and each.health.reports
            for each in seen
        )

    graph.until(known)
    anna, bertha = (feed.state(name) for name in robots)
    assert anna.task.status is not None
    assert bertha.task.status is not None
    assert (anna.task.status.place, bertha.task.status.place) == (
        'place_of_anna',
        'place_of_bertha',
    )
    assert (anna.task.battery, bertha.task.battery) == (40.0, 60.0)
    assert anna.task.share == PatrolShare(('A', 'anna'), 'anna', runs_until=9.0)
    assert anna.place.doors == bertha.place.doors == {'D': False}
    assert anna.health.reports.keys() == {'anna/motion_controller', 'armor_server'}
    assert list(feed.see()) == ['anna', 'bertha', ''], 'what they share is last'
    topics = ('/diagnostics', watcher.resolve_topic_name('fleet_robots'), '/clock')
    heard_by = [len(watcher.get_subscriptions_info_by_topic(topic)) for topic in topics]
    assert heard_by == [1, 1, 1], 'who watches many robots hears each of them once'
    graph.until(lambda: 'robot_behavior' in feed.state('anna').health.nodes)
    # A program of one that ends is not one of the other.
    graph.remove(robots['anna'].node)
    graph.until(lambda: 'robot_behavior' in feed.state('anna').health.ended)
    assert 'robot_behavior' in feed.state('bertha').health.nodes
    assert ('anna', 'every node has ended: waiting for the next mission') in heard
    assert 'anna' in feed.robots, 'a robot that is gone is missed'


def test_a_robot_whose_behaviour_is_down_is_found_and_stopped_with_the_others(graph: Any) -> None:
    feed = FleetSubscriber(graph.add(PatrolNode, name='hands'), 0.02)
    Robot(graph, 'anna')
    monitor = graph.add(PatrolNode, name='collision_monitor', namespace='/bert')
    monitor.create_subscription(String, '/place', lambda _: None, STATE_QOS)
    stopped: list[bool] = []

    def stop(request: Any, response: Any) -> Any:
        stopped.append(request.data)
        response.success = True
        return response

    monitor.create_service(SetBool, 'stop', stop)
    graph.until(lambda: feed.robots == ('anna', 'bert'))
    FleetActions(graph.add(PatrolNode, name='keys'), lambda: feed.robots, 60.0).told(
        'all', WORDS['stop'][1]
    )
    assert stopped == [True]


def test_a_word_is_for_one_robot_or_for_all_whatever_becomes_of_one(graph: Any) -> None:
    robots = {name: Robot(graph, name, answers=name != 'bert') for name in ('anna', 'bert')}
    names = tuple(robots)
    actions = FleetActions(graph.add(PatrolNode, name='hands'), lambda: names, timeout=60.0)
    assert actions.told('anna', WORDS['stop'][1]) == 'done'
    assert (robots['anna'].told, robots['bert'].told) == ([True], [])
    with pytest.raises(CallError, match=r'anna: done; bert: no'):
        actions.told('all', WORDS['release'][1])
    assert robots['anna'].told == [True, False]
    assert actions.told('all', WORDS['out'][1]) == 'anna: done; bert: done'
    assert actions.told('bert', WORDS['pause'][1]) == 'done'
    assert robots['bert'].told == [True, 'pause']
    with pytest.raises(ValueError, match="no robot 'ana': expected 'anna'"):
        actions.told('ana', WORDS['stop'][1])


def test_taking_out_a_robot_that_is_alone_is_one_line(graph: Any) -> None:
    alone = FleetActions(graph.add(PatrolNode, name='hands'), lambda: ('',), timeout=0.1)
    with pytest.raises(CallError, match='robot_behavior is not running'):
        alone.told('all', WORDS['out'][1])


def picture(**fields: Any) -> str:
    file = io.StringIO()
    console = Console(file=file, width=100, height=34)
    console.print(MissionView(FLEET['anna'], whole=False, fleet=FLEET, robot='anna', **fields))
    return file.getvalue()


def test_the_terminal_shows_the_robots_and_the_one_that_was_chosen() -> None:
    shown = picture()
    assert shown.splitlines()[0].startswith(' anna · surveillance')
    for line in ('1 anna A on its way to B', '2 bert A on its way to B', 'B is for anna'):
        assert line in shown
    on_map = [line[:50] for line in shown.splitlines()]
    assert all(any(name in line for line in on_map) for name in ('bert', 'carl'))
    assert shown.count('door D closed') == 1
    assert 'anna begins' in picture(page='events')
    assert 'bert begins' in picture(page='events')
    assert 'shares A, B, next B' in picture(page='robots')
    for width in range(40, 120, 7):
        file = io.StringIO()
        view = MissionView(FLEET['bert'], fleet=FLEET, robot='bert')
        Console(file=file, width=width, height=20).print(view)
        assert max(map(len, file.getvalue().splitlines())) <= width


def test_a_picture_is_of_the_robot_that_was_named_or_there_is_none() -> None:
    file, goes_on = io.StringIO(), Interrupt()
    console = Console(file=file, width=100, height=34)
    assert not show_once(lambda: FLEET, goes_on, console, 0.0, 'brt')
    assert file.getvalue() == ''
    goes_on.set()
    assert show_once(lambda: FLEET, goes_on, console, 0.0, 'bert')
    assert file.getvalue().startswith(' bert · surveillance')


@pytest.fixture
def fleet_run(tmp_path: Path) -> Path:
    """Return what a run of two robots left, of which one began later."""
    folder = tmp_path / '20260101-000000'
    folder.mkdir()
    (folder / 'place.yaml').write_text((ROOT / 'config' / 'seven_rooms.yaml').read_text())
    for name, begin, place in (('anna', 0.0, 'R1'), ('bert', 50.0, 'R2')):
        own = folder / name
        own.mkdir()
        writer = TimelineWriter(own / 'timeline.jsonl')
        for second in range(30):
            at = 1000.0 + begin + second
            state = FLEET[name].having(
                now=at, pose=(float(second), 1.0, 0.0), decision_number=second
            )
            writer.add(state, at)
        writer.close()
        with MissionRecord(own / 'events.jsonl') as record:
            places = ['C1', 'R1', 'R2']
            record.write('start', begin, machine='surveillance', places=places, place='C1')
            for n in range(3):
                reason = f'{place} is for {name}'
                at = begin + 20.0 * n
                record.write('decision', at, place=place, rule='URGENT', reason=reason)
                record.write('visit', begin + 20.0 * n + 5.0, place=place, distance=3.0)
    return folder


def test_the_report_of_a_fleet_has_all_robots_and_leads_to_each(fleet_run: Path) -> None:
    text = write_report(fleet_run).read_text()
    assert 'href="anna/report.html"' in text
    assert (fleet_run / 'bert' / 'report.html').is_file()
    assert 'bert 3' in text
    assert text.count('<img class="map"') == 1
    assert draw_picture(fleet_run) == fleet_run / 'report.png'
    lines = text[text.index('What happened') :]
    assert lines.index('R2 is for bert') > lines.index('R1 is for anna')
    found = find_recordings(str(fleet_run), fleet_run.parent)
    assert list(found) == ['anna', 'bert']
    assert list(find_recordings('last', fleet_run.parent)) == ['anna', 'bert']


def test_a_fleet_is_replayed_in_one_time(fleet_run: Path) -> None:
    broadcaster = Broadcaster()
    with contextlib.ExitStack() as stack:
        player = open_player(find_recordings(str(fleet_run), fleet_run.parent), broadcaster, stack)
        assert player.length == 79.0, 'from the first one that begins to the last one that ends'
        player.seek(60.0)

        async def look() -> Any:
            stream = broadcaster.stream('bert')
            await anext(stream)
            return json.loads((await anext(stream)).removeprefix('data: '))

        seen = asyncio.run(look())
        assert seen['p']['pose'] == [10.0, 1.0, 0.0]
        assert seen['r']['anna']['pose'] == [29.0, 1.0, 0.0]
        assert seen['p']['replay']['at'] == 60.0
        assert ['anna', 'anna begins'] in [each[1:] for each in seen['p']['events']]


def test_one_damaged_recording_costs_a_line_and_the_others_are_played(
    fleet_run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (fleet_run / 'bert' / 'timeline.jsonl').write_text('garbage\n')
    found = find_recordings(str(fleet_run), fleet_run.parent)
    with contextlib.ExitStack() as stack:
        assert open_player(found, Broadcaster(), stack).length == 29.0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith('bert/timeline.jsonl: holds nothing to replay: it is left out')
    (fleet_run / 'anna' / 'timeline.jsonl').write_text('')
    with contextlib.ExitStack() as stack, pytest.raises(FileError, match='anna/timeline'):
        open_player(found, Broadcaster(), stack)


def test_a_robot_that_left_nothing_is_named_in_the_report(fleet_run: Path) -> None:
    bert = fleet_run / 'bert'
    (bert / 'place.yaml').write_text((fleet_run / 'place.yaml').read_text())
    for name in ('events.jsonl', 'timeline.jsonl'):
        (bert / name).unlink()
    text = write_report(fleet_run).read_text()
    assert '2 robots' in text
    assert '<p class="late">bert: cannot read the mission record' in text
    assert list(find_recordings(str(fleet_run), fleet_run.parent)) == ['anna']
    shutil.rmtree(bert)
    assert ', 1 robot</h1>' in write_report(fleet_run).read_text()


def test_rviz_shows_each_robot_in_a_group_of_its_own() -> None:
    text = (ROOT / 'config' / 'mission.rviz').read_text()
    layout = yaml.safe_load(fleet_layout(text, ['bert', 'anna'], 'house'))
    displays = layout['Visualization Manager']['Displays']
    assert displays[0]['Topic']['Value'] == '/house/map'
    assert [each['Name'] for each in displays[1:]] == ['anna', 'bert']
    planned = {
        group['Name']: next(each for each in group['Displays'] if each['Name'] == 'Planned')
        for group in displays[1:]
    }
    assert planned['anna']['Topic']['Value'] == '/house/anna/plan'
    assert planned['anna']['Color'] != planned['bert']['Color']
    hidden = [
        [each.get('Namespaces') for each in group['Displays'] if each['Class'].endswith('Array')]
        for group in displays[1:]
    ]
    off = {'places': False, 'names': False, 'doors': False}
    assert off not in hidden[0], 'the first one shows the place, once'
    assert hidden[1] == [off] * len(hidden[0]) != []
    (name,) = [each for each in markers_of(FLEET['anna'], Time()).markers if each.ns == 'robots']
    assert name.text == 'anna'


def test_the_console_commands_no_other_robot_than_the_one_that_was_named(
    graph: Any, capfd: Any
) -> None:
    anna = Robot(graph, 'anna')
    receiver, sender = os.pipe()
    with os.fdopen(receiver) as source:
        given = {'robot': 'ana', 'peer_timeout': 3.0}
        console = graph.add(ConsoleNode, given, console_source=source)

        def is_heard() -> bool:
            try:
                return 'anna' in ''.join(console.lines())
            except ValueError:  # it is alone yet
                return False

        graph.until(is_heard)
        with os.fdopen(sender, 'w') as keyboard:
            keyboard.write('stop\nrobot anna\nstop\n')
        assert console.ended.wait(60.0)
    assert "robot 'ana' is not heard: expected anna" in capfd.readouterr().out
    assert anna.told == [True], 'told once, by its own name'


def test_a_robot_that_joins_takes_no_commands_from_the_one_that_is_spoken_to(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    receiver, sender = os.pipe()
    with os.fdopen(receiver) as source, os.fdopen(sender, 'w'):
        console = graph.add(ConsoleNode, console_source=source)
        known = SimpleNamespace(robots=('bert',))
        monkeypatch.setattr(console, '_subscriber', known)
        console._actions_for('stop')
        known.robots = ('anna', 'bert')
        assert console.robot == 'bert'
        monkeypatch.undo()
        graph.remove(console)


@pytest.mark.parametrize('name', ['rob ot', '', 'röbot', 'a' * 61, 'simulator', 'a/b'])
def test_the_command_fleet_says_in_one_line_that_a_name_is_none(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        fleet_command.main(['stop', name])
    assert ended.value.code == 2
    assert 'expected' in capsys.readouterr().err


def test_the_console_speaks_to_one_robot_or_to_all() -> None:
    def told(line: str) -> str:
        actions: Any = None
        (said,) = answer(line, actions, Prompt())
        return said.text

    assert told('robots') == 'anna\nbert'
    assert told('robot bert') == 'you speak to bert'
    assert told('all stop') == 'all stop'
    assert told('all sto') == "all: 'sto': expected 'stop'"
    assert completions('all p') == ['pause']


# --- in a real browser ---


@pytest.fixture(scope='module')
def told() -> list[tuple[str, str]]:
    return []


@pytest.fixture(scope='module')
def broadcaster() -> Broadcaster:
    return Broadcaster()


@pytest.fixture(scope='module')
def viewer(broadcaster: Broadcaster, told: list[tuple[str, str]]) -> Iterator[Viewer]:
    if not (CHROMIUM and DRIVER):
        pytest.skip(MISSING)

    def fleet(word: str, robot: str) -> str:
        told.append((word, robot))
        return f'{word} {robot}'

    def stop(on: bool, robot: str = '') -> str:
        return fleet('stop' if on else 'release', robot)

    page = Page(broadcaster, questions={}, actions={'fleet': fleet, 'stop': stop}, port=0)
    page.start()
    for name, state in FLEET.items():
        broadcaster.show(state, name)
    viewer = Viewer(page.address)
    yield viewer
    viewer.close()
    page.stop()


def test_the_page_shows_all_robots_and_one_of_them_whole(
    broadcaster: Broadcaster, viewer: Viewer
) -> None:
    viewer.until(lambda: viewer.count('[data-row]') == 4)
    assert viewer.text('#title').startswith('anna')
    assert viewer.text('[data-row=bert] .doing') == (
        'A · on its way to B · battery 80 % · shares A, B, next B'
    )
    assert 'B is for carl' in viewer.text('[data-row=carl] .note')
    assert viewer.count('#map [data-robot]') == 3
    looks = 'return [...document.querySelectorAll("#map [data-robot] path")].map('
    looks += '(each) => getComputedStyle(each).fill)'
    assert len(set(viewer.js(looks))) == 3, 'each has a colour of its own'
    assert viewer.count('#map .plan.other[d^=M]') == 2
    assert viewer.js('return document.getElementById("stop").textContent') == 'STOP anna'
    viewer.click('[data-choose=bert]')
    viewer.until(lambda: viewer.text('#title').startswith('bert'))
    assert viewer.text('#reason') == 'B is for bert'
    assert viewer.attribute('[data-choose=bert]', 'aria-pressed') == 'true'
    assert 'robot=bert' in viewer.driver.current_url
    broadcaster.show(FLEET['carl'].having(pose=(4.0, 1.0, 0.0)), 'carl')
    viewer.until(lambda: '4px' in viewer.attribute('#map [data-robot=carl]', 'style'))


def test_alarms_name_the_robot_and_one_time_line_has_the_events_of_all(
    broadcaster: Broadcaster, viewer: Viewer
) -> None:
    status = FLEET['carl'].task.status
    assert status is not None
    help_needed = replace(status, waiting_for_help=True, text='shut in')
    events = (*FLEET['carl'].notices, Notice('battery low', at=1e9 + 9.0))
    broadcaster.show(FLEET['carl'].having(status=help_needed, notices=events), 'carl')
    viewer.until(lambda: viewer.text('#alarms') == 'carl: waits for help: shut in')
    viewer.until(lambda: 'battery low' in viewer.text('#events li'))
    assert viewer.text('#events li b') == 'carl'
    assert viewer.text('#events').count('door D closed') == 1
    broadcaster.show(FLEET['carl'], 'carl')
    viewer.until(lambda: viewer.js('return document.getElementById("alarms").hidden'))


def test_one_robot_or_all_are_told(
    broadcaster: Broadcaster, viewer: Viewer, told: list[tuple[str, str]]
) -> None:
    viewer.until(lambda: viewer.count('[data-row]') == 4)
    for selector in (
        '[data-row=carl] [data-word=out]',
        '[data-row=bert] [data-word=pause]',
        '[data-all=go]',
        '#stop-all',
        '[data-row=anna] [data-word=stop]',
    ):
        count = len(told)
        viewer.click(selector)
        viewer.until(lambda count=count: len(told) > count)
    assert viewer.text('#stop-answer') == '✓ stop all', 'said where STOP ALL was pressed'
    assert told[-5:] == [
        ('out', 'carl'),
        ('pause', 'bert'),
        ('go', 'all'),
        ('stop', 'all'),
        ('stop', 'anna'),
    ]
    viewer.until(lambda: viewer.text('#fleet-answer') == '✓ stop anna')
    broadcaster.show(FLEET['anna'].having(stopped=True, share=PatrolShare(taken_out=True)), 'anna')
    words = 'return [...document.querySelectorAll("[data-row=anna] [data-word]")]'
    words += '.filter((each) => !each.hidden).map((each) => each.dataset.word)'
    viewer.until(lambda: viewer.js(words) == ['pause', 'release', 'in'])
    broadcaster.show(FLEET['anna'], 'anna')
    viewer.click('[data-choose=anna]')
    viewer.until(lambda: viewer.text('#title').startswith('anna'))
    viewer.click('#stop')
    viewer.until(lambda: told[-1] == ('stop', 'anna'))


def test_a_fleet_is_readable_everywhere(viewer: Viewer) -> None:
    for size, dark in ((PHONE, True), (DESK, False)):
        viewer.size(*size, dark=dark)
        assert viewer.js('return document.documentElement.scrollWidth') <= size[0]
        assert viewer.axe() == []
    severe = [each for each in viewer.driver.get_log('browser') if each['level'] == 'SEVERE']
    assert severe == []
