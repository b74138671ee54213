"""What the page costs with so many robots.

Used by `fleet.py --page`. The robots are made up: another process publishes what the page hears of
the nodes of each, as often as real ones do. One viewer reads the page's events.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from benchmarks.fleet_load import cpu_seconds
from benchmarks.tables import table
from launcher.run import Run
from launcher.run_processes import node_environ
from surveillance_runtime.testing import claim_domain

START_SECONDS = 60.0
SETTLED = 10.0
PERIOD = 0.1
NODES = (
    'robot_behavior',
    'motion_controller',
    'planner_controller',
    'battery_controller',
    'collision_monitor',
    'mission_recorder',
    'mission_markers',
)


def speak(robots: int) -> None:
    """Publish what the page hears of so many robots; does not return."""
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
    from geometry_msgs.msg import PoseWithCovarianceStamped
    from sensor_msgs.msg import LaserScan
    from std_msgs.msg import Bool, UInt8

    from surveillance_interfaces.msg import Decision, FleetRobot, MissionStatus
    from surveillance_runtime.fleet_messages import FLEET_QOS
    from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS

    rclpy.init(args=[])
    often, rarely = [], []
    ranges = [float(number % 50) / 10.0 + 0.5 for number in range(360)]
    values = [KeyValue(key=f'figure{number}', value=f'{number}') for number in range(12)]
    places = [f'R{number}' for number in range(20)]
    for number in range(robots):
        name = f'robot{number + 1}'
        nodes = {
            each: rclpy.create_node(each, namespace=name, start_parameter_services=False)
            for each in NODES
        }
        motion, behaviour = nodes['motion_controller'], nodes['robot_behavior']
        battery = nodes['battery_controller']
        pose = motion.create_publisher(PoseWithCovarianceStamped, 'amcl_pose', STATE_QOS)
        scan = motion.create_publisher(LaserScan, 'scan', SENSOR_QOS)
        often.append((number, pose, scan))
        decision = Decision(place='R1', reason='R1 is mine', rule='URGENT', from_place='R2')
        status = MissionStatus(machine='surveillance', state='DRIVE', place='R1', text='on its way')
        facts = FleetRobot(robot=name, place='R1', tour=places, stop='R1', heading_to='R2')
        facts.visited, facts.visited_at = places, [1.0] * len(places)
        said = [
            (behaviour, 'decision', Decision, STATE_QOS, decision),
            (behaviour, 'mission_status', MissionStatus, STATE_QOS, status),
            (behaviour, '/fleet_robots', FleetRobot, FLEET_QOS, facts),
            (battery, 'battery_level', UInt8, STATE_QOS, UInt8(data=77)),
            (battery, 'battery_low', Bool, STATE_QOS, Bool()),
        ]
        for each, node in nodes.items():
            health = DiagnosticStatus(name=f'{name}/{each}', hardware_id=name, values=values)
            message = DiagnosticArray(status=[health])
            said.append((node, '/diagnostics', DiagnosticArray, 10, message))
        for node, topic, kind, qos, message in said:
            rarely.append((node.create_publisher(kind, topic, qos), message))
    print('ready', flush=True)
    turn = 0
    while True:
        began = time.monotonic()
        for number, pose, scan in often:
            place = PoseWithCovarianceStamped()
            place.header.frame_id = 'map'
            place.pose.pose.position.x = 5.0 + 0.01 * turn % 5.0
            place.pose.pose.position.y = 1.0 * number
            place.pose.pose.orientation.w = 1.0
            pose.publish(place)
            scan.publish(LaserScan(angle_increment=0.0174, range_max=10.0, ranges=ranges))
        # What each says once a second is spread over it.
        for publisher, message in rarely[turn % 10 :: 10]:
            publisher.publish(message)
        turn += 1
        time.sleep(max(0.0, PERIOD - (time.monotonic() - began)))


def page_share(robots: int, seconds: float, place: Path) -> tuple[float, float]:
    """Return which share of a core the page takes, without and with a viewer."""
    domain = claim_domain()
    with socket.socket() as free:
        free.bind(('127.0.0.1', 0))
        port = free.getsockname()[1]
    address = f'127.0.0.1:{port}'
    environ = node_environ(Run(domain=domain))
    with tempfile.TemporaryDirectory(prefix='fleet-') as folder:
        speaker = subprocess.Popen(
            [sys.executable, str(Path(__file__)), str(robots)],
            env={**environ, 'PYTHONPATH': str(ROOT)},
            stdout=subprocess.PIPE,
        )
        words = ['node', 'mission_page', '--map', str(place), '-p', f'port:={port}']
        page = subprocess.Popen(
            [sys.executable, str(ROOT / 'launch.py'), *words],
            env={**os.environ, 'ROS_DOMAIN_ID': str(domain)},
            cwd=folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            assert speaker.stdout is not None
            speaker.stdout.readline()
            deadline = time.monotonic() + START_SECONDS
            while True:
                try:
                    urllib.request.urlopen(f'http://{address}/', timeout=5.0).close()
                    break
                except OSError:
                    if time.monotonic() > deadline:
                        raise
                    time.sleep(0.2)
            time.sleep(SETTLED)
            alone = _share(page.pid, seconds)
            viewer = subprocess.Popen(
                ['curl', '-sN', f'http://{address}/events'], stdout=subprocess.DEVNULL
            )
            try:
                time.sleep(2.0)
                watched = _share(page.pid, seconds)
            finally:
                viewer.kill()
                viewer.wait()
        finally:
            for process in (speaker, page):
                process.terminate()
                process.wait(20.0)
    return alone, watched


def _share(process: int, seconds: float) -> float:
    before, began = cpu_seconds(process), time.monotonic()
    time.sleep(seconds)
    return (cpu_seconds(process) - before) / (time.monotonic() - began)


def page_under(teams: Sequence[int], seconds: float, place: Path) -> None:
    """Print what the page takes with teams of several sizes."""
    rows = [['robots', 'nobody looks', 'one looks', 'a robot']]
    for robots in teams:
        alone, watched = page_share(robots, seconds, place)
        rows.append(
            [
                *(f'{robots}', f'{100.0 * alone:.1f} %', f'{100.0 * watched:.1f} %'),
                f'{100.0 * watched / robots:.2f} %',
            ]
        )
    print(table(rows))
    print('of a core, processor time')


if __name__ == '__main__':
    speak(int(sys.argv[1]))
