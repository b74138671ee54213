"""What a supervised process runs: one node, or several on one executor.

    python node_process.py PARENT_PID TARGET[,TARGET...] [ROS arguments]

with TARGET as `name=module:Class`. Started as a file, so it imports nothing of the launcher.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import signal
import sys

from surveillance_runtime import launch_protocol
from surveillance_runtime.composition import run_together

PR_SET_PDEATHSIG = 1  # linux/prctl.h


def end_with_parent(parent: int) -> None:
    """Have the kernel end this process when its launcher dies, however that happens."""
    if sys.platform == 'linux' and parent:
        ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0)
        if os.getppid() != parent:  # it died before the call
            sys.exit(1)


def say_up() -> None:
    """Tell the launcher that the imports, most of the start, are done: the next one may begin."""
    descriptor = os.environ.get(launch_protocol.HEARTBEAT)
    if descriptor is not None:
        with contextlib.suppress(OSError):  # the launcher is gone
            os.write(int(descriptor), launch_protocol.UP)


def limit_memory() -> None:
    """Have one huge allocation fail by itself: it costs the message that caused it, not the
    node.
    """
    given = os.environ.pop(launch_protocol.MEMORY, None)
    if given is not None:
        most = int(given)
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))


def main(argv: list[str]) -> int:
    parent, targets, *arguments = argv
    end_with_parent(int(parent))
    limit_memory()
    parsed = []
    for target in targets.split(','):
        name, _, place = target.partition('=')
        module, _, class_name = place.partition(':')
        parsed.append((name, module, class_name))
    sys.argv = [parsed[0][0], *arguments]
    return run_together([(module, name) for _, module, name in parsed], arguments, say_up)


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
