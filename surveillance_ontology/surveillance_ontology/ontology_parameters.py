"""The parameters of this package's nodes: a directive service, and a builder of maps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from surveillance_ontology.armor.access import DATA, Settings, state_folder
from surveillance_ontology.armor.service import ArmorService
from surveillance_ontology.armor.store import JournalError, Store
from surveillance_runtime.node import PatrolNode, StartError
from surveillance_runtime.parameters import parameter


def described_service(node: PatrolNode, *, keep: bool = False) -> ArmorService:
    """Make the service that a node's parameters describe; it logs through the node.

    Args:
        node: The node.
        keep: Whether the store is on by default.

    Raises:
        ParameterError: A parameter is of the wrong type or out of range.
        StartError: The store cannot be used.
    """
    settings = node.declare_fields(Settings())
    stored = node.parameter(
        'store',
        'auto' if keep else 'none',
        'Directory in which references and their changes are kept over a restart; auto: one for '
        "this domain and name in the user's state folder; none: nothing is kept.",
        read_only=True,
    )
    log = node.get_logger()
    folder = _own_folder(node) if stored == 'auto' else Path(stored).expanduser()
    try:
        store = None if stored in ('', 'none') else Store(folder)
        clock = node.get_clock()
        service = ArmorService(
            settings, log.info, log.warn, store, lambda: clock.now().nanoseconds * 1e-9
        )
        if store:
            kept = ', '.join(service.references.names()) or 'nothing'
            log.info(f'store {folder}, which holds {kept}; "-p store:=none" keeps nothing')
        return service
    except JournalError as error:
        raise StartError(f'{node.get_name()}: parameter store: {error}') from None


def _own_folder(node: PatrolNode) -> Path:
    name = node.get_fully_qualified_name().strip('/').replace('/', '.')
    return state_folder() / 'armor' / f'{node.context.get_domain_id()}.{name}'


@dataclass(frozen=True)
class BuilderSettings:
    """What `ontology_map_builder` is told by its parameters beside the place."""

    ontology_reference: str = parameter(
        'surveillance', 'Reference name of the ontology in the server.'
    )
    ontology_path: str = parameter(str(DATA / 'surveillance.owl'), 'The ontology to start from.')
    ontology_uri: str = parameter('http://bnc/exp-rob-lab/2022-23', 'IRI of the ontology.')
    armor_timeout: float = parameter(5.0, 'Longest wait for an answer of the server, seconds.', 0.1)
    urgent_at_start: bool = parameter(
        True,
        'Places that nobody has visited count as never visited, and so as URGENT; '
        'else as visited when the map was built.',
    )


def builder_settings(node: PatrolNode) -> BuilderSettings:
    """Declare what `ontology_map_builder` is told beside the place.

    Raises:
        ParameterError: A parameter is of the wrong type or out of range.
    """
    return node.declare_fields(BuilderSettings())
