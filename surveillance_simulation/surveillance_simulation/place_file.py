"""A place's file read as a world; every error names file and line."""

from __future__ import annotations

from pathlib import Path

from surveillance_runtime.parameter_file import read_parameter_file
from surveillance_simulation.floor_plan import WorldError
from surveillance_simulation.world.world import World


def read_world(path: str | Path) -> World:
    """Return the world that a place's file describes.

    Raises:
        YamlFileError: The file cannot be read, or describes no sound place; one line.
    """
    file = read_parameter_file(path)
    try:
        return World.from_parameters(file.values)
    except WorldError as error:
        raise file.error(error.where, error.problem) from None
