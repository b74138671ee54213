"""Stop signals until a command has its own way to end: they raise, and are not forgotten.

Python drops an exception that a handler raises in the middle of a `__del__` or of a weakref's
callback, as there are many in an import, and up to 3.11 makes another one of it in the middle of a
`__set_name__`. A Ctrl-C that falls there would be lost, or end in a traceback.
"""

from __future__ import annotations

import signal
import sys
from typing import NoReturn

_came = False


def raise_at_stop_signals() -> None:
    """Have each of them raise KeyboardInterrupt in the main thread."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, _raise)
    sys.unraisablehook = _say_unraisable


def _say_unraisable(dropped: sys.UnraisableHookArgs) -> None:
    # Python's own hook prints a traceback of the Ctrl-C that `raise_if_lost` raises again.
    if dropped.exc_type is not KeyboardInterrupt:
        sys.__unraisablehook__(dropped)


def _raise(_number: int, _frame: object) -> NoReturn:
    global _came
    _came = True
    raise KeyboardInterrupt


def raise_if_lost() -> None:
    """Raise what a signal raised before and Python dropped or replaced.

    Raises:
        KeyboardInterrupt: A stop signal has come.
    """
    if _came:
        raise KeyboardInterrupt


def hold_back() -> None:
    """Keep Ctrl-C for the next program of this process: Python itself would print a traceback.

    Raises:
        KeyboardInterrupt: A stop signal has come already.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    raise_if_lost()
