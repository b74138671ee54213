"""The whole patrol in this process on simulated time: every node, one executor, nothing scripted.

Used by the navigation benchmark and the endurance run. Nodes and parameters are those that
`python3 launch.py --mode SIMULATED --composed` starts.
"""

from __future__ import annotations

import importlib
import json
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

import rclpy
from rclpy.logging import LoggingSeverity, get_logging_severity_from_string

from surveillance_runtime import logging, node_table
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import ExecutorThread, share_clock
from surveillance_runtime.testing import claim_domain
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.simulator_node import Simulator


class Stack:
    """Every node of a simulated patrol, spun in this process.

    Attributes:
        observer: A further node in the same graph, for whoever watches.
        robot: The simulated robot in its world.
    """

    def __init__(
        self,
        place: Path,
        parameters: Mapping[str, Mapping[str, Any]] | None = None,
        nodes: Sequence[str] = (),
        log_level: str = 'fatal',
    ) -> None:
        """Create all nodes; `start` lets them run.

        Args:
            place: The place's file.
            parameters: Further parameters by node; those of '*' are for every node.
            nodes: Only these nodes; it needs the simulator. All those of a patrol by default.
            log_level: Of all loggers of this process until `close`.
        """
        self._folder = tempfile.TemporaryDirectory(prefix='patrol-')
        arguments = ros_arguments(place, Path(self._folder.name), parameters)
        self.context = rclpy.Context()
        rclpy.init(args=arguments, context=self.context, domain_id=claim_domain())
        self._level = ExitStack()
        severity = get_logging_severity_from_string(log_level)
        self._level.enter_context(logging.log_level(LoggingSeverity(severity)))
        self._spinner = ExecutorThread(self.context)
        options = {'context': self.context, 'cli_args': arguments, 'use_global_arguments': False}
        self.nodes: dict[str, PatrolNode] = {}
        for node in node_table.select('SIMULATED', only=nodes):
            kind = getattr(importlib.import_module(node.module), node.class_name)
            self._add(node.name, kind(**options))
        self.observer = self._add('observer', PatrolNode('observer', **options))
        simulator = self.nodes['simulator']
        assert isinstance(simulator, Simulator)
        self.robot: Robot = simulator.robot

    def _add(self, name: str, node: PatrolNode) -> PatrolNode:
        self.nodes[name] = node
        self._spinner.executor.add_node(node)
        return node

    @property
    def error(self) -> BaseException | None:
        """What ended the executor early, from a callback."""
        return self._spinner.error

    def start(self) -> None:
        """Let the nodes run."""
        share_clock([*self.nodes.values()])
        self._spinner.start()

    def close(self) -> None:
        """Stop all nodes while messages flow, then the executor, then ROS."""
        for node in reversed(self.nodes.values()):
            node.stop()
        self._spinner.stop()
        for node in reversed(self.nodes.values()):
            node.destroy_node()
        rclpy.try_shutdown(context=self.context)
        self._level.close()
        self._folder.cleanup()


def ros_arguments(
    place: Path, folder: Path, parameters: Mapping[str, Mapping[str, Any]] | None = None
) -> list[str]:
    """Return the arguments that put every node into a simulated patrol as fast as it goes.

    Args:
        place: The place's file.
        folder: Where a file with the parameters is written.
        parameters: Further parameters by node; those of '*' are for every node.
    """
    own = folder / 'own.yaml'
    own.write_text(json.dumps(_own_parameters(parameters or {})))
    arguments = ['--ros-args']
    for file in (ROOT / 'config' / 'parameters.yaml', place, own):
        arguments += ['--params-file', str(file)]
    return arguments


def _own_parameters(parameters: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    sections: dict[str, dict[str, Any]] = {'/**': {'use_sim_time': True}}
    for node in node_table.NODES:
        sections[f'/**/{node.name}'] = {}
        if node.has_modes:
            sections[f'/**/{node.name}'] = {'execution_mode': 'SIMULATED', 'console': False}
    sections['/**/simulator'] = {'speed': 0.0}
    for name, values in parameters.items():
        key = '/**' if name == '*' else f'/**/{name}'
        sections.setdefault(key, {}).update(values)
    return {key: {'ros__parameters': values} for key, values in sections.items() if values}
