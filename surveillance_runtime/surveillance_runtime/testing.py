"""ROS domains for whoever must not meet other nodes on this machine: tests and benchmarks.

Nodes of one domain hear each other. A claim is a name that the system gives to one socket at a
time, so it holds for all users and ends with the process however that ends.
"""

from __future__ import annotations

import socket

from surveillance_runtime.discovery import LAST_DOMAIN

_held: list[socket.socket] = []


def claim_domain() -> int:
    """Take a ROS domain, from 1 to `LAST_DOMAIN`, that nobody has claimed and no node uses.

    The highest comes first: people who choose a domain by hand take low ones.

    Raises:
        RuntimeError: There is none.
    """
    for domain in range(LAST_DOMAIN, 0, -1):
        claim = socket.socket(socket.AF_UNIX)
        try:
            claim.bind(f'\0surveillance-domain-{domain}')
        except OSError:
            claim.close()
            continue
        if _is_used(domain):
            claim.close()
            continue
        _held.append(claim)
        return domain
    raise RuntimeError(f'all ROS domains from 1 to {LAST_DOMAIN} are claimed or in use')


def _is_used(domain: int) -> bool:
    """Tell whether a node runs in the domain, as one that outlived its test does.

    Each process of a domain listens on the domain's port for discovery (DDSI-RTPS 2.5, 9.6.1.1);
    they share it, but only with each other.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(('', 7400 + 250 * domain))
        except OSError:
            return True
    return False
