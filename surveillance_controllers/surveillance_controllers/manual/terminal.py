"""Terminal of an operator: line editing with history and completion, and the progress of a charge.

The libraries behind it take their time to import: import it where it is needed only.
"""

from __future__ import annotations

import os
import sys
import termios
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TextIO

from prompt_toolkit import PromptSession
from prompt_toolkit.completion import CompleteEvent, Completer, Completion
from prompt_toolkit.document import Document
from prompt_toolkit.history import FileHistory, History, InMemoryHistory
from prompt_toolkit.input import Input
from prompt_toolkit.input.vt100 import Vt100Input
from prompt_toolkit.output import Output
from prompt_toolkit.patch_stdout import patch_stdout
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn


class TerminalLines:
    """Reads lines from a terminal.

    Args:
        name: Names the prompt and the file with the history.
        completions: The words that can follow a text.
        ends: The terminal's two ends; the process's own terminal unless given, and then without a
            file for the history.
        status: What stands below the prompt, asked for every second.
    """

    def __init__(
        self,
        name: str,
        completions: Callable[[str], list[str]],
        ends: tuple[Input, Output] | None = None,
        status: Callable[[], str] | None = None,
    ) -> None:
        self._stopped = False
        given_input, given_output = ends or (_SilentInput(sys.stdin), None)
        self._session: PromptSession[str] = PromptSession(
            f'{name}> ',
            completer=WordCompleter(completions),
            complete_while_typing=False,
            history=_history(name) if ends is None else InMemoryHistory(),
            input=given_input,
            output=given_output,
            bottom_toolbar=status,
            refresh_interval=1.0 if status is not None else 0,
        )

    @contextmanager
    def shown(self) -> Iterator[None]:
        """Show what is printed meanwhile above the prompt; what is typed, only in a prompt."""
        with _silent(self._session.app.input), patch_stdout(raw=True):
            yield

    def read(self) -> str:
        """Wait for a line.

        Raises:
            EOFError: The input ended, or `stop` was called.
            KeyboardInterrupt: The operator pressed Ctrl-C.
        """
        return self._session.prompt(handle_sigint=False, pre_run=self._exit_if_stopped)

    def stop(self) -> None:
        """End `read` from another thread."""
        self._stopped = True
        loop = self._session.app.loop
        if loop is not None:
            loop.call_soon_threadsafe(self._exit_if_stopped)

    def _exit_if_stopped(self) -> None:
        app = self._session.app
        if self._stopped and app.is_running and not app.is_done:
            app.exit(exception=EOFError)


@contextmanager
def _silent(keyboard: Input) -> Iterator[None]:
    """Keep the terminal from echoing keys between two prompts: they wait for the next one.

    Ctrl-C is a signal meanwhile.
    """
    try:
        before = termios.tcgetattr(keyboard.fileno())
    except (termios.error, OSError, NotImplementedError):  # no terminal
        yield
        return
    silent = list(before)
    silent[3] &= ~(termios.ECHO | termios.ICANON)
    termios.tcsetattr(keyboard.fileno(), termios.TCSANOW, silent)
    try:
        yield
    finally:
        termios.tcsetattr(keyboard.fileno(), termios.TCSANOW, before)


class _SilentInput(Vt100Input):
    """Does not echo either while something is printed above the prompt."""

    def cooked_mode(self) -> AbstractContextManager[None]:
        return _silent(self)


class WordCompleter(Completer):
    """Proposes to prompt_toolkit the words that a function gives for the text so far."""

    def __init__(self, completions: Callable[[str], list[str]]) -> None:
        self._completions = completions

    def get_completions(
        self, document: Document, complete_event: CompleteEvent
    ) -> Iterable[Completion]:
        """Yield the words that can stand where the last one is being typed."""
        text = document.text_before_cursor
        typed = '' if not text or text[-1].isspace() else text.split()[-1]
        for word in self._completions(text):
            yield Completion(word, start_position=-len(typed))


def _history(name: str) -> History:
    state = os.environ.get('XDG_STATE_HOME') or Path.home() / '.local' / 'state'
    folder = Path(state) / 'surveillance'
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f'{name}.history'
        path.touch()
    except OSError:
        return InMemoryHistory()
    return FileHistory(str(path))


PLAIN_STEP = 10
"""Percent between two plain lines."""


@contextmanager
def charge_display(
    start: float, say: Callable[[str], object], stream: TextIO | None = None, *, bar: bool = True
) -> Iterator[Callable[[float], None]]:
    """Show a charge while the context lasts.

    Args:
        start: Charge at the beginning, percent.
        say: Takes the lines that are said where no bar moves.
        stream: Where the bar moves; standard output unless given.
        bar: Allows a moving bar. Give False where something else moves the terminal's cursor.

    Yields:
        A function to call with each new charge in percent.
    """
    stream = sys.stdout if stream is None else stream
    console = Console(file=stream)
    if bar and console.is_terminal:
        columns = (
            TextColumn('{task.description}'),
            BarColumn(),
            TextColumn('{task.percentage:>3.0f} %'),
            TimeElapsedColumn(),
        )
        with Progress(*columns, console=console) as progress:
            task = progress.add_task('Charging', total=100.0, completed=round(start))
            yield lambda percent: progress.update(task, completed=percent)
        return
    shown = -1

    def show(percent: float) -> None:
        nonlocal shown
        step = int(percent // PLAIN_STEP)
        if step > shown:
            shown = step
            say(f'Charging: {step * PLAIN_STEP} %')

    shown = int(start // PLAIN_STEP) - 1
    show(start)
    yield show
