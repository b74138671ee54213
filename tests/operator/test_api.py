"""The interface is described as it is served."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.operator.page_door import Door


@pytest.fixture
def door(tmp_path: Path) -> Iterator[Door]:
    door = Door(tmp_path)
    yield door
    door.page.stop()


def test_metrics_and_the_description_of_the_interface_are_served(door: Door) -> None:
    assert door.send('/metrics') == (200, 'up 1\n')
    _, described = door.send('/openapi.json')
    assert described['openapi'].startswith('3.1')
    act = described['paths']['/act/alarm']['post']
    schema = act['requestBody']['content']['application/json']['schema']
    assert schema['required'] == ['verb', 'key']
    assert 'by' not in schema['properties']
    assert act['summary'] == 'Answer an alarm.'
    assert {'/ask/search', '/get/metrics', '/events', '/act/go'} <= described['paths'].keys()
