"""The ARMOR directive service without ROS: what a directive means and what it answers.

    service = ArmorService(Settings(), store=Store(folder))
    client = ArmorClient('me', 'map', InProcessTransport(service))

`ArmorService` takes a `DirectiveRequest` and returns a `DirectiveResponse`; it never raises.
`ArmorClient` builds directives and reads answers over any transport. The node and the ROS transport
stand outside: `surveillance_ontology.armor_server_node`, `surveillance_ontology.armor_client`.

Modules, from the bottom: `protocol` (requests, answers), `rendering` and `facts` (texts),
`reference` (a loaded ontology), `store` (what outlives the process), `access` (limits and files),
`session` (all of these together), `directives` (what each directive does), `service` (dispatch and
locks) and `client`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from surveillance_ontology.armor.access import Settings
    from surveillance_ontology.armor.client import (
        ArmorClient,
        ArmorServiceCallError,
        ArmorServiceInternalError,
        InProcessTransport,
    )
    from surveillance_ontology.armor.protocol import (
        DirectiveRequest,
        DirectiveResponse,
        ExitCode,
        name_in,
        value_in,
    )
    from surveillance_ontology.armor.service import ArmorService
    from surveillance_ontology.armor.store import Store

_HOMES = {
    'access': ('Settings',),
    'client': (
        'ArmorClient',
        'ArmorServiceCallError',
        'ArmorServiceInternalError',
        'InProcessTransport',
    ),
    'protocol': ('DirectiveRequest', 'DirectiveResponse', 'ExitCode', 'name_in', 'value_in'),
    'service': ('ArmorService',),
    'store': ('Store',),
}
__all__ = [
    'ArmorClient',
    'ArmorService',
    'ArmorServiceCallError',
    'ArmorServiceInternalError',
    'DirectiveRequest',
    'DirectiveResponse',
    'ExitCode',
    'InProcessTransport',
    'Settings',
    'Store',
    'name_in',
    'value_in',
]


def __getattr__(name: str) -> Any:
    # Late, so that a node that is a client only does not load the reasoner.
    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f'{__name__}.{module}'), name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
