"""How processes find each other: the one place that chooses transports and discovery.

The choice is made by environment variables that the middleware reads when ROS starts. What the
environment says already is kept. No ROS in here.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

from strict_files.files import FileError, read_file
from strict_files.one_line import clean

LARGEST_PROFILE = 1_000_000
"""Bytes of a profile."""
LAST_DOMAIN = 101
"""The highest ROS domain whose ports lie below those that Linux gives to clients."""
_RANGE, _PROFILE = 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'FASTRTPS_DEFAULT_PROFILES_FILE'
_QUICK = {
    _PROFILE: str(Path(__file__).with_name('discovery.xml')),
    # Shared memory that a killed process leaves behind hides later nodes of the same domain.
    'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4',
}
_LOCAL = {
    _PROFILE: str(Path(__file__).with_name('local_discovery.xml')),
    # The profile says it: LOCALHOST would add shared memory, whatever else is said.
    _RANGE: 'SYSTEM_DEFAULT',
}
VARIABLES = frozenset((*_QUICK, *_LOCAL))
"""The environment variables that make the choice."""


LOCALHOST, OPEN = 'localhost', 'open'
"""What a launch may be open to, besides a profile of its own: this machine, or its networks."""


def launched_nodes(environ: Mapping[str, str], network: str = '') -> dict[str, str]:
    """Return what to set for the nodes of a launch.

    Args:
        environ: Their environment.
        network: `LOCALHOST`, `OPEN`, or a file with a profile of Fast DDS, see `problem_of`;
            empty: localhost, unless the environment says otherwise.
    """
    if network == OPEN:
        chosen = {**_QUICK, _RANGE: 'SUBNET'}
    elif network not in ('', LOCALHOST):
        chosen = {_PROFILE: os.path.abspath(network), _RANGE: 'SYSTEM_DEFAULT'}
    elif _is_fast_dds(environ) and (network or _PROFILE not in environ):
        chosen = _LOCAL
    else:
        chosen = {**_QUICK, _RANGE: 'LOCALHOST'}
    # What is asked for in so many words goes before what the shell says.
    asked_for = {_RANGE} if network == OPEN else set(chosen) if network else set()
    return {name: chosen[name] for name in chosen if name in asked_for or name not in environ}


def problem_of(network: str, environ: Mapping[str, str]) -> str:
    """Return why a launch cannot be open to what it is to be; empty: it can.

    Args:
        network: As of `launched_nodes`.
        environ: The environment of its nodes.
    """
    if network not in ('', LOCALHOST, OPEN):
        return _problem_of_profile(network, environ)
    chosen = launched_nodes(environ, network)
    if chosen.get(_PROFILE) == _LOCAL[_PROFILE] or chosen.get(_RANGE) == 'LOCALHOST':
        return _problem_of_loopback()
    return ''


def _problem_of_profile(path: str, environ: Mapping[str, str]) -> str:
    expected = f'expected {LOCALHOST}, {OPEN}, or a file *.xml with a profile of Fast DDS'
    if not path.endswith('.xml'):
        return f'{clean(path)}: {expected}'
    if not _is_fast_dds(environ):
        return f'{clean(path)}: expected Fast DDS, got {environ["RMW_IMPLEMENTATION"]}'
    try:
        root = ElementTree.fromstring(read_file(Path(path), LARGEST_PROFILE))
    except (FileError, ElementTree.ParseError, ValueError, LookupError) as error:
        return clean(str(error) if isinstance(error, FileError) else f'{path}: {error}; {expected}')
    found = root.iter()
    if not any(
        each.tag.rpartition('}')[2] == 'participant'
        and each.get('is_default_profile', '').strip().lower() in ('true', '1')
        for each in found
    ):
        return f'{clean(path)}: expected a <participant> with is_default_profile="true"'
    return ''


def _problem_of_loopback() -> str:
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(('127.0.0.1', 0))
            probe.sendto(b'', probe.getsockname())
    except OSError as error:
        return (
            f'the nodes talk over 127.0.0.1, which this machine does not have ({error.strerror}): '
            'expected `ip link set lo up`, or --network open'
        )
    return ''


def _is_fast_dds(environ: Mapping[str, str]) -> bool:
    return environ.get('RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp').startswith('rmw_fastrtps')


def prefer_quick_discovery() -> None:
    """Have the middleware of this process find peers quickly, unless a profile is named.

    On a busy machine announcements get lost. With the middleware's own times, a client's next
    request reached a server that was started again up to 2.9 s after it was ready; with this
    profile in both processes 0.3 s.
    """
    if _PROFILE not in os.environ:
        for name, value in _QUICK.items():
            os.environ.setdefault(name, value)
