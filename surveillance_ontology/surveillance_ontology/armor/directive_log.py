"""The debug log that LOG FILE and LOG SCREEN switch: one line for each directive and its answer."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import TextIO

from surveillance_ontology.armor.protocol import (
    DirectiveError,
    DirectiveRequest,
    DirectiveResponse,
)

MAX_SHOWN = 200


class DirectiveLog:
    """Writes directives to a file, to the console, to both or to neither.

    Args:
        screen: Writes one line to the console.
    """

    def __init__(self, screen: Callable[[str], None] = print) -> None:
        self._screen = screen
        self._file: TextIO | None = None
        self.on_screen = False

    @property
    def enabled(self) -> bool:
        """Whether anything is written."""
        return self.on_screen or self._file is not None

    def open(self, path: Path) -> None:
        """Append to a file from now on, instead of an earlier one.

        Raises:
            DirectiveError: The file cannot be opened.
        """
        try:
            file = path.open('a', encoding='utf-8', errors='backslashreplace')
        except OSError as error:
            raise DirectiveError(f'{path}: {error.strerror}') from None
        self.close()
        self._file = file

    def close(self) -> None:
        """Stop writing to a file."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def write(self, request: DirectiveRequest, response: DirectiveResponse) -> None:
        """Write a directive with its answer."""
        shown = ', '.join(_cut(arg) for arg in request.args[:20])
        if len(request.args) > 20:
            shown += f', ... ({len(request.args)} arguments)'
        answer = 'ok' if response.success else f'exit code {response.exit_code}'
        if response.error_description:
            answer += f': {response.error_description}'
        objects = response.queried_objects
        if objects:
            answer += f' {[_cut(item) for item in objects[:20]]}'
        line = (
            f'{request.client_name!r} on {request.reference_name!r}: {request.words} [{shown}] '
            f'-> {answer}{"" if response.is_consistent else " (inconsistent)"}'
        )
        if self.on_screen:
            self._screen(line)
        if self._file is not None:
            stamp = datetime.now(UTC).isoformat(timespec='milliseconds')
            try:
                self._file.write(f'{stamp} {line}\n')
                self._file.flush()
            except OSError as error:
                self._screen(f'directive log: {error.strerror}; the log file is closed')
                self._file = None


def _cut(text: str) -> str:
    return text if len(text) <= MAX_SHOWN else text[: MAX_SHOWN - 3] + '...'
