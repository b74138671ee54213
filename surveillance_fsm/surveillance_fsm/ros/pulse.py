"""Whether the executor that must bring a node's answers still spins."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from rclpy.node import Node

from surveillance_runtime.interrupt import Interrupt


class ExecutorPulse:
    """Feels for an executor's pulse while somebody waits for what it brings.

    Args:
        node: The node.
        patience: Seconds (steady time) without a pulse after which the executor counts as dead.
    """

    def __init__(self, node: Node, patience: float) -> None:
        self._patience = patience
        self._beat = threading.Event()
        self._guard = node.create_guard_condition(self._beat.set)

    @contextmanager
    def watched(self, interrupt: Interrupt) -> Iterator[Interrupt]:
        """Give an interrupt that is raised by `interrupt` or when the executor is dead."""
        either, done = Interrupt(), threading.Event()
        remove = interrupt.subscribe(either.set)

        def feel() -> None:
            while not done.wait(self._patience):
                self._beat.clear()
                self._guard.trigger()
                if not self._beat.wait(self._patience):
                    if not done.is_set():
                        either.set()
                    return

        thread = threading.Thread(target=feel, name='executor pulse', daemon=True)
        thread.start()
        try:
            yield either
        finally:
            done.set()
            self._beat.set()
            remove()
