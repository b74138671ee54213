#!/usr/bin/env python3
"""The patrol driven by Nav2 beside the patrol driven by this project: same robot, same place.

    .venv/bin/python benchmarks/nav2/drives.py [--quick] [--minutes 20] [--rounds 1] [--in-turn]
        [--sides nav2,own] [--faults door,person,kidnap,slip,lidar] [--place FILE] [--physics]
        [--faults late,inactive,kill,goal,planner,box,pose,lost,map]
        [--namespace robot1] [--tf-only] [--zones] [--docking] [--controller rpp|mppi]
        [--no-monitor] [--nav2 PREFIX[:PREFIX]] [--params nav2_params.yaml]

Needs Nav2 for Jazzy: `sudo apt install ros-jazzy-navigation2 ros-jazzy-nav2-bringup`, or what
`benchmarks/nav2/build.sh` builds, and its messages (`python3 launch.py setup --with nav2`). Each
side has a robot of its own, which speaks as a foreign one (`foreign_robot.py`), in a ROS domain of
its own. The sides drive at the same time, so that they have the same machine, or in turn.

Faults happen one after the other in one mission. A visit counts where the robot really is in the
place; a fault is recovered from when there were two such visits after it began. How long that
takes depends on where the next places are; so what the robot did meanwhile is told, too.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from nav2.stack import Nav2Stack, built_here, children_of, prefixes, usage
from sizes import sized_parser, skip

from floor_plans import read_place
from floor_plans.filter_masks import write_filter_masks
from floor_plans.occupancy_map import write_map
from surveillance_runtime.profile import read_profile
from surveillance_runtime.testing import claim_domain
from surveillance_simulation.world.simulated_place import read_simulated_place

CHECKOUT = Path(__file__).resolve().parents[2]
NAVIGATION = ('motion_controller', 'planner_controller', 'collision_monitor')
"""Our nodes that do what Nav2 does. A process counts whole that runs one of them."""
SPEED = 0.5
"""Full speed of both, m/s."""
STANDS = 0.02
"""It drives when it is faster, m/s; a turn on the spot is no drive."""
PATIENCE = 300.0
"""A mission that makes no two visits in this time after a fault is lost, seconds."""
DOOR_CLOSED = 60.0
"""Seconds for which a door stays closed, if nothing is visited meanwhile."""
PROFILE = """\
name: foreign
topics: {command: cmd_vel, wanted: cmd_vel_wanted, odom: odom, scans: [scan], map: map}
types: {command: TwistStamped}
frames: {base: base_footprint, scans: [base_scan]}
body: {radius: 0.22}
drive:
  {speed: 0.5, turn: 1.0, acceleration: 0.5, deceleration: 2.5, turn_acceleration: 2.0,
  command_timeout: 0.5}
battery: {source: model}
dock: {navigator: NAVIGATOR, docking: DOCKING}
arm: none
"""

ZONES = """\
    keep_out_zones:
      stairs: [8.5, 8.6, 9.5, 8.6, 9.5, 10.0, 8.5, 10.0]
    slow_zones:
      shop: [0.25, 7.0, 10.0, 12.5, 10.0, 12.5, 14.5, 7.0, 14.5]
"""
"""In the corridors of the seven rooms, where the robot passes often."""


class Side:
    """One side: a robot, who drives it, and the patrol.

    Args:
        name: nav2 or own.
        options: Of the command line.
        folder: For its files.
        domain: ROS domain.
    """

    def __init__(self, name: str, options: Any, folder: Path, domain: int) -> None:
        self.name, self.folder, self._domain = name, folder, domain
        self.options = options
        self.world = read_simulated_place(options.place)
        folder.mkdir(parents=True)
        self._profile = folder / 'robot.yaml'
        docking = 'opennav' if options.docking else 'none'
        text = PROFILE.replace('NAVIGATOR', name).replace('DOCKING', docking)
        self._profile.write_text(text)
        self._trace = folder / 'trace.jsonl'
        self.environ = {**os.environ, 'ROS_DOMAIN_ID': str(domain)}
        self.environ |= {'XDG_STATE_HOME': str(folder / 'state')}
        self.space = f'/{options.namespace}' if options.namespace else ''
        self.stack: Nav2Stack | None = None
        self._robot: subprocess.Popen[bytes] | None = None
        self._patrol: subprocess.Popen[bytes] | None = None
        self._before: dict[str, dict[int, tuple[float, float]]] = {}
        self.began = time.time()

    def start_robot(self) -> None:
        """Start the robot, and wait until it tells where it is."""
        words = [sys.executable, str(Path(__file__).with_name('foreign_robot.py'))]
        words += [str(self.options.place), str(self._trace)]
        words += ['--map'] * (self.name == 'own') + ['--tf-only'] * self.options.tf_only
        words += ['--physics'] * self.options.physics + ['--dock'] * self.options.docking
        if self.space:
            words += ['--ros-args', '-r', f'__ns:={self.space}']
        self._robot = self._started(words, 'robot.log')
        self.wait_for(lambda: self._trace.exists() and len(self.trace()) > 2, 60.0)

    def start_nav2(self) -> None:
        """Start Nav2 with the place's map, and tell it where the robot is, as a person does."""
        picture = self.write_map('map.yaml', self.options.place)
        profile = read_profile(self._profile).profile
        self.stack = Nav2Stack(self.options, profile, picture, self.folder, self._domain)
        self.stack.start()
        self.set_pose_when_up()

    def write_map(self, name: str, place: Path) -> Path:
        """Write a place's map in map_server's format."""
        plan = read_place(place).plan
        assert plan is not None
        grid = plan.grid()
        picture = self.folder / name
        write_map(picture, grid.cells[::-1], grid.resolution, (*grid.origin, 0.0))
        return picture

    def set_pose_when_up(self) -> None:
        """Say where the robot is as soon as AMCL listens; a goal in the first seconds after that
        is aborted.

        On a busy machine Nav2's lifecycle manager gives up while it starts: it is started again.
        """
        assert self.stack is not None
        for _ in range(3):
            if self.wait_for(self.stack.localizes, 40.0) is not None:
                # The planner's costmap waits for the pose while it is activated.
                self.set_pose()
                if self.wait_for(self.stack.is_active, 60.0) is not None:
                    break
            self.stack.stop()
            self.stack.start()
        time.sleep(4.0)

    def start_patrol(self) -> None:
        """Start the mission."""
        words = [sys.executable, str(CHECKOUT / 'launch.py'), '--mode', 'ROBOT']
        words += ['--robot', str(self._profile), '--map', str(self.options.place)]
        words += ['--record', str(self.folder / 'runs'), '--domain', str(self._domain)]
        words += ['--namespace', self.options.namespace] * bool(self.space)
        self._patrol = self._started(words, 'patrol.log')

    def start_all(self) -> None:
        """Start robot, Nav2 and patrol."""
        self.start_robot()
        if self.name == 'nav2':
            self.start_nav2()
        self.start_patrol()

    def _started(self, words: list[str], log: str) -> subprocess.Popen[bytes]:
        with (self.folder / log).open('ab') as file:
            return subprocess.Popen(
                words,
                env=self.environ,
                cwd=CHECKOUT,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def wait_for(self, is_so: Callable[[], Any], seconds: float) -> float | None:
        """Wait until something is so; return the seconds that took, None: it did not come."""
        begun = time.monotonic()
        while time.monotonic() - begun < seconds:
            if is_so():
                return time.monotonic() - begun
            time.sleep(0.2)
        return None

    def trace(self) -> list[dict[str, Any]]:
        """Return where the robot was, each 0.2 s."""
        return list(lines_of(self._trace))

    @property
    def pose(self) -> tuple[float, float, float]:
        """Where the robot really is."""
        x, y, yaw = last_line(self._trace)['pose']
        return x, y, yaw

    def events(self, name: str, since: float = 0.0) -> list[dict[str, Any]]:
        """Return what the mission recorded so far under a name."""
        found: list[dict[str, Any]] = []
        for file in sorted((self.folder / 'runs').glob('**/events.jsonl')):
            found += (each for each in lines_of(file) if each.get('event') == name)
        return [each for each in found if each['at'] >= since]

    def visits(self, since: float = 0.0) -> list[dict[str, Any]]:
        """Return the visits at which the robot really was in the place."""
        trace, found = self.trace(), []
        for event in self.events('visit', since):
            near = [each for each in trace if -1.5 < each['at'] - event['at'] < 0.5]
            if any(self.world.place_at(*each['pose'][:2]) == event['place'] for each in near):
                found.append({**event, 'pose': near[-1]['pose']})
        return found

    def _pids(self) -> dict[str, set[int]]:
        ours: set[int] = set()
        if self._patrol is not None:
            for nodes, pid in children_of(self._patrol.pid):
                if set(nodes) & set(NAVIGATION):
                    ours.add(pid)
        if self.stack is None:
            return {'navigation': ours}
        theirs = {each.pid for each in self.stack.processes.values()}
        return {'navigation': theirs, 'beside it': ours}

    def begin(self) -> None:
        """Begin to count."""
        self._before = {kind: usage(pids) for kind, pids in self._pids().items()}
        self.began = time.time()

    def figures(self) -> dict[str, float]:
        """Return what there is since `begin`."""
        passed = time.time() - self.began
        found: dict[str, float] = {'minutes': passed / 60}
        for kind, pids in self._pids().items():
            now = usage(pids)
            before = self._before.get(kind, {})
            used = sum(each[0] - before.get(pid, (0.0, 0.0))[0] for pid, each in now.items())
            found |= {
                f'CPU of {kind}, s': used,
                f'CPU of {kind}, % of a core': 100 * used / passed,
                f'PSS of {kind}, MB': sum(each[1] for each in now.values()),
            }
        trace = [each for each in self.trace() if each['at'] >= self.began]
        visits = self.visits(self.began)
        told = self.events('visit', self.began)
        ways = list(pairwise(visits))
        straight = sum(math.dist(a['pose'][:2], b['pose'][:2]) for a, b in ways) / SPEED
        zones = self.world.plan.zones
        if zones.keep_out:
            barred = sum(zones.barred(each['pose']) is not None for each in trace)
            found['lines of the trace kept out of'] = barred
        for zone in zones.slow.values():
            speeds = sorted(e['speed'] for e in trace if zone.contains(e['pose'][:2])[0])
            if speeds:
                found[f'95 % in {zone.speed} m/s, m/s'] = speeds[len(speeds) * 95 // 100]
        wrong = [
            math.dist(each['pose'][:2], each['believed'][:2]) for each in trace if each['believed']
        ]
        return {
            **found,
            'arrivals': len(visits),
            'false arrivals': len(told) - len(visits),
            'failures': len(self.events('failure', self.began)),
            'doubts of the pose': sum(
                'does not fit' in each['text']
                for each in self.events('incident', self.began)
                if each['phase'] == 'begin'
            ),
            'contacts': trace[-1]['contacts'] - trace[0]['contacts'],
            'way, m': trace[-1]['way'] - trace[0]['way'],
            'time over the straight line': sum(b['at'] - a['at'] for a, b in ways) / straight
            if straight
            else math.nan,
            'pose wrong by, median, m': sorted(wrong)[len(wrong) // 2] if wrong else math.nan,
        }

    def asked(self, script: str, **values: Any) -> None:
        """Run a few lines of rclpy in the side's domain: what a person does."""
        begun = 'import rclpy\nrclpy.init()\n'
        for name, value in {**values, 'space': self.space}.items():
            begun += f'{name} = {value!r}\n'
        begun += 'node = rclpy.create_node("person", namespace=space)\n'
        words = [sys.executable, '-c', begun + script]
        with (self.folder / 'person.log').open('ab') as log:
            subprocess.run(
                words,
                env=self.environ,
                timeout=120.0,
                check=False,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )

    def stage(self, **staged: Any) -> None:
        """Have things happen to the robot."""
        self.asked(STAGE, staged=staged)

    def set_pose(self, pose: Any = None) -> None:
        """Tell where the robot is, as RViz does; None: where it really is by then."""
        told = None if pose is None else tuple(map(float, pose))
        self.asked(SET_POSE, pose=told, trace=str(self._trace))

    def stop(self) -> None:
        """End all."""
        for process in (self._patrol, self._robot):
            if process is not None and process.poll() is None:
                process.send_signal(signal.SIGINT)
                try:
                    process.wait(30.0)
                except subprocess.TimeoutExpired:
                    os.killpg(process.pid, signal.SIGKILL)
        if self.stack is not None:
            self.stack.stop()


def lines_of(file: Path) -> Iterator[dict[str, Any]]:
    """Yield the whole lines of a file of JSON lines."""
    for line in file.read_text(errors='replace').splitlines():
        try:
            yield json.loads(line)
        except ValueError:
            continue


def last_line(file: Path) -> dict[str, Any]:
    """Return the last whole line of a file of JSON lines."""
    with file.open('rb') as opened:
        opened.seek(max(0, file.stat().st_size - 4000))
        for line in reversed(opened.read().splitlines()):
            try:
                found = json.loads(line)
            except ValueError:
                continue
            if isinstance(found, dict):
                return found
    raise ValueError(file)


STAGE = """
import json
from std_msgs.msg import String
from surveillance_runtime.qos import STATE_QOS
publisher = node.create_publisher(String, 'stage', STATE_QOS)
while not publisher.get_subscription_count():
    rclpy.spin_once(node, timeout_sec=0.1)
for name, value in staged.items():
    publisher.publish(String(data=json.dumps({name: value})))
publisher.wait_for_all_acked()
"""
CALL = """
from importlib import import_module
package, _, kind = type_name.partition('/')
service = getattr(import_module(f'{package}.srv'), kind)
client = node.create_client(service, name)
client.wait_for_service(10.0)
request = service.Request()
for path, value in fields.items():
    *outer, last = path.split('.')
    at = request
    for each in outer:
        at = getattr(at, each)
    setattr(at, last, value)
future = client.call_async(request)
rclpy.spin_until_future_complete(node, future, timeout_sec=60.0)
print(name, future.result())
"""
SEND_GOAL = """
from geometry_msgs.msg import PoseStamped
from nav2_msgs.action import NavigateThroughPoses
from rclpy.action import ActionClient
client = ActionClient(node, NavigateThroughPoses, 'navigate_through_poses')
client.wait_for_server(10.0)
pose = PoseStamped()
pose.header.frame_id = 'map'
pose.pose.position.x, pose.pose.position.y, pose.pose.orientation.w = *point, 1.0
future = client.send_goal_async(NavigateThroughPoses.Goal(poses=[pose, pose]))
rclpy.spin_until_future_complete(node, future, timeout_sec=20.0)
if future.done() and future.result().accepted:
    rclpy.spin_until_future_complete(node, future.result().get_result_async(), timeout_sec=60.0)
"""
SET_POSE = """
import json
from geometry_msgs.msg import PoseWithCovarianceStamped
from surveillance_runtime.conversions import pose_estimate
publisher = node.create_publisher(PoseWithCovarianceStamped, 'initialpose', 1)
while not publisher.get_subscription_count():
    rclpy.spin_once(node, timeout_sec=0.1)
if pose is None:
    with open(trace, 'rb') as opened:
        pose = json.loads(opened.read().splitlines()[-2])['pose']
message = PoseWithCovarianceStamped(pose=pose_estimate(pose, 0.3, 0.2))
message.header.frame_id = 'map'
message.header.stamp = node.get_clock().now().to_msg()
publisher.publish(message)
rclpy.spin_once(node, timeout_sec=1.0)
"""


def far_place(side: Side) -> tuple[float, float, float]:
    """Return the middle of the place that is farthest from where the robot is."""
    x, y, _ = side.pose
    middles = side.world.plan.place.positions.values()
    found = max(middles, key=lambda at: math.dist(at[:2], (x, y)))
    return float(found[0]), float(found[1]), 0.0


def fault_door(side: Side) -> None:
    """Close a door before the robot when it comes to it; open it when it has gone elsewhere."""
    doors = {}
    for name, door in side.world.plan.doors.items():
        x1, y1, x2, y2 = door.segment
        doors[name] = (x1 + x2) / 2, (y1 + y2) / 2

    def ahead() -> str:
        told = last_line(side._trace)
        x, y, yaw = told['pose']
        for name, (door_x, door_y) in doors.items():
            bearing = math.atan2(door_y - y, door_x - x) - yaw
            off = abs(math.remainder(bearing, math.tau))
            if off < 0.5 and 0.8 < math.hypot(door_x - x, door_y - y) < 2.2 and told['speed'] > 0.2:
                return name
        return ''

    if side.wait_for(ahead, 120.0) is None:
        raise TimeoutError('no door came near')
    name = ahead() or next(iter(doors))
    side.began = time.time()
    side.stage(close=name)
    side.wait_for(lambda: side.visits(side.began), DOOR_CLOSED)
    side.stage(open=name)


def await_motion(side: Side) -> None:
    """Wait until the robot drives, and begin to count then."""
    side.wait_for(lambda: last_line(side._trace)['speed'] > 0.3, 120.0)
    side.began = time.time()


def fault_person(side: Side) -> None:
    """Have a person walk there and back before the robot for 20 s."""
    await_motion(side)
    side.stage(person=True)
    time.sleep(20.0)
    side.stage(person=False)


def fault_kidnap(side: Side) -> None:
    """Carry the robot to the farthest place; nobody says so."""
    await_motion(side)
    side.stage(pose=far_place(side))


def fault_slip(side: Side) -> None:
    """Let the wheels slip by a tenth for two minutes."""
    side.stage(slip=0.1)
    time.sleep(120.0)
    side.stage(slip=0.0)


def fault_lidar(side: Side) -> None:
    """Let the lidar tell nothing for 3 s."""
    await_motion(side)
    side.stage(silence=3.0)


def change_state(side: Side, server: str, transition: int) -> None:
    """Ask a lifecycle node for a transition."""
    side.asked(
        CALL,
        type_name='lifecycle_msgs/ChangeState',
        name=f'{server}/change_state',
        fields={'transition.id': transition},
    )


def fault_inactive(side: Side) -> None:
    """Deactivate the controller for 20 s."""
    change_state(side, 'controller_server', 4)
    time.sleep(20.0)
    change_state(side, 'controller_server', 3)


def restart(side: Side) -> None:
    """Start all of Nav2 anew, and say where the robot is."""
    assert side.stack is not None
    side.stack.stop()
    side.stack.start()
    side.set_pose_when_up()


def fault_kill(side: Side) -> None:
    """Kill bt_navigator while a goal runs, and start all of Nav2 anew 10 s later."""
    assert side.stack is not None
    await_motion(side)
    side.stack.processes['bt_navigator'].kill()
    time.sleep(10.0)
    restart(side)


def fault_goal(side: Side) -> None:
    """Send the robot elsewhere, as a person does by RViz."""
    await_motion(side)
    side.asked(SEND_GOAL, point=far_place(side)[:2])


def fault_planner(side: Side) -> None:
    """Freeze the planner for 60 s, then start all of Nav2 anew, as a person would."""
    assert side.stack is not None
    await_motion(side)
    planner = side.stack.processes['planner_server']
    planner.send_signal(signal.SIGSTOP)
    time.sleep(60.0)
    planner.send_signal(signal.SIGCONT)
    restart(side)


def fault_box(side: Side) -> None:
    """Box the robot in for 100 s: its costmap does not clear."""
    await_motion(side)
    side.stage(box=True)
    time.sleep(100.0)
    side.stage(box=False)


def fault_pose(side: Side) -> None:
    """Set the pose 1.1 m wrong, and right again 10 s later."""
    x, y, yaw = side.pose
    side.set_pose((x + 1.0, y + 0.5, yaw + 0.5))
    time.sleep(10.0)
    side.set_pose()


def fault_lost(side: Side) -> None:
    """Set the pose in another room, and right again 40 s later."""
    side.set_pose(far_place(side))
    time.sleep(40.0)
    side.set_pose()


def fault_map(side: Side) -> None:
    """Have the map server load the map of another building, and this one again 20 s later."""
    other = side.write_map('other.yaml', CHECKOUT / 'config' / 'office.yaml')
    for path in (other, side.folder / 'map.yaml'):
        side.asked(
            CALL,
            type_name='nav2_msgs/LoadMap',
            name='map_server/load_map',
            fields={'map_url': str(path)},
        )
        if path == other:
            time.sleep(20.0)
    side.set_pose()


def fault_late(side: Side) -> None:
    """Start Nav2 40 s after the patrol."""
    time.sleep(40.0)
    side.start_nav2()


FAULTS = {
    name.removeprefix('fault_'): value
    for name, value in list(globals().items())
    if name.startswith('fault_')
}
NAV2_ALONE = set(FAULTS) - {'door', 'person', 'kidnap', 'slip', 'lidar'}


def with_zones(place: Path, folder: Path) -> Path:
    """Write the seven rooms with a zone to keep out of and a slow one."""
    written = folder / place.name
    written.write_text(f'{place.read_text("utf-8").rstrip()}\n{ZONES}', 'utf-8')
    return written


def drive(side: Side) -> dict[str, float]:
    """Drive one side for the asked time; return its figures."""
    try:
        side.start_all()
        if side.wait_for(side.visits, 120.0) is None:
            raise TimeoutError(f'{side.name}: no visit in two minutes; logs in {side.folder}')
        side.begin()
        time.sleep(60.0 * side.options.minutes)
        return side.figures()
    finally:
        side.stop()


def suffer(side: Side, faults: list[str]) -> None:
    """Have faults happen one after the other; print what became of the patrol."""
    try:
        if faults[0] == 'late':
            side.start_robot()
            side.start_patrol()
        else:
            side.start_all()
            if side.wait_for(lambda: len(side.visits()) > 1, 180.0) is None:
                raise TimeoutError(f'{side.name}: no visits; logs in {side.folder}')
        for fault in faults:
            if fault in NAV2_ALONE and side.name == 'own':
                continue
            print(f'{side.name:5} {fault:9} {after(side, fault)}', flush=True)
    finally:
        side.stop()


def after(side: Side, fault: str) -> str:
    """Have one fault happen; return what became of the patrol, and what it said."""
    side.began = time.time()
    contacts = last_line(side._trace)['contacts']
    FAULTS[fault](side)
    began = side.began
    is_over = side.wait_for(lambda: len(side.visits(began)) > 1, PATIENCE)
    visits = side.visits(began)
    seconds = visits[1]['at'] - began if is_over is not None else math.nan
    told = 'LOST' if is_over is None else f'second visit after {seconds:.0f} s'
    false = len(side.events('visit', began)) - len(visits)
    failures = len(side.events('failure', began))
    hit = last_line(side._trace)['contacts'] - contacts
    said: dict[str, int] = {}
    for event in side.events('incident', began):
        if event['phase'] == 'begin':
            text = event['text'][:150]
            said[text] = said.get(text, 0) + 1
    words = '; '.join(f'{text} ({count} x)' for text, count in said.items())
    return (
        f'{told}, {failures} failures, {false} false visits, {hit} contacts, '
        f'{what_it_did(side, began)}; said: {words}'
    )


def what_it_did(side: Side, began: float) -> str:
    """Return what does not depend on where the next places are, since a time."""
    trace = [each for each in side.trace() if each['at'] >= began]
    steps = [(b['at'] - a['at'], a['speed']) for a, b in pairwise(trace)]
    stood = longest = at_once = 0.0
    for seconds, speed in steps:
        at_once = at_once + seconds if abs(speed) < STANDS else 0.0
        stood, longest = stood + seconds * (at_once > 0.0), max(longest, at_once)
    wrong = [math.dist(e['pose'][:2], e['believed'][:2]) for e in trace if e['believed']]
    return (
        f'{len(side.visits(began))} visits in {trace[-1]["at"] - began:.0f} s, '
        f'stood {stood:.0f} s of it (at most {longest:.1f} s), '
        f'pose wrong by at most {max(wrong, default=math.nan):.2f} m'
    )


def main() -> int:
    """Measure and print the tables."""
    parser = sized_parser(__doc__, quick='two minutes a side')
    parser.add_argument('--place', type=Path, default=CHECKOUT / 'config' / 'seven_rooms.yaml')
    parser.add_argument('--minutes', type=float)
    parser.add_argument('--rounds', type=int, default=1)
    parser.add_argument('--in-turn', action='store_true', help='one side after the other')
    parser.add_argument('--sides', default='nav2,own')
    parser.add_argument('--faults', default='', help='in place of the drives')
    parser.add_argument('--controller', choices=('rpp', 'mppi'), default='rpp')
    parser.add_argument('--nav2', default='', metavar='PREFIX[:PREFIX]')
    parser.add_argument('--params', type=Path, help="nav2_params.yaml of Nav2's bringup")
    parser.add_argument('--namespace', default='', help='of the robot and all its nodes')
    parser.add_argument('--tf-only', action='store_true', help='odometry by tf alone')
    parser.add_argument(
        '--zones', action='store_true', help="keep-out and slow zones, by Nav2's costmap filters"
    )
    parser.add_argument('--docking', action='store_true', help="Nav2's docking server docks")
    parser.add_argument(
        '--no-monitor', action='store_true', help="without Nav2's collision monitor"
    )
    parser.add_argument('--physics', action='store_true', help='MuJoCo moves the robot')
    parser.add_argument('--keep', type=Path, help='folder for logs and recordings')
    options = parser.parse_args()
    options.installed = prefixes(options.nav2) or prefixes(built_here())
    sides = options.sides.split(',')
    if not options.installed and 'nav2' in sides:
        skip('no Nav2 here: apt install ros-jazzy-navigation2, or benchmarks/nav2/build.sh')
    if options.params is None:
        paths = [p / 'share/nav2_bringup/params/nav2_params.yaml' for p in options.installed]
        options.params = next((path for path in paths if path.exists()), None)
        if options.params is None and 'nav2' in sides:
            skip('no nav2_params.yaml: apt install ros-jazzy-nav2-bringup, or --params FILE')
    options.minutes = options.minutes or options.size.of(20.0, 2.0, 0.2)
    folder = options.keep or Path(tempfile.mkdtemp(prefix='nav2-beside-'))
    folder.mkdir(parents=True, exist_ok=True)
    options.masks = None
    if options.zones:
        options.place = with_zones(options.place, folder)
        options.masks = folder / 'masks'
        plan = read_place(options.place).plan
        assert plan is not None
        write_filter_masks(plan, options.masks)
    threads = 1 if options.in_turn else len(sides)
    begun = os.getloadavg()[0]
    with ThreadPoolExecutor(threads) as pool:
        for number in range(options.rounds):
            runs = [
                Side(name, options, folder / f'{name}{number}', claim_domain()) for name in sides
            ]
            if options.faults:
                list(pool.map(lambda side: suffer(side, options.faults.split(',')), runs))
                continue
            for side, found in zip(runs, pool.map(drive, runs), strict=True):
                for key, value in found.items():
                    print(f'{side.name:5} {key:32} {value:8.1f}', flush=True)
    load = os.getloadavg()
    print(
        f'load {begun:.1f} at the start, {load[2]:.1f} in the last 15 minutes, '
        f'{os.cpu_count()} processors; logs in {folder}'
    )
    return 0


if __name__ == '__main__':
    sys.exit(main())
