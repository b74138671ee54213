"""The house's rules: what keeps one owner for each idea, as tests with tables of exceptions.

`python benchmarks/structure.py` prints the same figures. A table holds what does not keep a rule
today. Nothing may be added without a reason; what is mended is taken out, which the test asks for.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import pytest

from benchmarks import structure

CHECKOUT = Path(__file__).parents[1]
MODULES = structure.product(CHECKOUT)
LIBRARIES = {name for name, path in MODULES.items() if 'libs' in path.parts}

DOUBLE_NAMES: dict[str, str] = {
    'ArmorClient': 'the known name: over any transport, over ROS, and as armor_py_api has it',
    'Evidence': 'of an inequality, in the reasoner alone; of a scan, in localisation alone',
    'Kind': 'of an argument of a directive; of an observation',
    'Reasoner': 'what the machines need, and the node of that name behind it',
}
"""Class names that several modules use, each with its reason to stay; empty: to be renamed."""
LARGE_CLASSES = {
    'WorldOntology': 'axioms as quads, both ways, by one table of what is known of them',
    'CaseModel': 'the model of a tableau: its facts and what each hangs on',
    'CaseSearch': 'the search of a tableau',
    'Container': "SMACH's interface, and what all containers share",
    'Contexts': 'the algorithm: contexts and their queue',
    'DeskEvent': 'one row of the search, a field for each thing that logs say of an event',
    'DLClauses': 'the DL-clauses, a table each',
    'Event': 'one record that book, file and message hold, a field for each thing that is known',
    'Engine': 'the algorithm: one loop over shared indexes',
    'Frame': 'the loop that runs a machine',
    'GridPlanner': "one field of costs over a map's cells, and the search on it",
    'KnowledgeBase': "the library's face: a method a question",
    'ManchesterParser': 'a method a rule of the grammar',
    'PhysicsBase': 'a body of MuJoCo: handles of its parts',
    'ContainerProgram': 'a machine as the loop reads it',
    'Patrol': 'a simulated patrol: its settings and its state, a field each',
    'Program': 'the kinds of clauses, a list each',
    'Run': 'the options of the command line, a field each',
    'RdfMapper': 'one table from triples to axioms',
    'ThresholdIndex': 'one index, of which each part is a table',
    'Translation': 'one table from axioms to clauses',
}
"""Classes over the limits, with the reason for each."""
TO_BE_CUT = {
    'Drive',
    'Exploration',
    'Explorer',
    'Navigator',
    'RoomInspection',
}
"""Classes over the limits that own more than one thing."""
KNOWING_ROS = {
    'armor_api.__init__',
    'armor_api.armor_client',
    'surveillance_behaviour.map_from_markers.scan_peers',
    'surveillance_controllers.controller_parameters',
    'surveillance_controllers.manual.requests',
    'surveillance_controllers.map_knowledge',
    'surveillance_controllers.motion.arrival',
    'surveillance_controllers.motion.command_publisher',
    'surveillance_controllers.motion.docking',
    'surveillance_controllers.motion.goal_execution',
    'surveillance_controllers.motion.holding',
    'surveillance_runtime.stop_keeper',
    'surveillance_controllers.motion.door_teller',
    'surveillance_controllers.motion.nav2',
    'surveillance_controllers.motion.nav2_goals',
    'surveillance_controllers.motion.navigation_motion',
    'surveillance_controllers.motion.place_recording',
    'surveillance_controllers.motion.pose_reports',
    'surveillance_runtime.sensing.mount_watch',
    'surveillance_runtime.sensing.frames_heard',
    'surveillance_runtime.sensing.sensors',
    'surveillance_runtime.sensing.silence',
    'surveillance_runtime.sensing.transforms',
    'surveillance_controllers.planning.door_watch',
    'surveillance_controllers.planning.map_planner',
    'surveillance_controllers.stimuli',
    'surveillance_ontology.armor_client',
    'surveillance_operator.doctor_command',
    'surveillance_operator.motion_probe',
    'surveillance_operator.fleet_actions',
    'surveillance_operator.fleet_command',
    'surveillance_operator.fleet_subscriber',
    'surveillance_operator.hand_driving',
    'surveillance_operator.images',
    'surveillance_operator.mission_actions',
    'surveillance_operator.mission_questions',
    'surveillance_operator.mission_subscriber',
    'surveillance_operator.node_graph_watch',
    'surveillance_operator.other_poses',
    'surveillance_operator.polled_subscription',
    'surveillance_operator.recording.stored',
    'surveillance_operator.sightings',
    'surveillance_operator.stop_button',
    'surveillance_operator.topic_reader',
    'surveillance_operator.urdf_command',
    'surveillance_operator.watch.view',
    'surveillance_operator.watch_command',
    'surveillance_perception.arm_commands',
    'surveillance_perception.observing.event_facts_writer',
    'surveillance_perception.observing.fleet_positions',
    'surveillance_perception.observing.observer_worker',
    'surveillance_perception.stream.image_subscription',
    'surveillance_runtime.diagnostics',
    'surveillance_runtime.executor',
    'surveillance_runtime.fleet_messages',
    'surveillance_runtime.graph_check',
    'surveillance_runtime.health',
    'surveillance_runtime.incident_topic',
    'surveillance_runtime.introspection',
    'surveillance_runtime.logging',
    'surveillance_runtime.machine_messages',
    'surveillance_runtime.duplicate_nodes',
    'surveillance_runtime.node',
    'surveillance_runtime.periods',
    'surveillance_runtime.place_changes',
    'surveillance_runtime.process',
    'surveillance_runtime.qos',
    'surveillance_runtime.fresh_images',
    'surveillance_runtime.state_file',
    'surveillance_runtime.waiting',
}
"""Modules that load ROS though their name does not say so (`_node`, `conversions`, `ros/` ...)."""
PAST_THE_FACE = {
    'owl_reasoner.documents.mapping',
    'owl_reasoner.documents.rdf_xml',
    'owl_reasoner.documents.structural',
    'owl_reasoner.documents.triples',
    'owl_reasoner.documents.xml_reading',
    'owl_reasoner.gc_control',
    'owl_reasoner.owlready.quads',
    'owl_reasoner.reasoner.budget',
    'owl_reasoner.reasoner.datatypes',
    'owl_reasoner.reasoner.endless_rules',
    'owl_reasoner.reasoner.explanation',
    'owl_reasoner.reasoner.non_entailment',
}
"""Modules of libraries that others import and that the library does not call public."""
WITHOUT_TESTS = CHECKOUT / 'tests' / 'modules_without_tests.txt'
"""Modules without a test file of their name, a line each: to be shortened."""


@cache
def trees() -> dict[str, ast.Module]:
    """Return the modules, parsed: once, and not where no rule is looked at."""
    return {name: ast.parse(path.read_text(encoding='utf-8')) for name, path in MODULES.items()}


def check(found: Iterable[str], table: Iterable[str], rule: str) -> None:
    """Compare what breaks a rule with its table of exceptions."""
    fresh, gone = sorted(set(found) - set(table)), sorted(set(table) - set(found))
    assert not fresh, f'{rule}: {", ".join(fresh)}'
    assert not gone, f'mended, so take it out of the table in {Path(__file__).name}: {gone}'


def test_a_class_name_has_one_meaning() -> None:
    doubles = structure.double_names(trees())
    check(doubles, DOUBLE_NAMES, 'a class of that name stands elsewhere; give it its own')


def test_a_large_class_has_a_reason() -> None:
    large = {name.rpartition('.')[2]: size for name, size in structure.owning_much(trees()).items()}
    limits = f'over {structure.MOST_ATTRIBUTES} attributes or {structure.MOST_LINES} lines'
    check(large, {*LARGE_CLASSES, *TO_BE_CUT}, f'{limits}: cut it by what it owns')


def test_libraries_import_no_robot() -> None:
    assert structure.upward(trees(), LIBRARIES, set(MODULES) - LIBRARIES) == []


def test_the_core_loads_no_ros() -> None:
    by_name = re.compile(r'(_node|conversions|topics)$|\.(ros|ros_adapters|feeds)\.')
    found = {name for name in structure.loading_ros(trees()) if not by_name.search(name)}
    check(found, KNOWING_ROS, 'loads ROS: hand it plain values, or say in the table why not')


def test_no_library_loads_ros_but_for_its_part_for_ros() -> None:
    found = structure.loading_ros(trees()) & LIBRARIES
    assert {name for name in found if not name.startswith('state_machines.ros.')} == set()


def test_a_library_is_used_by_its_face() -> None:
    rule = 'is not public: import the name from the library, or name the module in its __init__'
    check(structure.past_the_face(trees(), MODULES), PAST_THE_FACE, rule)


@pytest.mark.parametrize('library', sorted({name.split('.')[0] for name in LIBRARIES}))
def test_what_a_library_calls_public_is_there(library: str) -> None:
    for name in structure.public_modules(trees()[f'{library}.__init__']):
        inner = f'{library}.{name}'
        assert {inner, f'{inner}.__init__'} & set(MODULES), f'{library}.__init__ names {name}'


def test_a_module_has_tests_of_its_name() -> None:
    _, lacking = structure.named_tests(MODULES)
    fresh = lacking - set(WITHOUT_TESTS.read_text(encoding='utf-8').split())
    assert not fresh, f'no test_<module>.py: {", ".join(sorted(fresh))}'
