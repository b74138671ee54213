"""Fixtures for the controllers' tests: an operator who types into a pipe, a flat with a lidar."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TextIO

import pytest

from lidar_navigation.testing import Flat
from surveillance_simulation.world.simulated_place import SimulatedPlace
from tests import places
from tests.controllers import nav2_servers
from tests.places import seven_rooms_parameters


class Operator:
    """Types lines into a controller's pipe."""

    def __init__(self) -> None:
        read, write = os.pipe()
        self.source: TextIO = os.fdopen(read)
        self._keyboard: TextIO = os.fdopen(write, 'w')

    def type(self, line: str) -> None:
        """Types one line."""
        print(line, file=self._keyboard, flush=True)

    def hang_up(self) -> None:
        """End the input."""
        self._keyboard.close()

    def close(self) -> None:
        """Close both ends."""
        self.source.close()
        self._keyboard.close()


@pytest.fixture
def operator() -> Iterator[Operator]:
    """Provide an operator at a pipe; hand `operator.source` to a controller as its
    `console_source`.
    """
    operator = Operator()
    yield operator
    operator.close()


@pytest.fixture
def in_background() -> Iterator[Callable[[Callable[[], Any]], Callable[[], Any]]]:
    """Run work on a thread; give a function that waits for what the work returned or raised."""
    with ThreadPoolExecutor() as pool:

        def start(work: Callable[[], Any]) -> Callable[[], Any]:
            future = pool.submit(work)
            return lambda: future.result(60.0)

        yield start


@pytest.fixture
def seven_rooms() -> dict[str, Any]:
    """Provide the seven rooms' file as flat parameter overrides."""
    return seven_rooms_parameters()


@pytest.fixture
def flat() -> Flat:
    """Two rooms and a lidar in them."""
    return Flat()


@pytest.fixture
def seven_rooms_world() -> SimulatedPlace:
    """Provide the seven rooms, as simulated."""
    return places.seven_rooms()


@pytest.fixture
def servers(monkeypatch: pytest.MonkeyPatch) -> nav2_servers.Servers:
    """Provide servers of Nav2 that answer as told."""
    return nav2_servers.scripted(monkeypatch)


@pytest.fixture
def run() -> nav2_servers.Run:
    """Provide a goal's run whose time passes when somebody sleeps."""
    return nav2_servers.Run()
