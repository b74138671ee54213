#!/usr/bin/env python3
"""The patrol driven by Nav2 beside the patrol driven by this project: same robot, same place.

    .venv/bin/python benchmarks/nav2/drives.py [--quick] [--minutes 10] [--rounds 1]
        [--sides nav2,own] [--faults late,inactive,kill,goal,initialpose]
        [--nav2 PREFIX[:PREFIX]] [--params nav2_params.yaml]

Needs Nav2 for Jazzy: `sudo apt install ros-jazzy-navigation2 ros-jazzy-nav2-bringup`, or a prefix
that holds it, and its messages (`python3 launch.py setup --with nav2`). Sides take turns; each has
a robot of its own, which speaks as a foreign one (`foreign_robot.py`).
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from nav2.stack import Nav2Stack, children_of, prefixes, usage
from sizes import sized_parser, skip

from floor_plans import read_place
from floor_plans.occupancy_map import write_map
from surveillance_runtime.profile import read_profile

CHECKOUT = Path(__file__).resolve().parents[2]
NAVIGATION = ('motion_controller', 'planner_controller', 'collision_monitor')
"""Our nodes that do what Nav2 does."""
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
dock: {navigator: NAVIGATOR}
arm: none
"""


class Side:
    """One side: a robot, who drives it, and the patrol.

    Args:
        name: nav2 or own.
        options: Of the command line.
        folder: For its files.
        domain: ROS domain.
    """

    def __init__(self, name: str, options: Any, folder: Path, domain: int) -> None:
        self.name, self._folder, self._domain = name, folder, domain
        self._options = options
        folder.mkdir(parents=True)
        self._profile = folder / 'robot.yaml'
        self._profile.write_text(PROFILE.replace('NAVIGATOR', name))
        self._report = folder / 'robot.json'
        self.environ = {**os.environ, 'ROS_DOMAIN_ID': str(domain)}
        self.stack: Nav2Stack | None = None
        self._robot: subprocess.Popen[bytes] | None = None
        self._patrol: subprocess.Popen[bytes] | None = None
        self._before: dict[str, tuple[float, float]] = {}

    def start_robot(self) -> None:
        words = [sys.executable, str(Path(__file__).with_name('foreign_robot.py'))]
        words += [str(self._options.place), str(self._report)]
        words += ['--map'] if self.name == 'own' else []
        words += ['--slip', str(self._options.slip)]
        self._robot = self._started(words, 'robot.log')

    def start_nav2(self) -> None:
        plan = read_place(self._options.place).plan
        assert plan is not None
        picture = self._folder / 'map.yaml'
        grid = plan.grid()
        write_map(picture, grid.cells[::-1], grid.resolution, (*grid.origin, 0.0))
        profile = read_profile(self._profile).profile
        self.stack = Nav2Stack(
            self._options.installed,
            profile,
            picture,
            self._folder,
            self._domain,
            self._options.params,
            self._options.controller,
        )
        self.stack.start()

    def start_patrol(self) -> None:
        words = [sys.executable, str(CHECKOUT / 'launch.py'), '--mode', 'ROBOT']
        words += ['--robot', str(self._profile), '--map', str(self._options.place)]
        words += ['--record', str(self._folder / 'runs'), '--domain', str(self._domain)]
        self._patrol = self._started(words, 'patrol.log')

    def _started(self, words: list[str], log: str) -> subprocess.Popen[bytes]:
        with (self._folder / log).open('ab') as file:
            return subprocess.Popen(
                words,
                env=self.environ,
                cwd=CHECKOUT,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def _pids(self) -> dict[str, int]:
        if self.stack is not None:
            return {name: each.pid for name, each in self.stack.processes.items()}
        assert self._patrol is not None
        below = children_of(self._patrol.pid)
        return {name: pid for name, pid in below.items() if name.partition('#')[0] in NAVIGATION}

    def begin(self) -> None:
        """Begin to count."""
        self._before, self._since = usage(self._pids()), time.monotonic()

    def figures(self) -> dict[str, float]:
        """Return what there is since `begin`."""
        now, passed = usage(self._pids()), time.monotonic() - self._since
        used = sum(each[0] - self._before.get(name, (0.0, 0.0))[0] for name, each in now.items())
        robot = json.loads(self._report.read_text()) if self._report.exists() else {}
        events = [event for event in self.events() if 'event' in event]
        visits = [event for event in events if event['event'] == 'visit']
        failed = [event for event in events if event['event'] == 'failure']
        return {
            'minutes': passed / 60,
            'CPU, % of a core': 100 * used / passed,
            'PSS, MB': sum(each[1] for each in now.values()),
            'visits': len(visits),
            'failures': len(failed),
            'way, m': robot.get('way', 0.0),
            'contacts': robot.get('contacts', 0),
        }

    def events(self) -> list[dict[str, Any]]:
        """Return the log of the mission so far."""
        found = []
        for file in sorted((self._folder / 'runs').glob('*/events.jsonl')):
            for line in file.read_text().splitlines():
                try:
                    found.append(json.loads(line))
                except ValueError:
                    continue
        return found

    def visits(self) -> int:
        return sum(event.get('event') == 'visit' for event in self.events())

    def stop(self) -> None:
        for process in (self._patrol, self._robot):
            if process is not None and process.poll() is None:
                process.send_signal(signal.SIGINT)
                try:
                    process.wait(30.0)
                except subprocess.TimeoutExpired:
                    os.killpg(process.pid, signal.SIGKILL)
        if self.stack is not None:
            self.stack.stop()


def asked(side: Side, script: str) -> None:
    """Run a few lines of rclpy in the side's domain: what a person does."""
    begun = 'import rclpy\nrclpy.init()\nnode = rclpy.create_node("person")\n'
    words = [sys.executable, '-c', begun + script]
    subprocess.run(words, env=side.environ, timeout=60.0, check=False, stdin=subprocess.DEVNULL)


CHANGE_STATE = """
from lifecycle_msgs.srv import ChangeState
client = node.create_client(ChangeState, '/controller_server/change_state')
client.wait_for_service(10.0)
request = ChangeState.Request()
request.transition.id = NUMBER
future = client.call_async(request)
rclpy.spin_until_future_complete(node, future, timeout_sec=20.0)
"""
SEND_GOAL = """
from geometry_msgs.msg import PoseStamped
from nav2_msgs.action import NavigateThroughPoses
from rclpy.action import ActionClient
client = ActionClient(node, NavigateThroughPoses, '/navigate_through_poses')
client.wait_for_server(10.0)
pose = PoseStamped()
pose.header.frame_id = 'map'
pose.pose.position.x, pose.pose.position.y, pose.pose.orientation.w = 10.0, 8.0, 1.0
future = client.send_goal_async(NavigateThroughPoses.Goal(poses=[pose, pose]))
rclpy.spin_until_future_complete(node, future, timeout_sec=20.0)
if future.done() and future.result().accepted:
    rclpy.spin_until_future_complete(node, future.result().get_result_async(), timeout_sec=30.0)
"""
SET_POSE = """
import json, time
from geometry_msgs.msg import PoseWithCovarianceStamped
from surveillance_runtime.conversions import pose_estimate
publisher = node.create_publisher(PoseWithCovarianceStamped, '/initialpose', 1)
while not publisher.get_subscription_count():
    time.sleep(0.1)
message = PoseWithCovarianceStamped(pose=pose_estimate(POSE, 0.3, 0.2))
message.header.frame_id = 'map'
message.header.stamp = node.get_clock().now().to_msg()
publisher.publish(message)
time.sleep(1.0)
"""


def set_pose(side: Side, pose: Any) -> None:
    """Tell where the robot is, as RViz does."""
    asked(side, SET_POSE.replace('POSE', repr(tuple(map(float, pose)))))


def fault_inactive(side: Side) -> None:
    """Deactivate the controller for 20 s."""
    asked(side, CHANGE_STATE.replace('NUMBER', '4'))
    time.sleep(20.0)
    asked(side, CHANGE_STATE.replace('NUMBER', '3'))


def fault_kill(side: Side) -> None:
    """Kill bt_navigator while a goal runs, and start all of Nav2 anew 10 s later."""
    assert side.stack is not None
    side.stack.processes['bt_navigator'].kill()
    time.sleep(10.0)
    side.stack.stop()
    side.stack.start()
    time.sleep(8.0)
    set_pose(side, true_pose(side))


def fault_goal(side: Side) -> None:
    """Send the robot elsewhere, as a person does."""
    asked(side, SEND_GOAL)


def fault_initialpose(side: Side) -> None:
    """Set the pose wrong, and right again 10 s later."""
    x, y, yaw = true_pose(side)
    set_pose(side, (x + 1.0, y + 0.5, yaw + 0.5))
    time.sleep(10.0)
    set_pose(side, true_pose(side))


def true_pose(side: Side) -> Any:
    return json.loads((side._report).read_text())['pose']


FAULTS = {
    'inactive': fault_inactive,
    'kill': fault_kill,
    'goal': fault_goal,
    'initialpose': fault_initialpose,
}


def await_visits(side: Side, count: int, seconds: float) -> float | None:
    """Wait for so many visits; return the seconds that took, None: they did not come."""
    begun = time.monotonic()
    while time.monotonic() - begun < seconds:
        if side.visits() >= count:
            return time.monotonic() - begun
        time.sleep(1.0)
    return None


def drive(name: str, options: Any, folder: Path, domain: int) -> dict[str, float]:
    """Drive one side for the asked time; return its figures."""
    side = Side(name, options, folder, domain)
    try:
        side.start_robot()
        time.sleep(3.0)
        if name == 'nav2':
            side.start_nav2()
            time.sleep(8.0)
            set_pose(side, true_pose(side))
            time.sleep(4.0)
        side.start_patrol()
        await_visits(side, 1, 90.0)
        side.begin()
        time.sleep(60.0 * options.minutes)
        return side.figures()
    finally:
        side.stop()


def suffer(fault: str, options: Any, folder: Path, domain: int) -> str:
    """Have one fault happen on Nav2's side; return what became of the patrol."""
    side = Side('nav2', options, folder, domain)
    try:
        side.start_robot()
        time.sleep(3.0)
        if fault == 'late':
            side.start_patrol()
            time.sleep(40.0)
        side.start_nav2()
        time.sleep(8.0)
        set_pose(side, true_pose(side))
        if fault != 'late':
            time.sleep(4.0)
            side.start_patrol()
            if await_visits(side, 2, 180.0) is None:
                return 'did not begin'
            time.sleep(4.0)
            FAULTS[fault](side)
        before = side.visits()
        seconds = await_visits(side, before + 2, 300.0)
        goals = (folder / 'bt_navigator.log').read_text(errors='replace').count('Received goal')
        goals += (folder / 'bt_navigator.log').read_text(errors='replace').count('Begin navigating')
        told = 'goes on after' if seconds is not None else 'LOST, after'
        return f'{told} {seconds or 300.0:.0f} s, {goals} goals'
    finally:
        side.stop()


def main() -> int:
    """Measure and print the tables."""
    parser = sized_parser(__doc__, quick='two minutes a side')
    parser.add_argument('--place', type=Path, default=CHECKOUT / 'config' / 'seven_rooms.yaml')
    parser.add_argument('--minutes', type=float)
    parser.add_argument('--rounds', type=int, default=1)
    parser.add_argument('--sides', default='nav2,own')
    parser.add_argument('--faults', default='')
    parser.add_argument('--controller', choices=('rpp', 'mppi'), default='rpp')
    parser.add_argument('--nav2', default='', metavar='PREFIX[:PREFIX]')
    parser.add_argument('--params', type=Path, help="nav2_params.yaml of Nav2's bringup")
    parser.add_argument('--slip', type=float, default=0.0, help='part of each way, 0 to 1')
    parser.add_argument('--domain', type=int, default=87)
    parser.add_argument('--keep', type=Path, help='folder for logs and recordings')
    options = parser.parse_args()
    options.installed = prefixes(options.nav2)
    sides = options.sides.split(',')
    if not options.installed and 'nav2' in sides:
        skip('no Nav2 here: apt install ros-jazzy-navigation2, or --nav2 PREFIX')
    if options.params is None:
        paths = [p / 'share/nav2_bringup/params/nav2_params.yaml' for p in options.installed]
        options.params = next((path for path in paths if path.exists()), None)
        if options.params is None and 'nav2' in sides:
            skip('no nav2_params.yaml: apt install ros-jazzy-nav2-bringup, or --params FILE')
    options.minutes = options.minutes or options.size.of(20.0, 2.0, 0.2)
    folder = options.keep or Path(tempfile.mkdtemp(prefix='nav2-beside-'))
    for fault in filter(None, options.faults.split(',')):
        print(f'{fault:12} {suffer(fault, options, folder / fault, options.domain)}', flush=True)
    rows: dict[str, list[dict[str, float]]] = {side: [] for side in sides}
    for number in range(options.rounds if not options.faults or options.sides else 0):
        for side in sides:
            found = drive(side, options, folder / f'{side}{number}', options.domain + 1)
            rows[side].append(found)
            print(side, {key: round(value, 1) for key, value in found.items()}, flush=True)
    load = os.getloadavg()
    print(f'load {load[0]:.1f} of {os.cpu_count()} processors; logs in {folder}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
