"""A simulator of two rooms in the test graph."""

from __future__ import annotations

from typing import Any

from surveillance_simulation.simulator_node import Simulator
from tests.places import TWO_ROOMS, flat


def simulator(graph: Any, **parameters: Any) -> Simulator:
    described = flat(TWO_ROOMS) | {'speed': 20.0, 'base.distance_error': 0.0} | parameters
    return graph.add(Simulator, parameters=described | {'base.turn_error': 0.0})


def ask(graph: Any, kind: Any, service: str, **request: Any) -> Any:
    client = graph.node.create_client(kind, f'simulation/{service}')
    assert client.wait_for_service(60.0)
    future = client.call_async(kind.Request(**request))
    return graph.until(lambda: future.done() and future.result())
