"""The whole stack of a fleet on simulated time, composed as the launcher composes it.

Nodes, namespaces, names and parameters are those of `python3 launch.py --robots N --composed`: what
is shared (ontology, map builder, simulator) runs in this process, so that the truth is at hand, and
each robot's programs in a process of their own, which may be killed and begun again. Nothing is
scripted.
"""

from __future__ import annotations

import importlib
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

import rclpy
from rclpy.logging import LoggingSeverity, get_logging_severity_from_string

from launcher.fleet_launch import RobotProcesses, parts
from launcher.run import NOT_RECORDED, Run
from launcher.run_configuration import configuration, profile_of
from launcher.run_processes import node_environ, programs_of, ros_arguments
from surveillance_runtime import logging, node_table
from surveillance_runtime.configuration import split_arguments
from surveillance_runtime.node import PatrolNode, give_arguments
from surveillance_runtime.process import ExecutorThread, share_clock
from surveillance_runtime.run_parameters import write_parameters
from surveillance_runtime.testing import claim_domain
from surveillance_simulation.robot.robots import Robots
from surveillance_simulation.simulator_node import Simulator

CONFIG = ROOT / 'config'


class FleetStack:
    """A simulated fleet and its programs.

    Args:
        count: How many robots.
        place: The place's file; None: the seven rooms.
        assignments: Further parameters, as `-p` takes them.
        log_level: Of all loggers of this process until `close`.
        folder: Where the robots write; default: a folder that goes with the stack.

    Attributes:
        folder: Where the robots write: the file NAME.log and the folder NAME of each.
        nodes: The shared nodes.
        observer: A further node in the same graph, for whoever looks on.
        programs: The process of each robot that was begun.
        robots: The simulated robots in their world.
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
        domain = claim_domain()
        self._run = Run(
            mode='SIMULATED',
            place=place,
            robots=count,
            processes=node_table.ONE,
            record=NOT_RECORDED,
            domain=domain,
            assignments=('use_sim_time:=true', 'simulator:speed:=0.0', *assignments),
        )
        team = parts(self._run, CONFIG, profile_of(CONFIG, self._run))
        self._parts = {part.robot: part for part in team if part.robot}
        self.context = rclpy.Context()
        rclpy.init(args=[], context=self.context, domain_id=domain)
        severity = LoggingSeverity(get_logging_severity_from_string(log_level))
        self._until_close.enter_context(logging.log_level(severity))
        self._spinner = ExecutorThread(self.context)
        self.nodes: dict[str, PatrolNode] = {}
        self.programs: dict[str, subprocess.Popen[bytes]] = {}
        self._create(next(part for part in team if not part.robot))
        self.observer = self._add(
            PatrolNode('onlooker', context=self.context, use_global_arguments=False)
        )
        simulator = self.nodes['simulator']
        assert isinstance(simulator, Simulator)
        self.robots: Robots = simulator.robots

    @property
    def names(self) -> tuple[str, ...]:
        """The robots' names."""
        return tuple(self._parts)

    def _files(self, part: RobotProcesses) -> dict[str, Path]:
        own = part.folder(self.folder)
        own.mkdir(parents=True, exist_ok=True)
        merged = configuration(CONFIG, part.run, own, fleet=part.entries)
        return write_parameters(own / 'parameters', part.run.namespace, merged, part.nodes)

    def _create(self, part: RobotProcesses) -> None:
        files = self._files(part)
        for node in part.nodes:
            kind = getattr(importlib.import_module(node.module), node.class_name)
            arguments = split_arguments(ros_arguments([files[node.name]], part.run, part.renamed))
            give_arguments(arguments)
            try:
                options = {'cli_args': arguments.rest, 'use_global_arguments': False}
                self._add(kind(context=self.context, **options))
            finally:
                give_arguments(None)

    def _add(self, node: PatrolNode) -> PatrolNode:
        self.nodes[node.get_name()] = node
        self._spinner.executor.add_node(node)
        return node

    @property
    def error(self) -> BaseException | None:
        """What ended the executor of the shared nodes early, from a callback."""
        return self._spinner.error

    def start(self) -> None:
        """Let all run."""
        share_clock([*self.nodes.values()])
        self._spinner.start()
        for name in self.names:
            self.begin(name)

    def begin(self, name: str) -> None:
        """Start the programs of a robot, which go on with its mission."""
        part = self._parts[name]
        [program] = programs_of(
            part, self._files(part), node_environ(self._run, self.folder / 'ros'), part.renamed
        )
        with open(self.folder / f'{name}.log', 'ab') as log:
            self.programs[name] = subprocess.Popen(
                program.command, env=program.environ, stdout=log, stderr=log
            )

    def kill(self, name: str) -> None:
        """Have the programs of a robot end at once, as with a power failure."""
        program = self.programs.pop(name)
        program.kill()
        program.wait()

    def close(self) -> None:
        """End the robots' programs, then the shared nodes, then ROS."""
        for program in self.programs.values():
            program.terminate()
        for program in self.programs.values():
            try:
                program.wait(30.0)
            except subprocess.TimeoutExpired:
                program.kill()
                program.wait()
        for node in reversed(self.nodes.values()):
            node.stop()
        self._spinner.stop()
        for node in reversed(self.nodes.values()):
            node.destroy_node()
        rclpy.try_shutdown(context=self.context)
        self._until_close.close()
