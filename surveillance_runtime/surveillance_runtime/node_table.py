"""The nodes of the robot: where each one lives, what it is for, and which of them a run starts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from strict_files.suggestions import nearest
from surveillance_runtime.run_files import FOLDERS

MODES = ('SIMULATED', 'ROBOT', 'RANDOM', 'MANUAL')
DEFAULT_MODE = 'SIMULATED'
BEHAVIOURS = ('surveillance', 'patrol')
DEFAULT_BEHAVIOUR = BEHAVIOURS[0]
LOG_LEVELS = ('debug', 'info', 'warn', 'error', 'fatal')
CONSOLE = 'console'
RECORDER, MARKERS, ALARM = 'mission_recorder', 'mission_markers', 'alarm'
FEW, ONE_EACH, ONE = 'few', 'one-each', 'one'
COMPOSITIONS = (FEW, ONE_EACH, ONE)
"""How a run's nodes are put into processes: by failure domain, each into its own, all into one."""


@dataclass(frozen=True)
class Node:
    """One node of the graph.

    Attributes:
        name: the node's ROS name, its executable's name and its name in the log.
        package: the ROS package, which is also the Python package.
        purpose: one line for `launch.py list`.
    """

    name: str
    package: str
    purpose: str

    @property
    def module(self) -> str:
        """The module with the node's class."""
        return f'{self.package}.{self.name}_node'

    @property
    def class_name(self) -> str:
        """The node's class: `ArmorServer`; `ConsoleNode` where the name itself is taken."""
        camel = self.name.title().replace('_', '')
        return f'{camel}Node' if self.name in (CONSOLE, 'mission_view') else camel

    @property
    def has_modes(self) -> bool:
        """Whether the node has an execution mode, and in MANUAL mode commands of its own."""
        return self.name in ('battery_controller', 'planner_controller', 'motion_controller')


_PURPOSES = {
    'surveillance_ontology': {
        'armor_server': 'ontologies and their reasoner, behind the ARMOR interface',
        'ontology_map_builder': 'loads the ontology and builds the map in it',
    },
    'surveillance_behaviour': {
        'robot_behavior': 'the state machine that patrols',
        'reasoner': 'answers which place comes next',
        'initial_state': 'looks around for markers and builds the ontology from them',
    },
    'surveillance_controllers': {
        'battery_controller': 'the battery: level, low warning, recharge',
        'planner_controller': 'paths between points and to places',
        'motion_controller': 'follows a path with the base',
        'collision_monitor': 'lets no command through to the base that the lidar does not allow',
        'explorer': 'drives through an unknown building and maps it',
    },
    'surveillance_operator': {
        CONSOLE: 'one prompt for a mission: answers, doors, rooms, why, go',
        ALARM: 'calls a person for what goes wrong, and keeps it in the log',
        'mission_view': 'shows a running mission in the terminal',
        'mission_markers': 'shows a running mission to RViz, Foxglove and rqt',
        'mission_page': 'shows a running mission in browsers',
        'mission_recorder': 'writes a recording that Foxglove and ros2 bag open',
    },
    'surveillance_simulation': {
        'simulator': 'the simulated place: base, lidar, arm, camera, doors',
    },
    'surveillance_perception': {
        'aruco_detector': 'finds ArUco markers in the camera picture',
        'marker_server': 'tells what place a marker stands for',
        'arm_controller': 'moves the arm that carries the camera',
        'observer': 'notices doors, things, markers and views that are not as they are to be',
        'video_source': 'a webcam, a video or pictures as the camera topic',
    },
}
NODES = tuple(
    Node(name, package, purpose)
    for package, purposes in _PURPOSES.items()
    for name, purpose in purposes.items()
)
BY_NAME = {node.name: node for node in NODES}
RESERVED = FOLDERS.union(BY_NAME)
"""What no robot of a fleet may be called: programs, and folders of a run."""

# What the first decision waits for comes first, so that it is ready first: the map, and the place
# that the robot is in, which takes the base's laser.
_FIRST = (
    'armor_server',
    'ontology_map_builder',
    'simulator',
    'motion_controller',
    'robot_behavior',
)
_START_ORDER = (
    *(BY_NAME[name] for name in _FIRST),
    *(node for node in NODES if node.name not in _FIRST),
)
_ALWAYS = (
    'robot_behavior',
    'armor_server',
    'ontology_map_builder',
    'battery_controller',
    'planner_controller',
    'motion_controller',
)
_OF_PATROL = (
    'reasoner',
    'initial_state',
    'simulator',
    'aruco_detector',
    'marker_server',
    'arm_controller',
)
_OF_BASE = ('simulator', 'collision_monitor')
_MONITOR = 'collision_monitor'
EXPLORER = 'explorer'
RUN_NODES = frozenset((*_ALWAYS, *_OF_PATROL, *_OF_BASE, EXPLORER))
"""The nodes of which a robot has one each."""


KNOWLEDGE, PATROL, RECORDS, TOGETHER = 'knowledge', 'patrol', 'records', 'composed'
_DOMAINS = {
    KNOWLEDGE: ('armor_server', 'ontology_map_builder'),
    PATROL: (
        *('robot_behavior', 'reasoner', 'initial_state'),
        *('battery_controller', 'planner_controller', 'motion_controller'),
        *('arm_controller', 'marker_server'),
    ),
    RECORDS: (ALARM, RECORDER, MARKERS),
}
_DOMAIN_OF = {node: name for name, nodes in _DOMAINS.items() for node in nodes}
PROCESSES = (*_DOMAINS, TOGETHER)
"""The names of processes that hold several nodes."""


def process_of(node: str, composition: str = FEW, *, ends_alone: bool = False) -> str:
    """Return the name of the process that a node of a run belongs to: a node's, or of `PROCESSES`.

    By failure domain, what has to go on without the others is apart: what guards the base, what
    knows, what tells and records. So is what strangers talk to (the page), and what computes long
    (pictures, the simulated place).

    Args:
        node: Its name.
        composition: One of `COMPOSITIONS`.
        ends_alone: Whether an operator may end this node and not the others.
    """
    if node in (RECORDER, MARKERS):
        return RECORDS
    if composition == ONE_EACH or (ends_alone and composition == FEW):
        return node
    domain = _DOMAIN_OF.get(node, node)
    looks_on = domain == RECORDS or BY_NAME[node].package == 'surveillance_operator'
    alone = (looks_on and node != CONSOLE) or node == 'observer'
    return TOGETHER if composition == ONE and not alone else domain


def by_process(
    nodes: Iterable[Node], composition: str = FEW, mode: str | None = None
) -> dict[str, list[Node]]:
    """Return the nodes of each process of a run, by its name, see `process_of`.

    Args:
        nodes: Those of the run.
        composition: One of `COMPOSITIONS`.
        mode: In MANUAL the console's `exit NODE` ends one that has modes.
    """
    members: dict[str, list[Node]] = {}
    for node in nodes:
        alone = mode == 'MANUAL' and node.has_modes
        name = process_of(node.name, composition, ends_alone=alone)
        members.setdefault(name, []).append(node)
    return members


SHARED = frozenset(
    ('armor_server', 'ontology_map_builder', 'simulator', 'mission_page', CONSOLE, ALARM)
)
"""The nodes that a fleet has once; each robot has the others in its namespace."""
_SHARED_NAMES = (
    *('armor_interface_srv', 'armor_interface_serialized_srv', 'fact_changes'),
    *(
        f'ontology_map/{name}'
        for name in (
            *('reference_name', 'built', 'room_position'),
            *('add_room', 'remove_room', 'set_door', 'set_place'),
        )
    ),
    *('map', 'door_states', 'place', 'fleet_robots', 'incidents'),
    *(
        f'simulation/{name}'
        for name in ('set_door', 'place_obstacle', 'remove_obstacle', 'set_marker', 'stage')
    ),
)


def shared_names(namespace: str | None) -> list[tuple[str, str]]:
    """Return from which name to which a robot of a fleet renames what all robots share.

    Args:
        namespace: The one that the shared nodes are in; None: none.
    """
    prefix = '/' + (namespace or '').strip('/')
    return [(name, f'{prefix.rstrip("/")}/{name}') for name in _SHARED_NAMES]


def name_for(robot: str, name: str) -> str:
    """Return how a topic or service of a robot is called, seen from the shared namespace.

    Args:
        robot: Its name in the fleet; empty: the one robot of that namespace.
        name: As the robot's own nodes call it.
    """
    return name if not robot or name[0] == '/' or name in _SHARED_NAMES else f'{robot}/{name}'


def find(name: str) -> Node:
    """Return the node called `name`.

    Raises:
        ValueError: there is no such node.
    """
    try:
        return BY_NAME[name]
    except KeyError:
        raise ValueError(f'unknown node {name!r}: expected {nearest(name, BY_NAME)}') from None


def select(
    mode: str,
    behaviour: str = DEFAULT_BEHAVIOUR,
    only: Iterable[str] = (),
    without: Iterable[str] = (),
    *,
    monitored: bool = True,
) -> tuple[Node, ...]:
    """Return the nodes that a run starts, in start order.

    Args:
        mode: one of `MODES`; SIMULATED adds the simulator and what guards its base, ROBOT the
            guard alone.
        behaviour: one of `BEHAVIOURS`; patrol adds what learns the place from its markers.
        only: if not empty, exactly these nodes, also ones that the mode would not start.
        without: nodes to leave out, because they run elsewhere.
        monitored: whether the base is guarded here; Nav2 does it itself.

    Raises:
        ValueError: an unknown name, or nothing is left to start.
    """
    wanted = {find(name).name for name in only}
    left_out = {find(name).name for name in without}
    if not wanted:
        wanted = set(_ALWAYS)
        if behaviour == 'patrol':
            wanted.update(_OF_PATROL)
        if mode in ('SIMULATED', 'ROBOT'):
            wanted.update(_OF_BASE)
        if mode == 'ROBOT':
            wanted.discard('simulator')
        if not monitored:
            wanted.discard(_MONITOR)
    chosen = tuple(node for node in _START_ORDER if node.name in wanted - left_out)
    if not chosen:
        raise ValueError('no node is left to start: check --only and --without')
    return chosen
