"""Nav2 as a set of processes: found where it is installed, started as nav2_bringup starts it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import yaml

from floor_plans.filter_masks import PARAMETERS
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
    ('opennav_docking', 'opennav_docking', 'docking_server'),
)
"""Package, program, node."""
CHAIN = ('velocity_smoother', 'collision_monitor')
"""Between the controller and the base."""
ACKNOWLEDGED_WITHIN = 500
"""So long may a server take to acknowledge a goal, ms; by default 20, too short for a busy machine,
on which Nav2 then aborts what it was asked for."""
MANAGED = 'localization', 'navigation'
"""What each of the two lifecycle managers brings up."""
NAMED = 'nav2_lifecycle_manager', 'nav2_amcl', 'nav2_map_server'
"""Packages whose nodes are told their names."""
LOCALIZERS = ('map_server', 'amcl')
RPP = {
    'plugin': 'nav2_regulated_pure_pursuit_controller::RegulatedPurePursuitController',
    'desired_linear_vel': 0.5,
    'lookahead_dist': 0.6,
    'use_rotate_to_heading': True,
    'use_collision_detection': True,
}


DOCK = {
    'plugin': 'opennav_docking::SimpleChargingDock',
    'docking_threshold': 0.05,
    'staging_x_offset': -0.7,
    'use_external_detection_pose': False,
    'use_battery_status': True,
    'use_stall_detection': False,
}
"""A dock that nobody sees, which is where the map has it."""


def built_here() -> str:
    """Return the prefixes of what `build.sh` builds."""
    folder = Path(os.environ.get('NAV2_BUILD', Path(__file__).parents[2] / 'build' / 'nav2'))
    return f'{folder}/inst:{folder}/be'


def prefixes(given: str) -> list[Path]:
    """Return where Nav2 is installed: as given, as a sourced workspace says, or as Debian has it;
    empty: nowhere.
    """
    named = given or os.environ.get('NAV2_PREFIX', '') or os.environ.get('AMENT_PREFIX_PATH', '')
    found = [Path(each) for each in named.split(os.pathsep) if each] or [Path('/opt/ros/jazzy')]
    has_it = any((each / 'lib' / 'nav2_controller').is_dir() for each in found)
    return found if has_it else []


def lay(over: dict[str, Any], values: dict[str, Any]) -> None:
    """Lay a tree of values over another one."""
    for key, value in over.items():
        if isinstance(value, dict) and isinstance(values.get(key), dict):
            lay(value, values[key])
        else:
            values[key] = value


class Nav2Stack:
    """Nav2's servers and their lifecycle managers.

    Args:
        options: Of the command line: the prefixes, nav2_params.yaml that the profile is laid over,
            the controller (rpp, or mppi as the file has it), the namespace, whether the docking
            server and the collision monitor are started, and the folder of the masks of its
            costmap filters, None without.
        profile: The robot.
        map_file: The map in map_server's format.
        folder: Where parameters and logs go.
        domain: ROS domain.
    """

    def __init__(
        self, options: Any, profile: RobotProfile, map_file: Path, folder: Path, domain: int
    ) -> None:
        self._installed, self._folder = options.installed, folder
        self._space = options.namespace
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        left_out = set() if options.docking else {'docking_server'}
        self._there = [
            row for row in SERVERS if self._program(*row[:2]) is not None and row[2] not in left_out
        ]
        self._chained = set(CHAIN) <= {row[2] for row in self._there} and not options.no_monitor
        if not self._chained:
            self._there = [row for row in self._there if row[2] not in CHAIN]
        filters: dict[str, Any] = {}
        if options.masks is not None:
            filters = yaml.safe_load((options.masks / PARAMETERS).read_text('utf-8'))
            for name in filters:
                if name.endswith('_server') and name != 'controller_server':
                    program = 'map_server' if 'mask' in name else 'costmap_filter_info_server'
                    self._there.append(('nav2_map_server', program, name))
        nodes = [row[2] for row in self._there]
        merged = laid_over(yaml.safe_load(options.params.read_text('utf-8')), profile)
        if options.controller == 'rpp':
            speed = {'desired_linear_vel': profile.drive.speed}
            merged['controller_server']['ros__parameters']['FollowPath'] = RPP | speed
        merged['map_server'] = {'ros__parameters': {'yaml_filename': str(map_file)}}
        merged['bt_navigator']['ros__parameters']['default_server_timeout'] = ACKNOWLEDGED_WITHIN
        monitor = merged['collision_monitor']['ros__parameters']
        monitor['FootprintApproach']['footprint_topic'] = 'local_costmap/published_footprint'
        dock = {'dock_plugins': ['simple_charging_dock'], 'simple_charging_dock': DOCK}
        dock['base_frame'] = profile.frames.base
        merged['docking_server']['ros__parameters'] |= dock
        lay(filters, merged)
        for name, members in (
            ('lifecycle_manager_localization', [n for n in nodes if n in LOCALIZERS]),
            ('lifecycle_manager_navigation', [n for n in nodes if n not in LOCALIZERS]),
        ):
            values = {'autostart': True, 'node_names': members, 'bond_timeout': 4.0}
            merged[name] = {'ros__parameters': values}
        if self._space:
            merged = {self._space: merged}
        self._parameters = folder / 'nav2_params.yaml'
        # Through JSON, for rcl takes no aliases of YAML.
        self._parameters.write_text(yaml.safe_dump(json.loads(json.dumps(merged))), 'utf-8')
        libraries = [each / 'lib' for each in self._installed]
        for each in self._installed:
            libraries += sorted(each.glob('lib/python3*/site-packages/ros_*.libs'))
        self.environ = {
            **os.environ,
            'AMENT_PREFIX_PATH': os.pathsep.join(map(str, self._installed)),
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
        for name in MANAGED:
            (self._folder / f'lifecycle_manager_{name}.log').unlink(missing_ok=True)
        for package, program, node in self._there:
            self.start_one(package, program, node)
        for name in MANAGED:
            node = f'lifecycle_manager_{name}'
            self.start_one('nav2_lifecycle_manager', 'lifecycle_manager', node)

    def localizes(self) -> bool:
        """Tell whether map server and AMCL are active."""
        return self._is_up(MANAGED[0])

    def is_active(self) -> bool:
        """Tell whether both managers have brought up all that was started last."""
        return all(map(self._is_up, MANAGED))

    def _is_up(self, manager: str) -> bool:
        log = self._folder / f'lifecycle_manager_{manager}.log'
        return 'Managed nodes are active' in log.read_text('utf-8', 'replace')

    def start_one(self, package: str, program: str, node: str) -> None:
        """Start one server."""
        path = self._program(package, program)
        assert path is not None, program
        words = [str(path), '--ros-args', '--params-file', str(self._parameters)]
        words += ['-r', f'__node:={node}'] if package in NAMED else []
        if self._space:
            words += ['-r', f'__ns:=/{self._space}', '-r', '/tf:=tf', '-r', '/tf_static:=tf_static']
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


def usage(pids: Iterable[int]) -> dict[int, tuple[float, float]]:
    """Return of each process its processor time so far, seconds, and its PSS, MB."""
    found: dict[int, tuple[float, float]] = {}
    tick = os.sysconf('SC_CLK_TCK')
    for pid in pids:
        try:
            fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
            rollup = Path(f'/proc/{pid}/smaps_rollup').read_text()
        except OSError:
            continue
        pss = next(int(line.split()[1]) for line in rollup.splitlines() if line.startswith('Pss:'))
        found[pid] = ((int(fields[11]) + int(fields[12])) / tick, pss / 1024)
    return found


def children_of(pid: int) -> Iterator[tuple[list[str], int]]:
    """Yield the processes below one: the names of the nodes that each runs, and its number."""
    parents: dict[int, int] = {}
    nodes: dict[int, list[str]] = {}
    for folder in Path('/proc').glob('[0-9]*'):
        try:
            fields = (folder / 'stat').read_text().rpartition(')')[2].split()
            words = (folder / 'cmdline').read_bytes().decode(errors='replace').split('\0')
        except OSError:
            continue
        parents[int(folder.name)] = int(fields[1])
        # `motion_controller=module:Class,...` is how the launcher names the nodes of a process.
        named = [word for word in words if '=' in word and '_node:' in word]
        nodes[int(folder.name)] = [
            each.partition('=')[0] for word in named for each in word.split(',')
        ]
    for each, names in nodes.items():
        at = each
        while at in parents and at != pid:
            at = parents[at]
        if at == pid and names:
            yield names, each
