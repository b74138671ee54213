"""A transport for `client.ArmorClient` to a service in the same process, for tests and tools."""

from __future__ import annotations

from surveillance_ontology.armor.operations import Batch
from surveillance_ontology.armor.protocol import DirectiveRequest, DirectiveResponse, ListResponse
from surveillance_ontology.armor.service import ArmorService


class InProcessTransport:
    """Brings directives to a service in this process."""

    def __init__(self, service: ArmorService) -> None:
        self._service = service

    def call(self, request: DirectiveRequest) -> DirectiveResponse:
        """Carry out one directive."""
        return self._service.execute(request)

    def call_list(self, requests: Batch) -> ListResponse:
        """Carry out a batch."""
        return self._service.execute_list(requests)

    async def call_async(self, request: DirectiveRequest) -> DirectiveResponse:
        """Carry out one directive."""
        return self._service.execute(request)

    async def call_list_async(self, requests: Batch) -> ListResponse:
        """Carry out a batch."""
        return self._service.execute_list(requests)
