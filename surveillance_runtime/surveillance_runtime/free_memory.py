"""Gives the system back what this process has freed. No ROS in here."""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any


@cache
def _malloc_trim() -> Any:
    return getattr(ctypes.CDLL(None), 'malloc_trim', None)  # only glibc has it


def give_back() -> None:
    """Return freed pages to the system, where the allocator can.

    By itself glibc returns only the end of its heap. What a start frees below stays resident: 25 of
    142 MB of a patrol in the office, 7 of 38 MB of its launcher.
    """
    if (trim := _malloc_trim()) is not None:
        trim(0)
