"""What the tests of the directive service share: the map, and short ways to ask."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from armor_service.client import ArmorClient
from armor_service.protocol import DirectiveRequest, DirectiveResponse
from armor_service.service import ArmorService

SEVEN_ROOMS = {
    'R1': ['D1'],
    'R2': ['D2'],
    'R3': ['D3'],
    'R4': ['D4'],
    'E': ['D6', 'D7'],
    'C1': ['D1', 'D2', 'D5', 'D6'],
    'C2': ['D3', 'D4', 'D5', 'D7'],
}
IRI = 'http://bnc/exp-rob-lab/2022-23'
FIXTURES = Path(__file__).parent / 'fixtures'
ONTOLOGY = str(FIXTURES / 'patrol.owl')
Ask = Callable[..., DirectiveResponse]


def iri(name: str) -> str:
    """Return a name of the patrol's ontology as ARMOR's answers have it."""
    return f'<{IRI}#{name}>'


def asker(service: ArmorService, reference: str = 'map', client: str = 'tester') -> Ask:
    """Return a short way to send directives: ``ask('ADD IND CLASS', 'R1', 'ROOM')``."""

    def ask(
        words: str, *args: str, client: str = client, reference: str = reference
    ) -> DirectiveResponse:
        command, primary, secondary, *_ = (*words.split(), '', '', '')
        return service.execute(
            DirectiveRequest(client, reference, command, primary, secondary, args)
        )

    return ask


def names(response: DirectiveResponse) -> list[str]:
    """Return the local names in an answer."""
    assert response.success, response
    return sorted(
        item.removeprefix(f'<{IRI}#').removesuffix('>') for item in response.queried_objects
    )


def build_seven_rooms(client: ArmorClient, buffered: bool, lazy: bool) -> None:
    """Build a map in the usual order: add, reason, tell apart, place the robot, reason."""
    client.utils.load_ref_from_file(ONTOLOGY, IRI, buffered, 'PELLET', lazy)
    for room, doors in SEVEN_ROOMS.items():
        for door in doors:
            client.manipulation.add_objectprop_to_ind('hasDoor', room, door)
        client.manipulation.add_dataprop_to_ind('visitedAt', room, 'LONG', '1665579740')
    client.utils.sync_buffered_reasoner()
    client.manipulation.disj_inds_of_class('ROOM')
    client.manipulation.disj_inds_of_class('DOOR')
    client.manipulation.add_objectprop_to_ind('isIn', 'Robot1', 'E')
    client.utils.sync_buffered_reasoner()


def reach(armor: ArmorClient) -> list[str]:
    """Return the places that the robot can reach, by the ontology."""
    return armor.query.objectprop_b2_ind('canReach', 'Robot1')
