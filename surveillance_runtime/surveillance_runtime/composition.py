"""Several nodes in one process: `ros2 run surveillance_runtime nodes NODE...`, and what it calls.

Nodes are named as `launch.py list` does. ROS arguments follow `--ros-args` and count for all.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterable, Sequence

from surveillance_runtime.launch_protocol import EXIT_CANNOT_START
from surveillance_runtime.node_table import Node, find

ROS_ARGUMENTS = '--ros-args'
LAST = 'robot_behavior'
"""Nodes of one process are stopped from the last to the first: the one that uses the others is the
last."""


def in_order(nodes: Iterable[Node]) -> list[Node]:
    """Return nodes in the order in which a process makes them."""
    return sorted(nodes, key=lambda node: node.name == LAST)


def run_together(
    places: Sequence[tuple[str, str]],
    arguments: Sequence[str],
    on_imported: Callable[[], None] = lambda: None,
) -> int:
    """Run nodes in this process until it is told to stop; return its exit code.

    Args:
        places: Module and class of each.
        arguments: ROS arguments.
        on_imported: Called when all modules are there, which is most of a start.
    """
    modules = [importlib.import_module(module) for module, _ in places]
    on_imported()
    if len(places) == 1:
        return int(modules[0].main(arguments) or 0)
    from surveillance_runtime.process import run_nodes

    for each in modules:
        if prepare := getattr(each, 'prepare_process', None):
            prepare()
    classes = [getattr(module, name) for module, (_, name) in zip(modules, places, strict=True)]
    return int(run_nodes(classes, arguments) or 0)


def main(words: Sequence[str] | None = None) -> int:
    """Run the nodes that the command line names."""
    words = sys.argv[1:] if words is None else list(words)
    cut = words.index(ROS_ARGUMENTS) if ROS_ARGUMENTS in words else len(words)
    try:
        nodes = in_order(find(name) for name in words[:cut])
        if not nodes:
            raise ValueError('expected NODE..., as `launch.py list` names them')
    except ValueError as error:
        print(f'nodes: {error}', file=sys.stderr)
        return EXIT_CANNOT_START
    return run_together([(node.module, node.class_name) for node in nodes], words[cut:])
