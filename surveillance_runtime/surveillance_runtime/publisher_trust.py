"""Which of several publishers of a topic a reader believes.

The middleware tells with each message which publisher it is from. The first publisher that is heard
is believed as long as it is in the graph. What another one says waits: it is dropped when its
sender leaves, and believed when the publisher that is believed has left, or was replaced by a
publisher of the same node (one that was started again; the graph keeps its predecessor for a while
when that was killed). Where the owner's node is known by name, its publisher is believed whoever
spoke first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

SILENT = 1.5
"""An owner that repeats its state each second and says nothing for this long is gone, seconds."""
PATIENCE = 0.1
"""Seconds between two looks at the graph while the message of another publisher waits."""


class PublisherTrust:
    """The state that a reader believes, as bytes.

    Args:
        graph: Returns the node of each publisher that is in the graph now, by identity; asked only
            where somebody else than the publisher that is believed speaks.
        owner: Full name of the node that owns the topic where it runs; empty: any may.
        only: Believe nobody else.

    Attributes:
        value: What is believed; None: nothing came yet.
        due: When `settle` is to be called, seconds; None: nothing waits.
        rivals: Nodes of other publishers that spoke and are still there.
        node: The node that is believed, as the last look at the graph showed it; empty: not known.
        publisher: Identity of the publisher that is believed; empty: nobody, or not known.
    """

    def __init__(
        self,
        graph: Callable[[], Mapping[bytes, str]],
        owner: str = '',
        only: bool = False,
    ) -> None:
        self.value: bytes | None = None
        self.due: float | None = None
        self.rivals: tuple[str, ...] = ()
        self.node = ''
        self._graph = graph
        self._owner = owner
        self._only = only
        self.publisher = b''
        self._heard = float('-inf')
        self._held: dict[bytes, bytes] = {}

    def hear(self, value: bytes, publisher: bytes, now: float) -> bool:
        """Take a message; return whether it is believed at once.

        Args:
            value: The message.
            publisher: Identity of its publisher; empty where the middleware does not tell.
            now: Steady time, seconds.
        """
        if self.value is not None and publisher == self.publisher:
            self._believe(value, publisher, now)
            return True
        if self.value is None and self._may_begin(publisher):
            self._believe(value, publisher, now)
            return True
        self._held.pop(publisher, None)
        self._held[publisher] = value  # the last one is the newest
        if self.due is None:
            self.due = now + PATIENCE
        return False

    def _may_begin(self, publisher: bytes) -> bool:
        """Return whether the first message that comes is believed at once."""
        if not self._owner:
            return True
        nodes = self._graph()
        if nodes.get(publisher) == self._owner:
            return True
        # Somebody else, while the owner is not there, nor anybody who could be the owner.
        known = publisher in nodes and '' not in nodes.values()
        return known and not self._only and self._owner not in nodes.values()

    def settle(self, now: float) -> bool:
        """Look whether one that waits is believed by now; return whether there was such a one."""
        if self.due is None or now < self.due:
            return False
        nodes = self._graph()
        heir = self._heir(nodes, now)
        if heir is not None:
            self._believe(self._held.pop(heir), heir, now)
        self._held = {each: value for each, value in self._held.items() if each in nodes}
        self.rivals = tuple(sorted({nodes[each] or 'a nameless node' for each in self._held}))
        self.node = nodes.get(self.publisher, '')
        self.due = now + PATIENCE if self._held else None
        return heir is not None

    def _heir(self, nodes: Mapping[bytes, str], now: float) -> bytes | None:
        """Return the publisher that takes the place of the one that is believed, if any."""
        newest = [*reversed(self._held)]
        believed = nodes.get(self.publisher) if self.value is not None else None
        owned = self._only or self._owner in nodes.values()
        if self._owner and believed != self._owner and owned:
            return next((each for each in newest if nodes.get(each) == self._owner), None)
        if believed is None:
            # Whoever is still there before one that has left, too.
            return next((each for each in newest if each in nodes), next(iter(newest), None))
        if now - self._heard <= SILENT:
            return None
        return next((each for each in newest if nodes.get(each) == believed != ''), None)

    def _believe(self, value: bytes, publisher: bytes, now: float) -> None:
        self.value, self.publisher, self._heard = value, publisher, now
