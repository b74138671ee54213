"""The nodes of the robot: where each one lives, what it is for, and which of them a run starts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from surveillance_runtime.suggestions import nearest

MODES = ('SIMULATED', 'RANDOM', 'MANUAL')
DEFAULT_MODE = 'SIMULATED'
BEHAVIOURS = ('surveillance', 'patrol')
LOG_LEVELS = ('debug', 'info', 'warn', 'error', 'fatal')
CONSOLE = 'console'


@dataclass(frozen=True)
class Node:
    """One node of the graph.

    Attributes:
        name: the node's ROS name, its executable's name and its name in the log.
        package: the ROS package, which is also the Python package.
        class_name: the node's class in `<package>.<name>_node`.
        purpose: one line for `launch.py list`.
        console: the first word of the operator's commands in MANUAL mode, empty without a console.
    """

    name: str
    package: str
    class_name: str
    purpose: str
    console: str = ''

    @property
    def module(self) -> str:
        return f'{self.package}.{self.name}_node'


# In start order: what the first decision waits for comes first, so that it is ready first.
NODES = (
    Node(
        'armor_server',
        'surveillance_ontology',
        'ArmorServer',
        'ontologies and their reasoner, behind the ARMOR interface',
    ),
    Node(
        'ontology_map_builder',
        'surveillance_ontology',
        'OntologyMapBuilder',
        'loads the ontology and builds the map in it',
    ),
    Node(
        'robot_behavior',
        'surveillance_behaviour',
        'RobotBehavior',
        'the state machine that patrols',
    ),
    Node(
        'battery_controller',
        'surveillance_controllers',
        'BatteryController',
        'the battery: level, low warning, recharge',
        console='battery',
    ),
    Node(
        'planner_controller',
        'surveillance_controllers',
        'PlannerController',
        'paths between points and to places',
        console='plan',
    ),
    Node(
        'motion_controller',
        'surveillance_controllers',
        'MotionController',
        'follows a path with the base',
        console='move',
    ),
    Node(
        'collision_monitor',
        'surveillance_controllers',
        'CollisionMonitor',
        'lets no command through to the base that the lidar does not allow',
    ),
    Node(
        CONSOLE,
        'surveillance_operator',
        'ConsoleNode',
        'one prompt for a mission: answers, doors, rooms, why, go',
    ),
    Node(
        'reasoner',
        'surveillance_behaviour',
        'Reasoner',
        'answers which place comes next',
    ),
    Node(
        'initial_state',
        'surveillance_behaviour',
        'InitialState',
        'looks around for markers and builds the ontology from them',
    ),
    Node(
        'mission_view',
        'surveillance_operator',
        'MissionViewNode',
        'shows a running mission in the terminal',
    ),
    Node(
        'mission_markers',
        'surveillance_operator',
        'MissionMarkers',
        'shows a running mission to RViz, Foxglove and rqt',
    ),
    Node(
        'mission_page',
        'surveillance_operator',
        'MissionPage',
        'shows a running mission in browsers',
    ),
    Node(
        'mission_recorder',
        'surveillance_operator',
        'MissionRecorder',
        'writes a recording that Foxglove and ros2 bag open',
    ),
    Node(
        'simulator',
        'surveillance_simulation',
        'Simulator',
        'the simulated place: base, lidar, arm, camera, doors',
    ),
    Node(
        'aruco_detector',
        'surveillance_perception',
        'ArucoDetector',
        'finds ArUco markers in the camera picture',
    ),
    Node(
        'marker_server',
        'surveillance_perception',
        'MarkerServer',
        'tells what place a marker stands for',
    ),
    Node(
        'arm_controller',
        'surveillance_perception',
        'ArmController',
        'moves the arm that carries the camera',
    ),
    Node(
        'video_source',
        'surveillance_perception',
        'VideoSource',
        'a webcam, a video or pictures as the camera topic',
    ),
)
BY_NAME = {node.name: node for node in NODES}

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
RUN_NODES = frozenset((*_ALWAYS, *_OF_PATROL, *_OF_BASE))
"""The nodes of which a robot has one each."""


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
    behaviour: str = 'surveillance',
    only: Iterable[str] = (),
    without: Iterable[str] = (),
) -> tuple[Node, ...]:
    """Return the nodes that a run starts, in start order.

    Args:
        mode: one of `MODES`; SIMULATED adds the simulator and what guards its base.
        behaviour: one of `BEHAVIOURS`; patrol adds what learns the place from its markers.
        only: if not empty, exactly these nodes, also ones that the mode would not start.
        without: nodes to leave out, because they run elsewhere.

    Raises:
        ValueError: an unknown name, or nothing is left to start.
    """
    wanted = {find(name).name for name in only}
    left_out = {find(name).name for name in without}
    if not wanted:
        wanted = set(_ALWAYS)
        if behaviour == 'patrol':
            wanted.update(_OF_PATROL)
        if mode == 'SIMULATED':
            wanted.update(_OF_BASE)
    chosen = tuple(node for node in NODES if node.name in wanted - left_out)
    if not chosen:
        raise ValueError('no node is left to start: check --only and --without')
    return chosen
