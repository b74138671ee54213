"""The ARMOR directive service without ROS: what a directive means and what it answers.

    service = ArmorService(Settings(), store=Store(folder))
    client = ArmorClient('me', 'map', InProcessTransport(service))

`ArmorService` takes a `DirectiveRequest` and returns a `DirectiveResponse`; it never raises.
`ArmorClient` builds directives and reads answers over any transport. The node and the ROS transport
stand outside: `surveillance_ontology.armor_server_node`, `surveillance_ontology.armor_client`.

Begin with `python -m armor_service.demo`, then `service` and `directives.table`. From the bottom:
`protocol` (requests, answers), `rendering` and `facts` (texts), `changes` (of an ontology),
`quarantine`, `reference` and `registry` (loaded ontologies), `store` (what outlives the process),
`names` and `doubtful_rules` (what was probably not meant), `access` (limits and files), `workspace`
(all of these: what directives act on), `directives` (what each does), `service` (dispatch and
locks) and `client`.

Public modules: `access`, `changes`, `client`, `facts`, `protocol`, `service`, `store.store`,
`turns`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from armor_service.access import Settings as Settings
    from armor_service.client import ArmorClient as ArmorClient
    from armor_service.client import ArmorServiceCallError as ArmorServiceCallError
    from armor_service.client import (
        ArmorServiceInternalError as ArmorServiceInternalError,
    )
    from armor_service.client import InProcessTransport as InProcessTransport
    from armor_service.protocol import DirectiveRequest as DirectiveRequest
    from armor_service.protocol import DirectiveResponse as DirectiveResponse
    from armor_service.protocol import ExitCode as ExitCode
    from armor_service.protocol import name_in as name_in
    from armor_service.protocol import value_in as value_in
    from armor_service.service import ArmorService as ArmorService
    from armor_service.store.store import Store as Store

_HOME = {
    'ArmorClient': 'client',
    'ArmorService': 'service',
    'ArmorServiceCallError': 'client',
    'ArmorServiceInternalError': 'client',
    'DirectiveRequest': 'protocol',
    'DirectiveResponse': 'protocol',
    'ExitCode': 'protocol',
    'InProcessTransport': 'client',
    'Settings': 'access',
    'Store': 'store.store',
    'name_in': 'protocol',
    'value_in': 'protocol',
}
__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    # Late, so that a node that is a client only does not load the reasoner.
    if name not in _HOME:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_HOME[name]}'), name)
