"""The whole stack of a fleet in this process on simulated time, as the launcher composes it.

Nodes, namespaces, names and parameters are those of `python3 launch.py --robots N`; all run on one
executor. Nothing is scripted.
"""

from __future__ import annotations

import importlib
import sys
import tempfile
import threading
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

import rclpy
from rclpy.logging import LoggingSeverity, get_logging_severity_from_string

from launcher.run import NOT_RECORDED, Run
from launcher.run_configuration import configuration, profile_of
from launcher.run_processes import ros_arguments
from launcher.team import Part, parts
from surveillance_runtime import logging
from surveillance_runtime.configuration import split_arguments
from surveillance_runtime.node import PatrolNode, give_arguments
from surveillance_runtime.process import ExecutorThread, share_clock
from surveillance_runtime.run_parameters import write_parameters
from surveillance_runtime.testing import claim_domain
from surveillance_simulation.robot.robots import Robots
from surveillance_simulation.simulator_node import Simulator

CONFIG = ROOT / 'config'


class FleetStack:
    """Every node of a simulated fleet, spun in this process.

    Args:
        count: How many robots.
        place: The place's file; None: the seven rooms.
        assignments: Further parameters, as `-p` takes them.
        log_level: Of all loggers of this process until `close`.
        folder: Where the robots write; default: a folder that goes with the stack.

    Attributes:
        robots: The simulated robots in their world.
        nodes: All nodes by their full names.
        team: What the launcher would start.
        folder: Where the robots write.
    """

    def __init__(
        self,
        count: int,
        place: Path | None = None,
        assignments: Sequence[str] = (),
        log_level: str = 'fatal',
        folder: Path | None = None,
    ) -> None:
        self._until_close = ExitStack()
        if folder is None:
            made = tempfile.TemporaryDirectory(prefix='fleet-', ignore_cleanup_errors=True)
            folder = Path(self._until_close.enter_context(made))
        self.folder = folder
        fast = ('use_sim_time:=true', 'simulator:speed:=0.0')
        run = Run(
            mode='SIMULATED',
            place=place,
            robots=count,
            composed=True,
            record=NOT_RECORDED,
            assignments=(*fast, *assignments),
        )
        robot = profile_of(CONFIG, run)
        self.team = parts(run, CONFIG, robot)
        self.context = rclpy.Context()
        rclpy.init(args=[], context=self.context, domain_id=claim_domain())
        severity = LoggingSeverity(get_logging_severity_from_string(log_level))
        self._until_close.enter_context(logging.log_level(severity))
        self._spinner = ExecutorThread(self.context)
        self._told = threading.Condition()
        self.nodes: dict[str, PatrolNode] = {}
        for part in self.team:
            self._create(part)
        self.observer = self._add(
            PatrolNode('onlooker', context=self.context, use_global_arguments=False)
        )
        simulator = self.nodes['/simulator']
        assert isinstance(simulator, Simulator)
        self.simulator = simulator
        self.robots: Robots = simulator.robots

    @property
    def names(self) -> tuple[str, ...]:
        """The robots' names."""
        return tuple(robot.name for robot in self.robots.robots)

    def _create(self, part: Part) -> None:
        own = part.folder(self.folder)
        own.mkdir(parents=True, exist_ok=True)
        merged = configuration(CONFIG, part.run, own, fleet=part.entries)
        files = write_parameters(own / 'parameters', part.run.namespace, merged, part.nodes)
        for node in part.nodes:
            kind = getattr(importlib.import_module(node.module), node.class_name)
            arguments = split_arguments(
                ros_arguments([files[node.name]], part.run, part.renamed)
            )
            give_arguments(arguments)
            try:
                options = {'cli_args': arguments.rest, 'use_global_arguments': False}
                self._add(kind(context=self.context, **options))
            finally:
                give_arguments(None)

    def _add(self, node: PatrolNode) -> PatrolNode:
        self.nodes[node.get_fully_qualified_name()] = node
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
        self._until_close.close()
