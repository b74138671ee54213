"""A client that owns its node and its thread."""

from __future__ import annotations

import atexit
import os
import threading
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from armor_service import client
from surveillance_ontology.armor_client import RosTransport
from surveillance_runtime.discovery import prefer_quick_discovery
from surveillance_runtime.process import ExecutorThread

__all__ = ['ArmorClient']


class ArmorClient(client.ArmorClient):
    """A client of one reference of an armor server, with armor_py_api's arguments.

    Args:
        client_id: Name of this client; matters for mounting only.
        reference_name: The ontology that its directives mean.
        service_name: The server's service for one directive.
        serial_service_name: The server's service for batches.
        timeout: Seconds for finding the server and for its answer together.

    Attributes:
        manipulation: Directives that change the ontology.
        query: Directives that ask.
        utils: Directives about references, files and logging.
    """

    def __init__(
        self,
        client_id: str,
        reference_name: str,
        service_name: str = '/armor_interface_srv',
        serial_service_name: str = '/armor_interface_serialized_srv',
        timeout: float = 5.0,
    ) -> None:
        self._transport = RosTransport(
            _spun_node(), service_name, serial_service_name, float(timeout)
        )
        super().__init__(client_id, reference_name, self._transport)

    @property
    def timeout(self) -> float:
        """Seconds for finding the server and for its answer together."""
        return self._transport.timeout

    @timeout.setter
    def timeout(self, seconds: float) -> None:
        self._transport.timeout = float(seconds)


class _SpunNode:
    """A node in a ROS context of its own, so that the program's own `rclpy.init` is its own."""

    def __init__(self) -> None:
        prefer_quick_discovery()
        self._context = rclpy.Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self.node: Any = Node(
            f'armor_client_{os.getpid()}',
            context=self._context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._spinner = ExecutorThread(self._context)
        self._spinner.executor.add_node(self.node)
        self._spinner.start()

    def close(self) -> None:
        """End the thread before the interpreter does."""
        self._spinner.stop()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)


_lock = threading.Lock()
_shared: _SpunNode | None = None


def _spun_node() -> Any:
    """Return the node of this process's clients, made for the first of them."""
    global _shared
    with _lock:
        if _shared is None:
            _shared = _SpunNode()
            atexit.register(_shared.close)
        return _shared.node
