"""What the current thread executes for a machine, if anything."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from surveillance_fsm.run import Strand


class _ThisThread(threading.local):
    strand: Strand | None = None
    # Which of the strand's successive threads this one is.
    token: object = None


this_thread = _ThisThread()
