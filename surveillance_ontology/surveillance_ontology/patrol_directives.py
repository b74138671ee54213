"""Batches of directives about the patrol, and what their answers say.

Everything is told as one batch, which the server carries out in one piece. Every method blocks
while the server answers and belongs on a worker thread.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from armor_service.client import ArmorClient, ArmorServiceInternalError
from armor_service.facts import parse_fact
from armor_service.protocol import (
    DirectiveRequest,
    DirectiveResponse,
    ExitCode,
    name_in,
    value_in,
)
from surveillance_ontology.patrol_vocabulary import IS_IN, LOCATION, OntologyNotReadyError

CHUNK = 2000
"""Directives in one batch while a map is built."""


class PatrolDirectives:
    """Sends batches of directives, each of which must succeed.

    Args:
        armor: A client of the ontology's reference.
    """

    def __init__(self, armor: ArmorClient) -> None:
        self.armor = armor

    def request(self, words: str, *args: str) -> DirectiveRequest:
        """Make a directive of its words and arguments."""
        return self.armor.request(words, *args)

    def set_value(self, prop: str, individual: str, value: int) -> DirectiveRequest:
        """Make the directive that gives an individual a whole number as its only value."""
        return self.request('SET DATAPROP IND', prop, individual, 'LONG', str(value))

    def carry_out(
        self, requests: Sequence[DirectiveRequest], *, whole: bool = False
    ) -> list[DirectiveResponse]:
        """Send the directives in one batch; in several where there are very many, unless all must
        be of one moment.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses one of them.
        """
        answers: list[DirectiveResponse] = []
        size = len(requests) if whole else CHUNK
        for start in range(0, len(requests), size):
            chunk = requests[start : start + size]
            found = self.armor.batch(chunk).responses
            if len(found) != len(chunk):
                why = found[-1].error_description if found else ''
                raise ArmorServiceInternalError(
                    f'{len(found)} answers to {len(chunk)} directives: {why or "no reason given"}',
                    ExitCode.INVALID_COMMAND,
                )
            for wanted, answer in zip(chunk, found, strict=True):
                if not answer.success:
                    words = ' '.join((wanted.words, *wanted.args[:3]))
                    raise ArmorServiceInternalError(
                        f'{words}: {answer.error_description or "refused"}', answer.exit_code
                    )
            answers += found
        return answers

    def places(self) -> tuple[str, ...]:
        """Return the names of all places.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        (answer,) = self.carry_out([self.request('QUERY IND CLASS', LOCATION)])
        return names_in(answer)

    def robot_places(self, robot: str) -> tuple[str, ...]:
        """Return where the ontology has a robot: one place, or none yet.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        (answer,) = self.carry_out([self.request('QUERY OBJECTPROP IND', IS_IN, robot)])
        return names_in(answer)

    def contradiction(self) -> str:
        """Return which facts of the ontology clash, as a sentence; empty when it is consistent.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        answer = self.carry_out(
            [self.request('REASON'), self.request('QUERY EXPLAIN INCONSISTENCY')]
        )[-1]
        if answer.is_consistent:
            return ''
        return answer.queried_objects[0] if answer.queried_objects else 'for no known reason'


def is_gone(error: ArmorServiceInternalError) -> bool:
    """Tell whether the server refused something because it does not have the ontology."""
    return 'unknown reference' in str(error)


def names_in(answer: DirectiveResponse) -> tuple[str, ...]:
    """Return the local names in an answer, sorted."""
    return tuple(sorted(name_in(text) for text in answer.queried_objects))


def values_in(answer: DirectiveResponse, robot: str) -> dict[str, int]:
    """Return the value of each individual but the robot, by facts of one property."""
    found: dict[str, int] = {}
    for text in answer.queried_objects:
        name, value = parse_fact(text).arguments
        number = re.match(r'"?(\d+)\b', value)
        if name != robot and number:
            # Of several the shortest one counts, as for the rule.
            seconds = int(number[1])
            found[name] = min(seconds, found.get(name, seconds))
    return found


def time_in(what: str, answer: DirectiveResponse) -> int:
    """Return the latest of the times in an answer.

    Raises:
        OntologyNotReadyError: One of them is none.
    """
    try:
        return max((int(value_in(value)) for value in answer.queried_objects), default=0)
    except ValueError:
        raise OntologyNotReadyError(
            f'{what} is {", ".join(answer.queried_objects)}: expected a whole number'
        ) from None
