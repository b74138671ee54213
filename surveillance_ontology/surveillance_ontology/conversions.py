"""Between messages and the plain types of this package; no other module builds their messages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from armor_service import protocol
from armor_service.facts import ShortFact
from armor_service.protocol import DirectiveRequest, DirectiveResponse
from surveillance_interfaces.msg import (
    ArmorDirectiveReq,
    ArmorDirectiveRes,
    Fact,
    FactChange,
    FactChanges,
    OntologyPlace,
    QueryItem,
)
from surveillance_ontology.map_keeper import RoomNote
from surveillance_runtime.conversions import point_from

if TYPE_CHECKING:
    from armor_service.changes import NumberedChange  # A client needs none of it.


def request_from_ros(msg: ArmorDirectiveReq) -> DirectiveRequest:
    """Read a directive."""
    return DirectiveRequest(
        msg.client_name,
        msg.reference_name,
        msg.command,
        msg.primary_command_spec,
        msg.secondary_command_spec,
        msg.args,
    )


def request_to_ros(request: DirectiveRequest) -> ArmorDirectiveReq:
    """Write a directive."""
    return ArmorDirectiveReq(
        client_name=request.client_name,
        reference_name=request.reference_name,
        command=request.command,
        primary_command_spec=request.primary,
        secondary_command_spec=request.secondary,
        args=list(request.args),
    )


def response_from_ros(msg: ArmorDirectiveRes) -> DirectiveResponse:
    """Read an answer."""
    return DirectiveResponse(
        success=msg.success,
        timeout=msg.timeout,
        exit_code=msg.exit_code,
        error_description=msg.error_description,
        is_consistent=msg.is_consistent,
        queried_objects=list(msg.queried_objects),
        sparql_queried_objects=[
            protocol.QueryItem(item.key, item.value) for item in msg.sparql_queried_objects
        ],
    )


def fill_response(msg: ArmorDirectiveRes, response: DirectiveResponse) -> ArmorDirectiveRes:
    """Write an answer into a message that has its default values."""
    msg.success = response.success
    msg.is_consistent = response.is_consistent
    if response.queried_objects:
        msg.queried_objects = response.queried_objects
    if response.error_description:
        msg.error_description = response.error_description
    if response.exit_code:
        msg.exit_code = response.exit_code
    if response.timeout:
        msg.timeout = True
    if response.sparql_queried_objects:
        items = response.sparql_queried_objects
        msg.sparql_queried_objects = [QueryItem(key=key, value=value) for key, value in items]
    return msg


def changes_to_ros(change: NumberedChange) -> FactChanges:
    """Write a batch of changed facts. The stamp stays zero."""
    changes = [
        FactChange(
            fact=Fact(predicate=fact.predicate, arguments=list(fact.arguments)),
            added=came,
            derived=derived,
        )
        for fact, came, derived in change.facts()
    ]
    return FactChanges(
        reference_name=change.reference_name,
        sequence=change.sequence,
        changes=changes,
        is_consistent=change.is_consistent,
    )


def changes_from_ros(msg: FactChanges) -> Sequence[tuple[ShortFact, bool, bool]]:
    """Read the changed facts of a batch: each with whether it came, and whether it is derived."""
    return [
        (ShortFact(c.fact.predicate, tuple(c.fact.arguments)), c.added, c.derived)
        for c in msg.changes
    ]


def room_note_from_ros(msg: OntologyPlace) -> RoomNote:
    """Read the description of a room."""
    connections = tuple((c.connected_to, c.through_door) for c in msg.connections)
    return RoomNote(msg.name, point_from(msg.position), connections)
