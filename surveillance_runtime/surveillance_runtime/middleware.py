"""Which middleware the processes of a robot speak, and how far they are heard."""

from __future__ import annotations

import os
import sys

REQUESTED = ('RMW_IMPLEMENTATION', 'RCL_ASSERT_RMW_ID_MATCHES')


def check_middleware() -> None:
    """Use the middleware there is where the environment asks for one that is not installed.

    rcl would end the process with status 102. Nodes of different middlewares of DDS hear each
    other, so going on is worth one line on the standard error output.
    """
    asked = {name: os.environ[name] for name in REQUESTED if os.environ.get(name)}
    if not asked:
        return
    from rclpy.utilities import get_rmw_implementation_identifier

    present = get_rmw_implementation_identifier()
    for name, value in asked.items():
        if value != present:
            os.environ.pop(name)
            print(
                f'environment variable {name}: {value} is not installed here, '
                f'going on with {present}',
                file=sys.stderr,
            )
