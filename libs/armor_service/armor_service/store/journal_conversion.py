"""Stores of before: a journal with snapshots, read once and put aside."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Any

from armor_service.changes import apply_all
from armor_service.protocol import StoreError
from armor_service.quarantine import Quarantine, Submission
from armor_service.reference import Buffering, Effort, Origin, Reference, knowledge_base
from armor_service.store.records import decode, entries, submission_of
from owl_reasoner.owl.axioms import Axiom

_KINDS = frozenset({'axioms', 'mount', 'change', 'flush', 'buffer', 'taken back', 'past'})
"""Kinds of records; 'past' says nothing of what is asserted now."""
_NAME = re.compile(r'(journal|snapshot)-(\d+)\.log\Z')


def read_journal(directory: Path, notes: list[str]) -> list[Reference]:
    """Make the references of a journal; none where there is none.

    Args:
        directory: Where it is.
        notes: Gets one line for each thing that is damaged.

    Raises:
        StoreError: A record that this version does not know, or the folder cannot be used.
    """
    parts = _parts(directory)
    start = max(parts['snapshot'], default=0)
    paths = [parts['snapshot'][start]] if start else []
    paths += [path for number, path in sorted(parts['journal'].items()) if number >= start]
    replay = _Replay()
    for path in paths:
        try:
            records, damaged = entries(path.read_bytes())
        except OSError as error:
            raise StoreError(f'{path}: {error.strerror}') from None
        if damaged:
            notes.append(f'{path}: {damaged} damaged entries are left out; it is kept as it is')
        for record in records:
            try:
                replay.take(record)
            except (IndexError, TypeError, ValueError) as error:
                raise StoreError(f'record {record!r:.80} cannot be read: {error}') from None
    if replay.orphans:
        notes.append(f'{directory}: {replay.orphans} changes of references that are not there')
    found = list(replay.references.values())
    for ref in found:
        ref.opened = False
    return found


def archive_journal(directory: Path) -> str:
    """Put a journal aside once its references are elsewhere; return in what folder, '' for none.

    Raises:
        StoreError: The folder cannot be used.
    """
    paths = [path for kind in _parts(directory).values() for path in kind.values()]
    if not paths:
        return ''
    aside = directory / f'converted-{time.strftime("%Y%m%d-%H%M%S")}'
    try:
        aside.mkdir(exist_ok=True)
        for path in paths:
            path.rename(aside / path.name)
    except OSError as error:
        raise StoreError(f'{aside}: {error.strerror}') from None
    return aside.name


def _parts(directory: Path) -> dict[str, dict[int, Path]]:
    parts: dict[str, dict[int, Path]] = {'journal': {}, 'snapshot': {}}
    for path in directory.iterdir():
        if match := _NAME.match(path.name):
            parts[match[1]][int(match[2])] = path
    return parts


class _Replay:
    """Makes references from records.

    Attributes:
        references: Those that there are, by name.
        orphans: Records of references that are not there.
    """

    def __init__(self) -> None:
        self.references: dict[str, Reference] = {}
        self.orphans = 0
        self._early: dict[str, list[Axiom]] = {}

    def take(self, record: list[Any]) -> None:
        what, name, *rest = record
        if what == 'load':
            settings, axioms, queue = rest
            self._load(name, settings, [decode(axiom) for axiom in axioms])
            self.references[name].buffering.waiting = [submission_of(*parts) for parts in queue]
            return
        if what == 'loaded':
            if name not in self.references:
                self._load(name, rest[0], self._early.pop(name, []))
            return
        if what == 'drop':
            self.references.pop(name, None)
            return
        ref = self.references.get(name)
        if what not in _KINDS:
            raise ValueError(f'unknown kind {what!r}')
        if what == 'axioms':
            added = [decode(axiom) for axiom in rest[0]]
            if ref is None:
                self._early.setdefault(name, []).extend(added)
            else:
                ref.kb.change(added)
        elif ref is None:
            self.orphans += 1
        elif what == 'mount':
            ref.mounted = rest[0]
        elif what == 'change':
            told = submission_of(*rest)
            if ref.buffering.manipulation:
                ref.buffering.waiting.append(told)
            else:
                self._apply(ref, [told])
        elif what == 'taken back':
            ref.quarantine.lines += rest[0]
            apply_all(ref.kb, [decode(change) for change in rest[1]])
            # What is left was reasoned over.
            ref.quarantine.untested.clear()
            ref.quarantine.origin = tuple(ref.kb.axioms())
        elif what == 'flush':
            self._flush(ref)
        elif what == 'buffer':
            ref.buffering.manipulation = rest[0]
            if not rest[0]:
                self._flush(ref)

    def _load(self, name: str, settings: dict[str, Any], axioms: list[Axiom]) -> None:
        try:
            self.references[name] = Reference(
                name,
                knowledge_base(settings['iri'], axioms),
                Origin(
                    settings['path'],
                    settings['format'],
                    settings['prefixes'],
                ),
                Buffering(settings['buffered_manipulation'], settings['buffered_reasoner']),
                settings['mounted'],
                Quarantine(lines=list(settings.get('quarantine', ()))),
                Effort(base=settings.get('base', 0.0)),
            )
        except KeyError as error:
            raise ValueError(f'no setting {error}') from None

    def _flush(self, ref: Reference) -> None:
        waiting, ref.buffering.waiting = ref.buffering.waiting, []
        self._apply(ref, waiting)

    def _apply(self, ref: Reference, told: list[Submission]) -> None:
        if not ref.quarantine.untested:
            ref.quarantine.origin = tuple(ref.kb.axioms())
        ref.quarantine.untested += told
        for one in told:
            apply_all(ref.kb, one.changes)
