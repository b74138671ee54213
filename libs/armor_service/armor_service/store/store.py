"""A folder with the references of one service, each in the file of an owlready2 World.

    service = ArmorService(Settings(), store=Store(Path('state')))
    world = owlready2.World(filename='state/worlds/map.sqlite3', exclusive=False)

Every directive that changes something is committed before it is answered. One thread looks at the
files twenty times a second: for what other programs wrote, and for what could not be written yet.
"""

from __future__ import annotations

import fcntl
import hashlib
import sqlite3
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from urllib.parse import quote

from armor_service.protocol import StoreError
from armor_service.reference import Reference
from armor_service.store.journal_conversion import archive_journal, read_journal
from armor_service.store.reasoning_note import ReasoningNote
from armor_service.store.world_file import DAMAGED, ENDING, REPLACED, WorldFile

LOOK_PERIOD = 0.05
"""Seconds between two looks at the files."""
LOG_PERIOD = 20
"""Looks between two at the lengths of the write-ahead logs."""
IN_USE = 0.02
"""Seconds for which one look waits for a reference that is in use."""
MOST_WAITING = 200_000
"""Axioms that wait to be written at most, some 120 MB; further changes are refused."""


class Store:
    """Durable references.

    Args:
        directory: Where the files are; made if it is not there. One process at a time has it.
        synced: Keep what was answered over a loss of power as well, not only over SIGKILL; each
            answer then waits for the disk.

    Raises:
        StoreError: In use by another process, or it cannot be used.

    Attributes:
        directory: Where the files are.
        notes: One line for each thing that was found damaged or converted.
        warn: Told in one line when something cannot be written, and when it is; set by its user.
    """

    def __init__(self, directory: Path, *, synced: bool = False) -> None:
        self.directory = directory
        self.notes: list[str] = []
        self.warn: Callable[[str], None] = print
        self._synced = synced
        self._folder = directory / 'worlds'
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            self._lock_file = (directory / 'lock').open('w')
        except OSError as error:
            raise StoreError(f'{directory}: {error.strerror}') from None
        try:
            fcntl.flock(self._lock_file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock_file.close()
            raise StoreError(f'{directory}: in use by another process') from None
        self._reasoning = ReasoningNote(directory / 'reasoning')
        self._files: dict[str, WorldFile] = {}
        self._batch = threading.local()
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._look, name='store', daemon=True)

    def path(self, name: str) -> Path:
        """Return where the World of a reference is."""
        return self._folder / (file_stem(name) + ENDING)

    def recover(self) -> list[Reference]:
        """Make the references as they were answered for; what follows is derived by their `open`.

        Raises:
            StoreError: One of them cannot be read.
        """
        found = read_journal(self.directory, self.notes)
        for ref in found:
            self._file(ref.name).follow(ref)
            self._files[ref.name].create()
        if aside := archive_journal(self.directory):
            self.notes.append(
                f'{self.directory}: {len(found)} references of its journal are Worlds of owlready2 '
                f'now; the journal is put aside in {aside}'
            )
        for path in sorted(self._folder.glob(f'*{ENDING}')):
            if path.name.startswith((DAMAGED, REPLACED)) or any(
                path == file.path for file in self._files.values()
            ):
                continue
            file = WorldFile(path, self._told, synced=self._synced)
            recovered = file.recover(self.notes)
            if recovered is not None:
                self._files[recovered.name] = file
                found.append(recovered)
        for ref in found:
            ref.quarantine.deaths, ref.quarantine.died_at = self._reasoning.left(ref.name)
            self._note_reasoning(ref)
        self._thread.start()
        return found

    def _file(self, name: str) -> WorldFile:
        return self._files.setdefault(
            name, WorldFile(self.path(name), self._told, synced=self._synced)
        )

    def _told(self, text: str) -> None:
        self.warn(text)

    def _note_reasoning(self, ref: Reference) -> None:
        ref.on_open = partial(self.take_in, ref)
        ref.on_reasoning = partial(self._reasoning.note, ref.name)
        ref.on_completed = partial(self._reasoning.completed, ref.name)

    def loaded(self, ref: Reference) -> None:
        """Write a new reference, and follow it from now on; call it under its lock.

        Raises:
            StoreError: The store is closed.
        """
        self._check_open()
        if (old := self._files.pop(ref.name, None)) is not None:
            old.remove()
        file = self._file(ref.name)
        file.follow(ref)
        self._note_reasoning(ref)
        file.create()

    def dropped(self, name: str) -> None:
        """Forget a reference."""
        self._check_open()
        if (file := self._files.pop(name, None)) is not None:
            file.remove()

    def check(self, name: str) -> None:
        """Check that a change of a reference could be kept.

        Raises:
            StoreError: The store is closed, or too much waits to be written.
        """
        self._check_open()
        file = self._files.get(name)
        if file is not None and file.waiting > MOST_WAITING:
            raise StoreError(f'{file.path}: {file.waiting} changes wait to be written')

    def _check_open(self) -> None:
        if self._closed.is_set():
            raise StoreError(f'{self.directory}: closed')

    def take_in(self, ref: Reference) -> None:
        """Take in what other programs wrote by now; call it under the reference's lock.

        Not in the middle of a batch: what it changed so far would be written without the rest.
        """
        if ref.name in (getattr(self._batch, 'references', None) or ()):
            return
        file = self._files.get(ref.name)
        if file is not None and file.ref is ref and not file.is_behind and file.has_foreign():
            file.attend()

    def commit(self, ref: Reference) -> None:
        """Keep what changed in a reference, now or with the batch; call it under its lock."""
        pending: dict[str, Reference] | None = getattr(self._batch, 'references', None)
        if pending is not None:
            pending[ref.name] = ref
            return
        file = self._files.get(ref.name)
        if file is not None and file.ref is ref:
            self._check_open()
            file.commit()

    @contextmanager
    def batch(self) -> Iterator[None]:
        """Keep what changes inside at the end: each reference's changes as one.

        Raises:
            StoreError: At the end: the store was closed meanwhile.
        """
        references: dict[str, Reference] = {}
        self._batch.references = references
        try:
            yield
        finally:
            self._batch.references = None
            for ref in references.values():
                self.commit(ref)

    def sync(self, name: str) -> None:
        """Wait until what was committed is certain; without the reference's lock."""
        if self._synced and (file := self._files.get(name)) is not None:
            file.connection.sync()

    def backup(self, name: str, target: Path) -> str:
        """Write a copy of a reference's file, as of now.

        Returns:
            What the copy lacks, because the file could not be written; empty: nothing.

        Raises:
            StoreError: It cannot be written.
        """
        file = self._files.get(name)
        if file is None:
            raise StoreError(f'{name} was dropped meanwhile')
        try:
            return file.backup(target)
        except OSError as error:
            raise StoreError(f'{target}: {error.strerror}') from None
        except sqlite3.Error as error:
            raise StoreError(f'{target}: {error}') from None

    def close(self) -> None:
        """Let another process have the store; what could not be written is in the spill."""
        if self._closed.is_set():
            return
        self._closed.set()
        if self._thread.is_alive():
            self._thread.join()
        for file in self._files.values():
            file.close()
        self._reasoning.close()
        # A process that another thread is just starting holds the lock, too, until it runs.
        fcntl.flock(self._lock_file, fcntl.LOCK_UN)
        self._lock_file.close()

    def _look(self) -> None:
        looks = 0
        while not self._closed.wait(LOOK_PERIOD):
            looks += 1
            for file in list(self._files.values()):
                if file.wants_attention() and file.ref.lock.acquire(timeout=IN_USE):
                    try:
                        with suppress(StoreError):
                            file.attend()
                    except Exception as error:
                        # The others are to be looked at all the same.
                        self.warn(f'{file.path}: {type(error).__name__}: {error}')
                    finally:
                        file.ref.lock.release()
                if looks % LOG_PERIOD == 0:
                    file.connection.write_log_back()


def file_stem(name: str) -> str:
    """Return a reference's name as that of a file; a long one by what it is hashed to."""
    # Not with %: owlready2 opens a file as a URI.
    stem = quote(name, safe=' -_()+,@').replace('%', '=')
    if len(stem) > 200 or stem.startswith(('.', ' ', DAMAGED, REPLACED)):
        return hashlib.sha256(name.encode()).hexdigest()[:32]
    return stem
