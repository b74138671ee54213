"""How a person is called: a line of the log, the user's command, and the sinks of `notify.yaml`."""

from __future__ import annotations

import shlex
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from surveillance_operator.notify.notification import Notification, notification_of
from surveillance_operator.notify.outbox import GIVEN_UP_AFTER, Outbox
from surveillance_operator.notify.sinks import read_notify_file, sink_of
from surveillance_runtime.incidents import IncidentCall
from surveillance_runtime.run_files import EVIDENCE, OUTBOX, folder_of


def run_command(command: str, text: str) -> str:
    """Run the user's command with one line as its last argument; return why not, empty: it runs."""
    try:
        subprocess.Popen(
            [*shlex.split(command), text],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
    except (OSError, ValueError) as error:
        return f'--alarm {command}: {error}'
    return ''


class Sinks(NamedTuple):
    """The sinks of a run.

    Attributes:
        outbox: What waits for them.
        tell: Hands a call to those that it is for.
        names: Of all.
        escalations: After how long without an acknowledgement some are told, seconds, ascending.
        test: Hands a test message to the one of a name.
    """

    outbox: Outbox
    tell: Callable[[IncidentCall], object]
    names: tuple[str, ...] = ()
    escalations: tuple[float, ...] = ()
    test: Callable[[str], object] = lambda _name: None


def open_sinks(
    file: Path,
    folder: Path,
    robot: str,
    report: Callable[[str], object],
    trouble: Callable[[str, str], object] = lambda _sink, _text: None,
) -> Sinks:
    """Return the sinks of a file, which begin to be told of what waits.

    Args:
        file: The sinks, notify.yaml.
        folder: Of the run.
        robot: Its name, where an incident is of no robot of a fleet.
        report: Takes a line about a sink that does not work, and that works again.
        trouble: Takes the name of a sink that a person should look at, and why; empty: it works.

    Raises:
        FileError: The file cannot be used.
        ValueError: A sink needs a package that is not installed.
        OSError: The outbox cannot be made.
    """
    settings = {each.name: each for each in read_notify_file(file)}
    sinks = {name: sink_of(each) for name, each in settings.items()}
    outbox = Outbox(folder / OUTBOX, sinks, report, trouble=trouble)
    # What an earlier run could not hand over: its end was not waited for.
    for earlier in sorted(folder.parent.glob(f'*/{OUTBOX}')):
        outbox.take_over(earlier, time.time() - GIVEN_UP_AFTER)
    outbox.start()

    def tell(call: IncidentCall) -> None:
        own = call.incident.told.robot
        of_member = folder_of(folder, own) / EVIDENCE
        evidence = of_member if of_member.is_dir() else folder / EVIDENCE
        now = time.time()
        takers = [name for name, each in settings.items() if each.takes.takes(call, now)]
        if takers:
            outbox.put(notification_of(call, own or robot, now, evidence), takers)

    def test(name: str) -> None:
        now = time.time()
        words = f'{robot}: this is a test message, nothing has happened'
        key = f'test {name} {now:.3f}'
        outbox.put(Notification(key, words, 'test', name, 'alarm', robot, False, now), [name])

    escalations = sorted({each.takes.after for each in settings.values()} - {0.0})
    return Sinks(outbox, tell, tuple(settings), tuple(escalations), test)
