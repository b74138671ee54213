"""The `console` command: one prompt for a mission that runs elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from surveillance_operator import console_node
from surveillance_operator.watch_command import mission_parser, ros_arguments


def main(argv: Sequence[str] | None = None) -> int:
    """Read commands until `exit` or the end of the input."""
    parser = mission_parser(
        'console',
        'One prompt for a running mission: answers in mode MANUAL, doors, rooms, obstacles, '
        'policy, why, go, pause. `help` lists the commands.',
    )
    return console_node.main(ros_arguments(parser, parser.parse_args(argv)))


if __name__ == '__main__':
    sys.exit(main())
