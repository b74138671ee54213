"""The words of the patrol's ontology, and what they mean.

This is the only module that spells them (``isIn``, ``visitedAt``, ``now``, ...) and the robot's
name. `map_ontology.MapOntology` enters rooms and doors, `robot_ontology.RobotOntology` is what one
robot tells and asks.
"""

from __future__ import annotations

from pathlib import Path

from floor_plans import Place, PlaceError

LOCATION, ROOM, DOOR = 'LOCATION', 'ROOM', 'DOOR'
"""Classes: of all places, of rooms (corridors are rooms, too), of doors."""
HAS_DOOR, CONNECTED_TO = 'hasDoor', 'connectedTo'
"""A place and its doors; places that have a door in common, which follows."""
IS_IN, CAN_REACH = 'isIn', 'canReach'
"""Where a robot is; where it can go from there in one move, which follows."""
VISITED_AT, SEEN_AT, NOW = 'visitedAt', 'seenAt', 'now'
"""When a place was visited last, seconds; when a robot was seen in its place, nanoseconds of ROS
time; what time it is for a robot, seconds."""
URGENCY_THRESHOLD, ACCEPTED_WAIT = 'urgencyThreshold', 'acceptedWait'
"""After how many seconds without a visit a place becomes URGENT: for the robot, or a place that has
a threshold of its own; and for a place without, where the robot's is longer than is usual."""
COVERED = 'covered'
"""How much of a place's floor was in view within its threshold, whole percent."""
DATA = Path(__file__).resolve().parent / 'data'
"""The ontologies that come with this package."""
ONTOLOGY = DATA / 'surveillance.owl'
"""The ontology that a patrol starts from."""
ROBOT = 'Robot1'
"""The robot's name where nobody gives another one."""
NEVER = 0
"""The time of visit of a place that nobody has visited yet, seconds, or any time before."""
LONGEST_THRESHOLD = 10**9
"""The longest time without a visit after which a place may become URGENT, seconds."""
PLACES = 'LOCATION(?)'
"""The places, as a pattern of facts for a query or a subscription."""
URGENT_PLACES = 'URGENT(?)'
"""The places that are due for a visit."""
VISITS = 'visitedAt(?, ?)'
"""When each place was visited last, seconds."""
CONNECTIONS = 'connectedTo(?, ?)'
"""Which places have a door in common."""
DOORS = 'hasDoor(?, ?)'
"""Which doors a place has: what changes with the map and its closed doors."""


class OntologyNotReadyError(Exception):
    """The ontology, or the map in it, does not answer, does not know (yet) what was asked for, or
    contradicts itself; the text is one line.
    """


def checked_names(place: Place, robot: str = ROBOT) -> Place:
    """Return the place, whose names the ontology has for nothing else.

    Raises:
        PlaceError: A room or a door has the robot's name, which would make the robot a place.
    """
    for room, doors in place.rooms.items():
        if robot in (room, *doors):
            raise PlaceError(('map', room), f"'{robot}' is the robot's name: expected another one")
    return place


def facts_of(place: str) -> tuple[str, ...]:
    """Return the patterns of what can hold of a place, those that change most often first."""
    return (
        f'URGENT({place})',
        f'ROOM({place})',
        f'CORRIDOR({place})',
        f'LOCATION({place})',
        f'isIn(?, {place})',
        f'canReach(?, {place})',
        f'visitedAt({place}, ?)',
        f'covered({place}, ?)',
        f'hasDoor({place}, ?)',
        f'connectedTo({place}, ?)',
    )


def never_visited(now: int) -> int:
    """Return a time of visit that stands for none, so that the place is URGENT from the start.

    By the machine's clock that is `NEVER`. A simulated clock may begin at 0, where even `NEVER` is
    no longer ago than any threshold.

    Args:
        now: The present time, seconds.
    """
    return min(NEVER, now - LONGEST_THRESHOLD - 1)
