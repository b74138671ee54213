"""Which nodes run on this machine, so that a second launch does not start the same ones again.

Two nodes of one name in one ROS domain answer each other's calls. A claim is a locked file in the
user's runtime folder, so it ends with the process that holds it, however that ends.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

from launcher.system import NotNowError
from surveillance_runtime.node_table import RUN_NODES, Node


def claim(
    nodes: Iterable[Node], domain: str, namespace: str | None, folder: Path | None = None
) -> list[int]:
    """Claims nodes for this process.

    Args:
        nodes: what shall run; of a viewer there may be several, so it is not claimed.
        domain: the ROS domain they run in.
        namespace: the namespace they run in, None for none.
        folder: where the claims lie; default: in the user's runtime folder.

    Returns:
        Descriptors that hold the claims as long as they are open.

    Raises:
        NotNowError: some of them are claimed already; then none is claimed.
    """
    folder = folder or runtime_folder() / 'nodes'
    held: list[int] = []
    taken: list[str] = []
    holder = ''
    for node in (node.name for node in nodes if node.name in RUN_NODES):
        place = '.'.join([domain, *(namespace or '').strip('/').split('/'), node])
        descriptor = _open(folder, place)
        if descriptor is None:
            continue
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            taken.append(node)
            holder = holder or os.read(descriptor, 20).decode('ascii', 'replace').strip()
            os.close(descriptor)
            continue
        held.append(descriptor)
        # Others may read who holds it; where the disk is full they do not learn it.
        with contextlib.suppress(OSError):
            os.ftruncate(descriptor, 0)
            os.write(descriptor, str(os.getpid()).encode())
    if not taken:
        return held
    for descriptor in held:
        os.close(descriptor)
    who = f' (process {holder})' if holder else ''
    where = f'ROS domain {domain}' + (f', namespace {namespace}' if namespace else '')
    raise NotNowError(
        f'already running in {where}{who}: {", ".join(taken)}; '
        'expected another --domain or --namespace, or --without these'
    )


def runtime_folder() -> Path:
    """Return the user's folder for what lives as long as processes do, made when missing.

    It is below XDG_RUNTIME_DIR, or else in the folder for temporary files, the user's own and
    closed to others: there nobody can plant a link.
    """
    given = os.environ.get('XDG_RUNTIME_DIR', '')
    if given and os.access(given, os.W_OK):
        return Path(given, 'surveillance')
    return Path(tempfile.gettempdir(), f'surveillance-{os.getuid()}')


def _open(folder: Path, name: str) -> int | None:
    """Return the file of a claim; None where it cannot be had, and nothing is claimed then."""
    try:
        for each in (folder.parent, folder):
            with contextlib.suppress(FileExistsError):
                each.mkdir(mode=0o700)
        if folder.is_symlink() or folder.parent.is_symlink():
            return None
        if folder.parent.stat().st_uid != os.getuid() or folder.stat().st_uid != os.getuid():
            return None
        return os.open(folder / name, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
    except OSError:
        return None
