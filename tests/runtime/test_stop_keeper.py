"""A stop is kept aside, and an answer that waits for a disk comes in time."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest

from surveillance_runtime.node import PatrolNode
from surveillance_runtime.stop_keeper import UNANSWERED, StopKeeper
from surveillance_runtime.stop_request import StopFile, StopRequest

WISH = StopRequest('the guard', '', 1_767_222_000.0)


class Answers:
    """Has a keeper work in the executor's thread, and gives what it answers."""

    def __init__(self, graph: Any, *files: StopFile) -> None:
        self._graph = graph
        self._keeper = StopKeeper(graph.add(PatrolNode, name='node'), *files)

    def of(self, work: str, *given: Any) -> str:
        said: list[str] = []

        async def ask() -> None:
            said.append(await getattr(self._keeper, work)(*given))

        self._graph._spinner.executor.create_task(ask)
        self._graph.until(lambda: said)
        return said[0]


def test_it_is_kept_in_the_first_file_and_removed_from_all(graph: Any, tmp_path: Path) -> None:
    files = StopFile(tmp_path / 'a'), StopFile(tmp_path / 'b')
    files[1].keep(WISH)
    answers = Answers(graph, *files)
    assert answers.of('keep', WISH) == ''
    assert files[0].read() == WISH
    assert answers.of('forget') == ''
    assert files[0].read() is files[1].read() is None


def test_what_cannot_be_kept_or_removed_says_why(graph: Any, tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    answers = Answers(graph, StopFile(tmp_path / 'file' / 'stop'), StopFile(tmp_path))
    assert str(tmp_path / 'file') in answers.of('keep', WISH)
    assert answers.of('forget')


def test_a_disk_that_hangs_is_told_in_time_and_keeps_the_order(
    graph: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    goes_on, keep = threading.Event(), StopFile.keep
    monkeypatch.setattr(StopFile, 'keep', lambda file, wish: (goes_on.wait(), keep(file, wish))[1])
    file = StopFile(tmp_path / 'stop')
    answers = Answers(graph, file)
    try:
        assert answers.of('keep', WISH).endswith(UNANSWERED)
        assert answers.of('forget') == UNANSWERED
    finally:
        goes_on.set()
    assert answers.of('forget') == ''
    assert file.read() is None
