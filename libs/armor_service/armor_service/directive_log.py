"""The debug log that LOG FILE and LOG SCREEN switch: one line for each directive and its answer."""

from __future__ import annotations

import errno
import os
import stat
import threading
from collections.abc import Callable
from datetime import UTC, datetime
from io import FileIO
from pathlib import Path

from armor_service.protocol import (
    DirectiveError,
    DirectiveRequest,
    DirectiveResponse,
)
from armor_service.rendering import one_line

MAX_SHOWN = 200


class DirectiveLog:
    """Writes directives to a file, to the console, to both or to neither; threads may share it.

    Args:
        screen: Writes one line to the console.
        max_bytes: How large the file may become; it is closed then.
    """

    def __init__(
        self, screen: Callable[[str], None] = print, max_bytes: int = 64 * 1024 * 1024
    ) -> None:
        self._screen = screen
        self._max_bytes = max_bytes
        self._file: FileIO | None = None
        self._lock = threading.Lock()
        self.on_screen = False

    @property
    def enabled(self) -> bool:
        """Whether anything is written."""
        return self.on_screen or self._file is not None

    def open(self, path: Path) -> None:
        """Append to a file from now on, instead of an earlier one.

        Raises:
            DirectiveError: It cannot be opened, or is a link, a device or a pipe.
        """
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK
        try:
            descriptor = os.open(path, flags | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise DirectiveError(f'{path}: {error.strerror}') from None
        file = FileIO(descriptor, 'a')
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            file.close()
            raise DirectiveError(f'{path}: expected a file')
        self._replace(file)

    def close(self) -> None:
        """Stop writing to a file."""
        self._replace(None)

    def _replace(self, file: FileIO | None) -> None:
        with self._lock:
            if self._file is not None:
                self._file.close()
            self._file = file

    def write(
        self, request: DirectiveRequest, response: DirectiveResponse, *, is_loaded: bool = True
    ) -> None:
        """Write a directive with its answer, as one line whatever they hold.

        Args:
            request: The directive.
            response: Its answer.
            is_loaded: There is an ontology that may be consistent or not.
        """
        shown = ', '.join(one_line(arg, MAX_SHOWN) for arg in request.args[:20])
        if len(request.args) > 20:
            shown += f', ... ({len(request.args)} arguments)'
        answer = 'ok' if response.success else f'exit code {response.exit_code}'
        if response.error_description:
            answer += f': {response.error_description}'
        objects = response.queried_objects
        if objects:
            answer += f' {[one_line(item, MAX_SHOWN) for item in objects[:20]]}'
        client, name, words = (
            one_line(text, MAX_SHOWN)
            for text in (request.client_name, request.reference_name, request.words)
        )
        line = one_line(
            f'{client!r} on {name!r}: {words} [{shown}] '
            f'-> {answer}{" (inconsistent)" if is_loaded and not response.is_consistent else ""}',
            limit=20_000,
        )
        if self.on_screen:
            self._screen(line)
        reason = self._append(line)
        if reason:
            self._screen(f'directive log: {reason}; the log file is closed')
            self.close()

    def _append(self, line: str) -> str:
        """Write a line to the file, if there is one; return why there can be no further one."""
        stamp = datetime.now(UTC).isoformat(timespec='milliseconds')
        data = f'{stamp} {line}\n'.encode('utf-8', 'backslashreplace')
        with self._lock:
            if self._file is None:
                return ''
            try:
                # Not buffered: what a full disk refused would be tried again at closing.
                if self._file.write(data) < len(data):
                    return os.strerror(errno.ENOSPC)
                full = os.fstat(self._file.fileno()).st_size >= self._max_bytes
            except OSError as error:
                return str(error.strerror)
        return f'{self._max_bytes} bytes are reached' if full else ''
