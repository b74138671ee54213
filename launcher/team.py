"""What a run starts: the nodes that are there once, and those that each robot of a fleet has.

A run of one robot has one part. A fleet has the shared part (ontology, map builder, simulator)
and one for each robot, with its own namespace and folder; what robots share has the same names for
all, by remapping.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from launcher.run import MARKERS, OBSERVER, RECORDER, Run
from surveillance_runtime import node_table
from surveillance_runtime.configuration import Entry
from surveillance_runtime.node_table import Node
from surveillance_runtime.place import read_place_file
from surveillance_runtime.place.fleet import (
    FleetMember,
    points_to_pass,
    robots_in_a_row,
    wide_places,
    wide_ways,
    with_points,
)
from surveillance_runtime.profile import ProfileFile
from surveillance_runtime.run_parameters import full_name, place_file
from surveillance_runtime.suggestions import nearest

POINTS = 'room_positions'
"""The table of a place's file with the points of its places."""
SHARED = 'shared'
"""How `--only` and `--without` name the part that all robots share."""


@dataclass(frozen=True)
class Part:
    """Nodes with one namespace and one folder.

    Attributes:
        run: What is asked of them; its namespace is theirs.
        robot: The robot's name; empty: it is the only one, or the part is shared.
        nodes: Those that work.
        observers: Those that look on.
        entries: Parameters that the fleet gives them.
        renamed: From which name to which names are renamed that all robots share.
    """

    run: Run
    robot: str = ''
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


def members(run: Run, config: Path, robot: ProfileFile) -> tuple[FleetMember, ...]:
    """Return the robots of the fleet that a run asks for; none: it is a run of one robot.

    Raises:
        ValueError: The place has another number of robots, or no room for so many.
    """
    path = place_file(config, run.behaviour, run.place)
    radius = robot.profile.body.reach
    place = read_place_file(path, radius=radius)
    if run.robots is None or len(place.robots) == run.robots:
        return place.robots
    if place.robots:
        names = ', '.join(member.name for member in place.robots)
        raise ValueError(f'--robots {run.robots}: {path.name} has {len(place.robots)}: {names}')
    return robots_in_a_row(place.plan, run.robots, radius)


def parts(run: Run, config: Path, robot: ProfileFile) -> tuple[Part, ...]:
    """Return the parts of a run, what is shared first.

    Raises:
        ValueError: A word of `only` or `without` names nothing, or nothing is left to start.
    """
    fleet = members(run, config, robot)
    monitored = robot.profile.is_monitored
    if not fleet:
        return (Part(run, nodes=run.nodes(monitored=monitored), observers=run.observers()),)
    names = [SHARED, *(member.name for member in fleet)]
    for word in (*run.only, *run.without):
        _check_word(word, names)
    table = tuple(_table(fleet))
    place = read_place_file(
        place_file(config, run.behaviour, run.place), radius=robot.profile.body.reach
    )
    reach = robot.profile.body.reach
    moved = points_to_pass(place.plan, reach)
    plan = with_points(place.plan, moved)
    wide = (
        ('traffic.wide_ways', list(wide_ways(plan, reach))),
        ('traffic.wide_places', list(wide_places(plan, reach))),
    )
    table += tuple(
        Entry('/**', f'{POINTS}.{name}', list(point), '--robots') for name, point in moved.items()
    )
    found = []
    shared = _chosen(run, SHARED, monitored)
    if shared.everyone:
        found.append(replace(shared, entries=table))
    for member in fleet:
        namespace = '/'.join(name for name in (run.namespace or '', member.name) if name)
        own = replace(run, namespace=namespace.strip('/'), robot=member.profile or run.robot)
        part = _chosen(own, member.name, monitored)
        if part.everyone:
            entries = [*table, *_of_member(member, own, wide)]
            renamed = tuple(node_table.shared_names(run.namespace))
            found.append(replace(part, entries=tuple(entries), renamed=renamed))
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


def _chosen(run: Run, name: str, monitored: bool) -> Part:
    """Return the part of a name with its nodes, as `only` and `without` leave them."""
    given = [word for word in run.only if word not in node_table.BY_NAME]
    asked = _of(run.only, name)
    if run.only and not asked and name not in given:
        return Part(run, '' if name == SHARED else name)
    whole = replace(run, only=() if name in given else asked, without=_of(run.without, name))
    if name in run.without:
        return Part(run, '' if name == SHARED else name)
    try:
        nodes = whole.nodes(monitored=monitored)
    except ValueError:
        nodes = ()
    observers = whole.observers()
    is_shared = name == SHARED
    kept = tuple(node for node in nodes if (node.name in node_table.SHARED) == is_shared)
    per_robot = (RECORDER, MARKERS, OBSERVER)
    looking = tuple(node for node in observers if (node.name not in per_robot) == is_shared)
    return Part(run, '' if is_shared else name, kept, looking if kept or is_shared else ())


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
    member: FleetMember, run: Run, wide: Sequence[tuple[str, object]]
) -> Iterator[Entry]:
    """Yield what the nodes of one robot are told."""
    everyone = full_name(run.namespace, '*')
    origin = f'robot {member.name}'
    yield Entry(everyone, 'robot_name', member.name, origin)
    if member.dock:
        yield Entry(everyone, 'recharge_rooms', [member.dock], origin)
    motion = full_name(run.namespace, 'motion_controller')
    yield Entry(motion, 'start_pose', [float(value) for value in member.start], origin)
    for node in ('robot_behavior', 'reasoner'):
        name = full_name(run.namespace, node)
        yield Entry(name, 'fleet', True, origin)
        for key, value in wide:
            yield Entry(name, key, value, origin)
