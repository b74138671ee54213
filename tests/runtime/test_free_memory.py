"""What a process has freed does not stay resident."""

from __future__ import annotations

import ctypes

from surveillance_runtime import free_memory


def test_freed_memory_is_asked_back_where_the_allocator_can(monkeypatch):
    trims = []

    class Allocator:
        malloc_trim = trims.append

    for library, expected in ((Allocator(), [0]), (object(), [])):
        trims.clear()
        free_memory._malloc_trim.cache_clear()
        monkeypatch.setattr(ctypes, 'CDLL', lambda _, library=library: library)
        free_memory.give_back()
        assert trims == expected
    free_memory._malloc_trim.cache_clear()
