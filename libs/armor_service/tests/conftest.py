"""A directive service on the patrol's own ontology, and a client of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest

from armor_service.access import Settings
from armor_service.client import ArmorClient, InProcessTransport
from armor_service.service import ArmorService

from .seven_rooms import FIXTURES, IRI, ONTOLOGY, Ask, asker

hypothesis.settings.register_profile(
    'alone',
    deadline=None,
    derandomize=True,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
if hypothesis.settings.get_current_profile_name() == 'default':
    hypothesis.settings.load_profile('alone')


@pytest.fixture
def service(tmp_path: Path) -> Iterator[ArmorService]:
    """Provide a service that may read and write in the test's directory and read the fixtures."""
    made = ArmorService(
        Settings(
            ontologies_folder=tmp_path,
            read_only_directories=(FIXTURES,),
            overwrite_loaded=True,
        ),
        screen=lambda _: None,
        warn=lambda _: None,
    )
    yield made
    made.close()


@pytest.fixture
def ask(service: ArmorService) -> Ask:
    """Send directives to a service that has the patrol's ontology as `map`, nothing buffered."""
    send = asker(service)
    loaded = send('LOAD FILE', ONTOLOGY, IRI, 'false', 'PELLET', 'false')
    assert loaded.success, loaded
    return send


@pytest.fixture
def client(service: ArmorService) -> ArmorClient:
    """Provide a client of the reference `map`, which is not loaded yet."""
    return ArmorClient('tester', 'map', InProcessTransport(service))
