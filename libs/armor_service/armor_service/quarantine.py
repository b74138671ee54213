"""Changes over which nobody reasoned yet, and those that are too hard to reason over.

Where reasoning takes too long, or ended the process, all changes since the last reasoning that was
completed go, then they come again one client's directive at a time; those that are too hard stay
out, and one line says which and why.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime

from armor_service.changes import AddAxiom, Change, RemoveAxiom, apply_all, change_text
from armor_service.rendering import shown
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.notifier import Changes
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.reasoner.budget import ReasoningBudgetError

MOST_DEATHS = 2
"""Ends of the process while it reasons over one ontology after which it is not tried again."""
WHOLE = -1
"""All changes at once."""
SHOWN = 3
"""Changes of one directive that a line names."""
KEPT = 100
"""Lines of `Quarantine.lines`."""


@dataclass(frozen=True, slots=True)
class Submission:
    """What one client's directive changes.

    Attributes:
        client: Who sent it.
        time: When, seconds since the epoch.
        changes: What it asks for.
    """

    client: str
    time: float
    changes: tuple[Change, ...]

    def __str__(self) -> str:
        text = '; '.join(map(change_text, self.changes[:SHOWN]))
        more = f' and {len(self.changes) - SHOWN} more' if len(self.changes) > SHOWN else ''
        when = datetime.fromtimestamp(self.time).isoformat(' ', 'seconds') if self.time else ''
        return f'{text}{more} (of client {shown(self.client)}{", " if when else ""}{when})'


class TooHardError(Exception):
    """Reasoning over an ontology was ended; its text says by what and where."""


@dataclass(slots=True)
class Quarantine:
    """What one reference was told since its last reasoning, and what of before was taken back.

    Attributes:
        untested: Changes since the last reasoning that was completed.
        lines: One line for each directive that was taken back.
        count: How many there were in this process.
        origin: What was asserted before `untested`, where the process did not reason yet.
        deaths: How often the process ended while it reasoned over the ontology.
        died_at: Over which of `untested`, or `WHOLE`.
    """

    untested: list[Submission] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)
    count: int = 0
    origin: tuple[Axiom, ...] = ()
    deaths: int = 0
    died_at: int = WHOLE

    @property
    def is_given_up(self) -> bool:
        """Whether the process ended so often that all changes at once are not tried again."""
        return self.deaths >= MOST_DEATHS

    @property
    def ends(self) -> str:
        """How often the process ended, as a reason."""
        return f'the process ended {self.deaths} times while it reasoned over it'

    def completed(self) -> None:
        """Forget what was reasoned over."""
        self.untested.clear()
        self.deaths, self.origin = 0, ()

    def since(self, count: int) -> str:
        """Return what was taken back since there were so many; empty: nothing."""
        new = self.count - count
        return '; '.join(self.lines[-new:]) if new else ''

    def roll_back(
        self, kb: KnowledgeBase, reason: Callable[[int], None], problem: str
    ) -> tuple[list[str], list[Change]]:
        """Find the changes over which reasoning takes too long, and go on without them.

        Args:
            kb: The ontology.
            reason: Reasons over it; its argument says over which of `untested`, or `WHOLE`.
            problem: Why all of them together are too hard.

        Returns:
            One line for each directive that was taken back, and the changes that undo them.

        Raises:
            ReasoningBudgetError: It takes too long without them as well, or was cancelled; the
                changes stay as they are.
        """
        told = list(self.untested)
        net: dict[Axiom, int] = {}

        def note(changes: Changes) -> None:
            for step, batch in ((1, changes.added), (-1, changes.removed)):
                for axiom, derived in batch:
                    if not derived:
                        net[axiom] = net.get(axiom, 0) + step

        taken: list[tuple[Submission, str]] = []
        unsubscribe = kb.subscribe(note)
        try:
            self._go_back(kb)
            reason(WHOLE)
            for place, one in enumerate(told):
                if why := self._tried(kb, reason, one, place, problem if len(told) == 1 else ''):
                    taken.append((one, why))
        except ReasoningBudgetError:
            kb.change(*([axiom for axiom in net if net[axiom] == step] for step in (-1, 1)))
            raise
        finally:
            unsubscribe()
        lines = [f'{one}: {why}' for one, why in taken]
        self.lines += lines
        self.count += len(lines)
        del self.lines[:-KEPT]
        gone: list[Change] = [RemoveAxiom(axiom) for axiom, step in net.items() if step < 0]
        come: list[Change] = [AddAxiom(axiom) for axiom, step in net.items() if step > 0]
        return lines, [*gone, *come]

    def _go_back(self, kb: KnowledgeBase) -> None:
        """Have the axioms of the last reasoning that was completed."""
        if not self.origin:
            kb.revert()
            return
        wanted = dict.fromkeys(self.origin)
        present = dict.fromkeys(kb.axioms())
        kb.change(
            [axiom for axiom in wanted if axiom not in present],
            [axiom for axiom in present if axiom not in wanted],
        )

    def _tried(
        self,
        kb: KnowledgeBase,
        reason: Callable[[int], None],
        told: Submission,
        place: int,
        problem: str,
    ) -> str:
        """Apply a change and reason; return why it was taken back, empty where it was not."""
        if not problem and self.is_given_up and place == self.died_at:
            problem = self.ends
        if problem:
            return problem
        apply_all(kb, told.changes)
        try:
            reason(place)
        except ReasoningBudgetError as error:
            if error.limit == 'cancelled':
                raise
            kb.revert()
            reason(WHOLE)
            return str(error)
        return ''
