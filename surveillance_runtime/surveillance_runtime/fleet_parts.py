"""What a run starts: the nodes that are there once, and those that each robot of a fleet has.

A run of one robot has one part. A fleet has the shared part (ontology, map builder, simulator)
and one for each robot, with its own namespace and folder; what robots share has the same names for
all, by remapping. `launch.py` and the launch file for an installed ROS start the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from floor_plans import read_place
from floor_plans.fleet import (
    FleetMember,
    points_to_pass,
    robots_in_a_row,
    wide_passages,
    wide_places,
    with_points,
)
from strict_files.suggestions import nearest
from surveillance_runtime import node_table
from surveillance_runtime.configuration import Entry
from surveillance_runtime.node_table import MARKERS, RECORDER, Node
from surveillance_runtime.run_parameters import OBSERVER, full_name

POINTS = 'room_positions'
"""The table of a place's file with the points of its places."""
SHARED = 'shared'
"""How `--only` and `--without` name the part that all robots share."""
OF_ROBOT = (RECORDER, MARKERS, OBSERVER)
"""The nodes that look on of which each robot has its own."""


@dataclass(frozen=True)
class TeamPart:
    """Nodes with one namespace and one folder.

    Attributes:
        robot: The robot's name; empty: it is the only one, or the part is shared.
        namespace: Of the nodes.
        profile: The robot's own profile; empty: that of the run.
        nodes: Those that work.
        observers: Those that look on.
        entries: Parameters that the fleet gives them.
        renamed: From which name to which names are renamed that all robots share.
    """

    robot: str = ''
    namespace: str | None = None
    profile: str = ''
    nodes: tuple[Node, ...] = ()
    observers: tuple[Node, ...] = ()
    entries: tuple[Entry, ...] = ()
    renamed: tuple[tuple[str, str], ...] = ()

    @property
    def everyone(self) -> tuple[Node, ...]:
        """All its nodes."""
        return (*self.nodes, *self.observers)

    @property
    def moved_points(self) -> list[str]:
        """The places whose points are other ones than in the place's file."""
        names = [entry.name.partition('.') for entry in self.entries]
        return [place for table, _, place in names if table == POINTS]

    def folder(self, folder: Path) -> Path:
        """Return where the part writes, in the folder of the run."""
        return folder / self.robot if self.robot else folder

    def name(self, node: str) -> str:
        """Return the name of a node in the log."""
        return f'{self.robot}/{node}' if self.robot else node


@dataclass(frozen=True)
class Choice:
    """Which nodes are started.

    Attributes:
        only, without: Names of nodes, of robots, `shared`, and `robot1/NODE`.
        nodes: Returns those that work, of `only` and `without` with names of nodes; raises
            `ValueError` where none is left.
        observers: Returns those that look on, of such an `only`.
    """

    only: Sequence[str]
    without: Sequence[str]
    nodes: Callable[[Sequence[str], Sequence[str]], tuple[Node, ...]]
    observers: Callable[[Sequence[str]], tuple[Node, ...]]


def members(path: Path, robots: int | None, reach: float) -> tuple[FleetMember, ...]:
    """Return the robots of the fleet that a run asks for; none: it is a run of one robot.

    Args:
        path: The file of the place.
        robots: How many are asked for; None: as the place says.
        reach: How far a robot's body reaches from its middle, metres.

    Raises:
        ValueError: The place has another number of robots, or no room for so many.
    """
    place = read_place(path, radius=reach, reserved=node_table.RESERVED)
    if robots is None or len(place.robots) == robots:
        return place.robots
    if place.robots:
        names = ', '.join(member.name for member in place.robots)
        raise ValueError(f'--robots {robots}: {path.name} has {len(place.robots)}: {names}')
    return robots_in_a_row(place.plan, robots, reach)


def team_parts(
    path: Path, robots: int | None, reach: float, namespace: str | None, choice: Choice
) -> tuple[TeamPart, ...]:
    """Return the parts of a run, what is shared first.

    Args:
        path, robots, reach: As for `members`.
        namespace: Of the run.
        choice: Which nodes are started.

    Raises:
        ValueError: A word of `only` or `without` names nothing, or nothing is left to start.
    """
    fleet = members(path, robots, reach)
    if not fleet:
        nodes = choice.nodes(choice.only, choice.without)
        return (TeamPart('', namespace, '', nodes, choice.observers(choice.only)),)
    names = [SHARED, *(member.name for member in fleet)]
    for word in (*choice.only, *choice.without):
        _check_word(word, names)
    place = read_place(path, radius=reach, reserved=node_table.RESERVED)
    moved = points_to_pass(place.plan, reach)
    plan = with_points(place.plan, moved)
    shared_by_all: list[tuple[str, object]] = [
        ('traffic.wide_ways', list(wide_passages(plan, reach))),
        ('traffic.wide_places', list(wide_places(plan, reach))),
    ]
    if any(member.dock for member in fleet):
        shared_by_all.append(('fleet_docks', list(plan.place.recharge_rooms)))
    points = [
        Entry('/**', f'{POINTS}.{name}', list(point), '--robots') for name, point in moved.items()
    ]
    table = (*_table(fleet), *points)
    found = []
    shared = _chosen(choice, SHARED)
    if shared.everyone:
        found.append(replace(shared, namespace=namespace, entries=table))
    above = (namespace or '').strip('/')
    renamed = tuple(node_table.shared_names(namespace))
    for member in fleet:
        part = _chosen(choice, member.name)
        if part.everyone:
            own = '/'.join(filter(None, (above, member.name)))
            others = [full_name(above, other.name) for other in fleet if other.name != member.name]
            entries = (*table, *_of_member(member, own, shared_by_all, others))
            part = replace(part, namespace=own, profile=member.profile)
            found.append(replace(part, entries=entries, renamed=renamed))
    if not found:
        raise ValueError('no node is left to start: check --only and --without')
    return tuple(found)


def _check_word(word: str, names: Sequence[str]) -> None:
    robot, _, node = word.rpartition('/')
    if (robot and robot not in names) or (not robot and word not in (*names, *node_table.BY_NAME)):
        known = nearest(robot or word, (*names, *node_table.BY_NAME))
        raise ValueError(f'--only, --without {word!r}: expected {known}')
    if robot:
        node_table.find(node)


def _chosen(choice: Choice, name: str) -> TeamPart:
    """Return the part of a name with its nodes, as `only` and `without` leave them."""
    robot = '' if name == SHARED else name
    given = [word for word in choice.only if word not in node_table.BY_NAME]
    asked = _of(choice.only, name)
    left_out = choice.only and not asked and name not in given
    if left_out or name in choice.without:
        return TeamPart(robot)
    only = () if name in given else asked
    try:
        nodes = choice.nodes(only, _of(choice.without, name))
    except ValueError:
        nodes = ()
    is_shared = name == SHARED
    kept = tuple(node for node in nodes if (node.name in node_table.SHARED) == is_shared)
    looking = tuple(
        node for node in choice.observers(only) if (node.name not in OF_ROBOT) == is_shared
    )
    return TeamPart(robot, nodes=kept, observers=looking if kept or is_shared else ())


def _of(words: Sequence[str], name: str) -> tuple[str, ...]:
    """Return the nodes of a part that words name."""
    found = []
    for word in words:
        robot, _, node = word.rpartition('/')
        if node in node_table.BY_NAME and robot in ('', name):
            found.append(node)
    return tuple(found)


def _table(fleet: Sequence[FleetMember]) -> Iterator[Entry]:
    """Yield the robots of the fleet, for who needs to know them all."""
    for member in fleet:
        for node in ('simulator', 'ontology_map_builder'):
            pattern, start = f'/**/{node}', [float(value) for value in member.start]
            yield Entry(pattern, f'robots.{member.name}.start', start, '--robots')


def _of_member(
    member: FleetMember,
    namespace: str,
    shared_by_all: Sequence[tuple[str, object]],
    others: Sequence[str],
) -> Iterator[Entry]:
    """Yield what the nodes of one robot are told."""
    everyone = full_name(namespace, '*')
    origin = f'robot {member.name}'
    yield Entry(everyone, 'robot_name', member.name, origin)
    if member.dock:
        yield Entry(everyone, 'recharge_rooms', [member.dock], origin)
    motion = full_name(namespace, 'motion_controller')
    yield Entry(motion, 'start_pose', [float(value) for value in member.start], origin)
    for node in ('robot_behavior', 'reasoner'):
        name = full_name(namespace, node)
        yield Entry(name, 'fleet', True, origin)
        for key, value in shared_by_all:
            yield Entry(name, key, value, origin)
    if others:
        yield Entry(full_name(namespace, RECORDER), 'other_robots', list(others), origin)
