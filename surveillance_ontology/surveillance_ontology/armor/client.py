"""The Python client of ARMOR's services, with the method names of ARMOR's own Python API.

    client = ArmorClient('planner', 'map', InProcessTransport(service))
    client.manipulation.add_objectprop_to_ind('hasDoor', 'R1', 'D1')
    client.utils.sync_buffered_reasoner()
    client.query.objectprop_b2_ind('canReach', 'Robot1')         # ['C1', 'C2']

Every method can also be awaited: ``await client.query.ind_b2_class.call_async('ROOM')``. The client
for ROS is `surveillance_ontology.armor_client.ArmorClient`; this module knows no ROS.
"""

from __future__ import annotations

from collections.abc import Sequence

from surveillance_ontology.armor.client_manipulation import Manipulation
from surveillance_ontology.armor.client_query import Query, name_in, value_in
from surveillance_ontology.armor.client_utilities import Utils
from surveillance_ontology.armor.operations import (
    ArmorServiceCallError,
    ArmorServiceInternalError,
    Steps,
    Transport,
    operation,
)
from surveillance_ontology.armor.protocol import DirectiveRequest, DirectiveResponse, ListResponse

__all__ = [
    'ArmorClient',
    'ArmorServiceCallError',
    'ArmorServiceInternalError',
    'name_in',
    'value_in',
]


class ArmorClient:
    """A client of one reference.

    Args:
        client_id: Name of this client; matters for mounting only.
        reference_name: The ontology that its directives mean.
        transport: How they travel.

    Attributes:
        manipulation: Directives that change the ontology.
        query: Directives that ask.
        utils: Directives about references, files and logging.
    """

    def __init__(self, client_id: str, reference_name: str, transport: Transport) -> None:
        self.client_id = client_id
        self.reference_name = reference_name
        self.transport = transport
        self.manipulation = Manipulation(self)
        self.query = Query(self)
        self.utils = Utils(self)

    def request(self, words: str, *args: str) -> DirectiveRequest:
        """Make a directive, ``request('ADD IND CLASS', 'R1', 'ROOM')``, for example for `batch`."""
        command, primary, secondary, *_ = (*words.split(), '', '', '')
        return DirectiveRequest(
            self.client_id, self.reference_name, command, primary, secondary, args
        )

    @operation
    def call(
        self, command: str, first_spec: str, second_spec: str, args_list: Sequence[str]
    ) -> Steps[DirectiveResponse]:
        """Carry out any directive; the response also when it is no success."""
        response: DirectiveResponse = yield DirectiveRequest(
            self.client_id, self.reference_name, command, first_spec, second_spec, args_list
        )
        return response

    @operation
    def batch(self, requests: Sequence[DirectiveRequest]) -> Steps[ListResponse]:
        """Carry out directives in order, with no other client's in between."""
        answer: ListResponse = yield requests
        return answer
