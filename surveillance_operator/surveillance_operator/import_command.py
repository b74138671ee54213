"""The command `import`: makes a place of a robot's map, or of another program's file of places."""

from __future__ import annotations

from collections.abc import Sequence

from floor_plans.imports import command
from surveillance_runtime.command_line import CommandParser


def main(argv: Sequence[str] | None = None) -> int:
    """Make a place of a map and say what was found; the exit code is 2 for bad input."""
    return command.main(argv, CommandParser(prog='launch.py import'))
