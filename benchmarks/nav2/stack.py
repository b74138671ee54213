"""Nav2 as a set of processes: found where it is installed, started as nav2_bringup starts it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from collections.abc import Mapping
from pathlib import Path

import yaml

from surveillance_runtime.profile import RobotProfile
from surveillance_runtime.profile.nav2_parameters import laid_over

SERVERS = (
    ('nav2_map_server', 'map_server', 'map_server'),
    ('nav2_amcl', 'amcl', 'amcl'),
    ('nav2_controller', 'controller_server', 'controller_server'),
    ('nav2_planner', 'planner_server', 'planner_server'),
    ('nav2_behaviors', 'behavior_server', 'behavior_server'),
    ('nav2_bt_navigator', 'bt_navigator', 'bt_navigator'),
    ('nav2_velocity_smoother', 'velocity_smoother', 'velocity_smoother'),
    ('nav2_collision_monitor', 'collision_monitor', 'collision_monitor'),
)
"""Package, program, node."""
CHAIN = ('velocity_smoother', 'collision_monitor')
"""Between the controller and the base."""
LOCALIZERS = ('map_server', 'amcl')
RPP = {
    'plugin': 'nav2_regulated_pure_pursuit_controller::RegulatedPurePursuitController',
    'desired_linear_vel': 0.5,
    'lookahead_dist': 0.6,
    'use_rotate_to_heading': True,
    'use_collision_detection': True,
}


def prefixes(given: str) -> list[Path]:
    """Return where Nav2 is installed: as given, as a sourced workspace says, or as Debian has it;
    empty: nowhere.
    """
    named = given or os.environ.get('NAV2_PREFIX', '') or os.environ.get('AMENT_PREFIX_PATH', '')
    found = [Path(each) for each in named.split(os.pathsep) if each] or [Path('/opt/ros/jazzy')]
    has_it = any((each / 'lib' / 'nav2_controller').is_dir() for each in found)
    return found if has_it else []


class Nav2Stack:
    """Nav2's servers and their lifecycle managers.

    Args:
        installed: The prefixes.
        profile: The robot.
        map_file: The map in map_server's format.
        folder: Where parameters and logs go.
        domain: ROS domain.
        parameters: nav2_params.yaml that the profile is laid over.
        controller: rpp, or mppi as the file has it.
    """

    def __init__(
        self,
        installed: list[Path],
        profile: RobotProfile,
        map_file: Path,
        folder: Path,
        domain: int,
        parameters: Path,
        controller: str,
    ) -> None:
        self._installed, self._folder = installed, folder
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self._there = [row for row in SERVERS if self._program(*row[:2]) is not None]
        nodes = [row[2] for row in self._there]
        self._chained = set(CHAIN) <= set(nodes)
        if not self._chained:
            self._there = [
                row
                for row in self._there
                if row[2] not in ('velocity_smoother', 'collision_monitor')
            ]
            nodes = [row[2] for row in self._there]
        merged = laid_over(yaml.safe_load(parameters.read_text('utf-8')), profile)
        if controller == 'rpp':
            speed = {'desired_linear_vel': profile.drive.speed}
            merged['controller_server']['ros__parameters']['FollowPath'] = RPP | speed
        merged['map_server'] = {'ros__parameters': {'yaml_filename': str(map_file)}}
        for name, members in (
            ('lifecycle_manager_localization', [n for n in nodes if n in LOCALIZERS]),
            ('lifecycle_manager_navigation', [n for n in nodes if n not in LOCALIZERS]),
        ):
            values = {'autostart': True, 'node_names': members, 'bond_timeout': 4.0}
            merged[name] = {'ros__parameters': values}
        self._parameters = folder / 'nav2_params.yaml'
        # Through JSON, for rcl takes no aliases of YAML.
        self._parameters.write_text(yaml.safe_dump(json.loads(json.dumps(merged))), 'utf-8')
        libraries = [each / 'lib' for each in installed]
        for each in installed:
            libraries += sorted(each.glob('lib/python3*/site-packages/ros_*.libs'))
        self.environ = {
            **os.environ,
            'AMENT_PREFIX_PATH': os.pathsep.join(map(str, installed)),
            'LD_LIBRARY_PATH': os.pathsep.join(map(str, libraries)),
            'ROS_DOMAIN_ID': str(domain),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'RMW_IMPLEMENTATION': 'rmw_fastrtps_cpp',
        }

    def _program(self, package: str, name: str) -> Path | None:
        paths = [each / 'lib' / package / name for each in self._installed]
        return next((path for path in paths if path.exists()), None)

    def start(self) -> None:
        """Start all; the managers bring them up by and by."""
        for package, program, node in self._there:
            self.start_one(package, program, node)
        for name in ('localization', 'navigation'):
            node = f'lifecycle_manager_{name}'
            self.start_one('nav2_lifecycle_manager', 'lifecycle_manager', node)

    def start_one(self, package: str, program: str, node: str) -> None:
        """Start one server."""
        path = self._program(package, program)
        assert path is not None, program
        words = [str(path), '--ros-args', '--params-file', str(self._parameters)]
        words += (
            ['-r', f'__node:={node}'] if package in ('nav2_lifecycle_manager', 'nav2_amcl') else []
        )
        if self._chained and node in ('controller_server', 'behavior_server', 'velocity_smoother'):
            words += ['-r', 'cmd_vel:=cmd_vel_nav']
        with (self._folder / f'{node}.log').open('ab') as log:
            self.processes[node] = subprocess.Popen(
                words,
                env=self.environ,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def again(self, node: str) -> None:
        """Start one that was killed."""
        package, program, _ = next(row for row in self._there if row[2] == node)
        self.start_one(package, program, node)

    def stop(self) -> None:
        """End all."""
        for number in (signal.SIGINT, signal.SIGKILL):
            for process in self.processes.values():
                if process.poll() is None:
                    process.send_signal(number)
            for process in self.processes.values():
                try:
                    process.wait(10.0)
                except subprocess.TimeoutExpired:
                    continue


def usage(pids: Mapping[str, int]) -> dict[str, tuple[float, float]]:
    """Return of each process its processor time so far, seconds, and its PSS, MB."""
    found: dict[str, tuple[float, float]] = {}
    tick = os.sysconf('SC_CLK_TCK')
    for name, pid in pids.items():
        try:
            fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
            rollup = Path(f'/proc/{pid}/smaps_rollup').read_text()
        except OSError:
            continue
        pss = next(int(line.split()[1]) for line in rollup.splitlines() if line.startswith('Pss:'))
        found[name] = ((int(fields[11]) + int(fields[12])) / tick, pss / 1024)
    return found


def children_of(pid: int) -> dict[str, int]:
    """Return the processes below one, by the name of the node that each runs."""
    parents: dict[int, int] = {}
    names: dict[int, str] = {}
    for folder in Path('/proc').glob('[0-9]*'):
        try:
            fields = (folder / 'stat').read_text().rpartition(')')[2].split()
            words = (folder / 'cmdline').read_bytes().decode(errors='replace').split('\0')
        except OSError:
            continue
        parents[int(folder.name)] = int(fields[1])
        # `motion_controller=module:Class` is how the launcher names the node of a process.
        named = [word.partition('=')[0] for word in words if ':' in word and '_node:' in word]
        names[int(folder.name)] = (named or words)[0]

    def is_below(each: int) -> bool:
        while each in parents and each != pid:
            each = parents[each]
        return each == pid

    below: dict[str, int] = {}
    for each in parents:
        if each != pid and is_below(each):
            below[f'{names[each]}#{each}'] = each
    return below
