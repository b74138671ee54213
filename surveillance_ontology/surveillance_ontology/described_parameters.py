"""What the nodes' parameters describe: a directive service, and a place."""

from __future__ import annotations

from pathlib import Path

from surveillance_ontology.armor.journal import JournalError
from surveillance_ontology.armor.service import ArmorService
from surveillance_ontology.armor.settings import Settings
from surveillance_ontology.armor.store import Store
from surveillance_runtime.node import PatrolNode, StartError
from surveillance_runtime.place import Place, PlaceError, make_place

CHOICES = {
    'enforce_mount': 'Refuse changes by others while a client is mounted; ARMOR 2.2 does not.',
    'narrow_doubles': 'Store values of type DOUBLE as xsd:float, as ARMOR 2.2 does.',
    'allow_web': 'Let LOAD WEB fetch documents from the web.',
    'sparql_derived': 'Let SPARQL see derived facts; ARMOR 2.2 shows it the asserted ones only.',
}


def described_service(node: PatrolNode) -> ArmorService:
    """Make the service that a node's parameters describe; it logs through the node.

    Raises:
        ParameterError: A parameter is of the wrong type or out of range.
        StartError: The store cannot be used.
    """
    default = Settings()
    directories = node.parameter(
        'directories',
        ['.'],
        'Directories inside which LOAD, SAVE and LOG may read and write files.',
        check=lambda value: None if value and all(value) else 'names of directories',
    )
    sparql_timeout = node.parameter(
        'sparql_timeout',
        default.sparql_timeout,
        'Longest time a SPARQL query may take, seconds.',
        minimum=0.01,
        maximum=3600.0,
    )
    choices = {
        name: node.parameter(name, getattr(default, name), text) for name, text in CHOICES.items()
    }
    stored = node.parameter(
        'store',
        '',
        'Directory in which references and their changes are kept over a restart; empty: none.',
        read_only=True,
    )
    settings = Settings(directories=tuple(directories), sparql_timeout=sparql_timeout, **choices)
    log = node.get_logger()
    try:
        store = Store(Path(stored).expanduser()) if stored else None
        return ArmorService(settings, log.info, log.warn, store)
    except JournalError as error:
        raise StartError(f'{node.get_name()}: parameter store: {error}') from None


def described_place(node: PatrolNode) -> Place | None:
    """Make the place that a node's parameters describe; None when they describe none.

    Raises:
        ParameterError: A parameter is of the wrong type.
        StartError: What is described is not a place.
    """
    source = node.parameter(
        'map_source',
        'configuration',
        'Where the map comes from: the parameters, or ontology_map/build_map alone.',
        choices=('configuration', 'markers'),
        read_only=True,
    )
    if source == 'markers':
        return None
    rooms = node.parameters_under('map')
    positions = node.parameters_under('room_positions')
    robot_room = node.parameter('robot_room', '', 'Room in which the robot starts.')
    stations = node.parameter(
        'recharge_rooms', [], 'Rooms with a charging station; they are never removed.', of=str
    )
    if not rooms and not positions:
        return None
    try:
        return make_place(rooms, positions, robot_room, stations)
    except PlaceError as error:
        raise StartError(f'{node.get_name()}: parameter {error}') from None
