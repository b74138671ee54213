"""What the tests of a run ask of one: whether it can be started, and which settings it has."""

from __future__ import annotations

import pytest

from launcher.cli import CONFIG
from launcher.run import (
    Run,
)
from launcher.run_configuration import configuration


def look_over(run: Run) -> None:
    """Look at a run as a launch does before it starts anything."""
    configuration(CONFIG, run)


def error_of(run: Run) -> str:
    with pytest.raises(ValueError, match=r'.') as caught:
        look_over(run)
    message = str(caught.value)
    assert '\n' not in message
    return message


def settings_of(node: str, run: Run) -> dict[str, object]:
    settings = configuration(CONFIG, run).resolve(node, f'/{node}')
    return {name: setting.value for name, setting in settings.items()}
