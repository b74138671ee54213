"""The log functions of the engine, replaceable with `set_loggers`.

By default they write to the standard logger ``state_machines``.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

Logger = Callable[[str], Any]

_standard = logging.getLogger('state_machines')
_loggers: dict[str, Logger] = {}


def loginfo(msg: object) -> None:
    """Log at level info."""
    _loggers.get('info', _standard.info)(str(msg))


def logwarn(msg: object) -> None:
    """Log at level warning."""
    _loggers.get('warn', _standard.warning)(str(msg))


def logdebug(msg: object) -> None:
    """Log at level debug."""
    _loggers.get('debug', _standard.debug)(str(msg))


def logerr(msg: object) -> None:
    """Log at level error."""
    _loggers.get('error', _standard.error)(str(msg))


def set_loggers(info: Logger, warn: Logger, debug: Logger, error: Logger) -> None:
    """Replace the four log functions (in SMACH's order of arguments)."""
    _loggers.update(info=info, warn=warn, debug=debug, error=error)


def reset_loggers() -> None:
    """Go back to the standard ``logging`` logger."""
    _loggers.clear()


def chatty() -> bool:
    """Tell whether the info level is read, so that transitions are formatted for it."""
    return 'info' in _loggers or _standard.isEnabledFor(logging.INFO)
