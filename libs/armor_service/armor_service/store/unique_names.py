"""Long lists of individuals that are all different, read from quads without the general mapping.

That all places and doors are different is most of the quads of a large map: two for each of them.
What is not exactly such a list is left to whoever reads the other axioms.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import Any, NamedTuple


class ListWords(NamedTuple):
    """Numbers of the words that lists of different individuals are written with.

    Attributes:
        type, all_different, nil: rdf:type, owl:AllDifferent, rdf:nil.
        members: owl:distinctMembers and owl:members.
        first, rest: rdf:first and rdf:rest.
    """

    type: int
    all_different: int
    nil: int
    members: frozenset[int]
    first: int
    rest: int


class DifferentList(NamedTuple):
    """A list of different individuals.

    Attributes:
        members: Numbers of the individuals.
        nodes: All nodes of the list, and the one that says that they are different.
    """

    members: list[int]
    nodes: tuple[int, ...]


def different_lists(
    quads: list[tuple[Any, ...]], links: Sequence[tuple[int, int, int]], words: ListWords
) -> tuple[list[DifferentList], list[tuple[Any, ...]]]:
    """Take the lists of different individuals out of quads.

    Args:
        quads: Quads that are no links of lists.
        links: Quads of rdf:first and rdf:rest that relate nodes.
        words: Numbers of the words.

    Returns:
        The lists, and all quads that take no part in them.
    """
    heads = {quad[0] for quad in quads if quad[1:3] == (words.type, words.all_different)}
    of_head = defaultdict(list)
    for quad in quads:
        if quad[0] in heads:
            of_head[quad[0]].append(quad)
    firsts = {node: value for node, predicate, value in links if predicate == words.first}
    rests = {node: value for node, predicate, value in links if predicate != words.first}
    twice: list[tuple[int, int, int]] = []
    if len(firsts) + len(rests) != len(links):
        ends = {words.first: firsts, words.rest: rests}
        twice = [link for link in links if ends[link[1]][link[0]] != link[2]]
    found = []
    # Whoever names a node of a list otherwise keeps the list from being read here.
    named = Counter(quad[0] for quad in quads)
    named.update(quad[2] for quad in (*quads, *twice) if len(quad) == 3)
    named.update(node for node, _, _ in twice)
    named.update(rests.values())
    for head, own in of_head.items():
        members = [quad[2] for quad in own if quad[1] in words.members]
        if head > 0 or len(own) != 2 or len(members) != 1:
            continue
        lists = _followed(members[0], firsts, rests, words.nil)
        if lists is None or len(set(lists.values())) < 2:
            continue
        if sum(named[node] for node in lists) != len(lists):
            continue
        found.append(DifferentList([*lists.values()], (head, *lists)))
        for node in lists:
            del firsts[node], rests[node]
    taken = {one.nodes[0] for one in found}
    left = [quad for quad in quads if quad[0] not in taken] + twice
    for predicate, links_left in ((words.first, firsts), (words.rest, rests)):
        left += [(node, predicate, value) for node, value in links_left.items()]
    return found, left


def _followed(
    node: int, firsts: dict[int, int], rests: dict[int, int], nil: int
) -> dict[int, int] | None:
    """Return nodes and members of a list, None: it is not one of named individuals, or shared."""
    found: dict[int, int] = {}
    while node != nil:
        member, following = firsts.get(node), rests.get(node)
        if node >= 0 or member is None or following is None or member <= 0 or node in found:
            return None
        found[node] = member
        node = following
    return found
