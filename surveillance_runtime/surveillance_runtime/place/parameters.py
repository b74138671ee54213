"""A place from a node's parameters, in the form of a place's file."""

from __future__ import annotations

from dataclasses import dataclass

from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError, parameter
from surveillance_runtime.place import Place, PlaceError, make_place


@dataclass(frozen=True)
class PlaceSettings:
    """Parameters of the place that describe no room."""

    map_source: str = parameter(
        'configuration',
        'Where the map comes from: the parameters, or the markers that the robot finds.',
        choices=('configuration', 'markers'),
    )
    robot_room: str = parameter(
        '', 'Room in which the robot starts; empty with markers: the one nearest to it.'
    )
    recharge_rooms: tuple[str, ...] = parameter(
        (), 'Rooms with a charging station; they are never removed.', of=str
    )


def described_place(
    node: PatrolNode, source: str = 'configuration', *, required: bool = False
) -> Place | None:
    """Declare where the map comes from, and make the place that the parameters describe.

    Args:
        node: The node.
        source: Default of the parameter `map_source`.
        required: Whether the parameters must describe one if that is where the map comes from.

    Returns:
        None when the map comes from markers, or when none is described and none required.

    Raises:
        ParameterError: A parameter is of the wrong type, or what is described is not a place.
    """
    settings = node.declare_fields(PlaceSettings(source))
    if settings.map_source == 'markers':
        return None
    rooms, positions = node.parameters_under('map'), node.parameters_under('room_positions')
    if not rooms and not positions and not required:
        return None
    try:
        return make_place(rooms, positions, settings.robot_room, settings.recharge_rooms)
    except PlaceError as error:
        raise ParameterError(f'{node.get_name()}: parameter {error}') from None
