"""Which nodes run on this machine, so that a second launch does not start the same ones again.

Two nodes of one name in one ROS domain answer each other's calls. A claim is a name that the kernel
gives to one socket at a time (unix(7), abstract), so it holds for all users of this machine's
network and ends with the process that holds it, however that ends.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import socket
import struct
from collections.abc import Iterable

from surveillance_runtime.launch_protocol import NotNowError
from surveillance_runtime.node_table import RUN_NODES, Node

_CREDENTIALS = struct.Struct('3i')
"""struct ucred: process, user, group."""
_MOST_ASKING = 4096
"""How many launches may ask who holds a claim: nobody takes their connections."""


def claim(nodes: Iterable[Node], domain: str, namespace: str | None) -> list[int]:
    """Claims nodes for this process.

    Args:
        nodes: what shall run; of a viewer there may be several, so it is not claimed.
        domain: the ROS domain they run in.
        namespace: the namespace they run in, None for none.

    Returns:
        Descriptors that hold the claims as long as they are open.

    Raises:
        NotNowError: some of them are claimed already; then none is claimed.
    """
    held: list[socket.socket] = []
    taken: dict[str, str] = {}
    for node in (node.name for node in nodes if node.name in RUN_NODES):
        place = '.'.join([domain, *(namespace or '').strip('/').split('/'), node])
        # A namespace may be longer than a socket's name.
        name = f'\0surveillance-node-{hashlib.sha256(place.encode()).hexdigest()}'
        lock = socket.socket(socket.AF_UNIX)
        try:
            lock.bind(name)
            lock.listen(_MOST_ASKING)
        except OSError as error:
            lock.close()
            if error.errno == errno.EADDRINUSE:
                taken[node] = _holder(name)
            continue  # where there are no such names, nothing is claimed
        held.append(lock)
    if not taken:
        return [lock.detach() for lock in held]
    for lock in held:
        lock.close()
    who = next((f' (process {pid})' for pid in taken.values() if pid), '')
    where = f'ROS domain {domain}' + (f', namespace {namespace}' if namespace else '')
    raise NotNowError(
        f'already running in {where}{who}: {", ".join(taken)}; '
        'expected another --domain or --namespace, or --without these'
    )


def _holder(name: str) -> str:
    """Return the process that holds a claim; empty where it cannot be told."""
    with socket.socket(socket.AF_UNIX) as asking, contextlib.suppress(OSError):
        asking.setblocking(False)
        asking.connect(name)
        given = asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
        return str(_CREDENTIALS.unpack(given)[0] or '')
    return ''
