"""How processes find each other: the one place that chooses transports and discovery.

The choice is made by environment variables that the middleware reads when ROS starts. What the
environment says already is kept. No ROS in here.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

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


def launched_nodes(environ: Mapping[str, str], *, network: bool) -> dict[str, str]:
    """Return what to set for the nodes of a launch, whose environment is `environ`.

    They hear the nodes of this machine alone, unless `network` is set or the environment says so.
    """
    fast_dds = environ.get('RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp').startswith('rmw_fastrtps')
    if network:
        chosen = {**_QUICK, _RANGE: 'SUBNET'}
    elif fast_dds and _PROFILE not in environ:
        chosen = _LOCAL
    else:
        chosen = {**_QUICK, _RANGE: 'LOCALHOST'}
    asked_for = {_RANGE} if network else set()
    return {name: chosen[name] for name in chosen if name in asked_for or name not in environ}


def prefer_quick_discovery() -> None:
    """Have the middleware of this process find peers quickly, unless a profile is named.

    On a busy machine announcements get lost. With the middleware's own times, a client's next
    request reached a server that was started again up to 2.9 s after it was ready; with this
    profile in both processes 0.3 s.
    """
    if _PROFILE not in os.environ:
        for name, value in _QUICK.items():
            os.environ.setdefault(name, value)
