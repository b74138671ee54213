"""The pipeline of a run: calls of its incidents become news, and wait until each sink took them."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from surveillance_operator.notify.news import news_of
from surveillance_operator.notify.outbox import Outbox
from surveillance_operator.notify.settings import read_notify_file
from surveillance_operator.notify.sinks import sink_of
from surveillance_runtime.incidents import Call

OUTBOX, EVIDENCE = 'outbox', 'evidence'
"""Folders of a run."""


def notifier(
    file: Path, folder: Path, robot: str, report: Callable[[str], object]
) -> tuple[Outbox, Callable[[Call], object]]:
    """Return the outbox of a run's sinks, which has begun, and what hands calls to it.

    Args:
        file: The sinks, notify.yaml.
        folder: Of the run.
        robot: Its name.
        report: Takes a line about a sink that does not work, and that works again.

    Raises:
        FileError: The file cannot be used.
        ValueError: A sink needs a package that is not installed.
        OSError: The outbox cannot be made.
    """
    sinks = {each.name: sink_of(each) for each in read_notify_file(file)}
    outbox = Outbox(folder / OUTBOX, sinks, lambda line: report(f'notify: {line}'))
    outbox.start()

    def tell(call: Call) -> None:
        # A fleet's nodes are called `robot1/observer`, and each robot has a folder of its own.
        member = call.incident.node.rpartition('/')[0]
        evidence = folder / member / EVIDENCE
        outbox.put(news_of(call, member or robot, time.time(), evidence))

    return outbox, tell
