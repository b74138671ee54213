"""Fixtures for the controllers' tests: an operator who types into a pipe."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TextIO

import pytest


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
        """Ends the input."""
        self._keyboard.close()

    def close(self) -> None:
        """Closes both ends."""
        self.source.close()
        self._keyboard.close()


@pytest.fixture
def operator() -> Iterator[Operator]:
    """An operator at a pipe; hand `operator.source` to a controller as its `console_source`."""
    operator = Operator()
    yield operator
    operator.close()


@pytest.fixture
def in_background() -> Iterator[Callable[[Callable[[], Any]], Callable[[], Any]]]:
    """Runs work on a thread; gives a function that waits for what the work returned or raised."""
    with ThreadPoolExecutor() as pool:

        def start(work: Callable[[], Any]) -> Callable[[], Any]:
            future = pool.submit(work)
            return lambda: future.result(10)

        yield start
