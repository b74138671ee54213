"""The part of the client that asks."""

from __future__ import annotations

import json
import re

from surveillance_ontology.armor.facts import ShortFact, parse_fact
from surveillance_ontology.armor.operations import ClientPart, Steps, checked, operation
from surveillance_ontology.armor.protocol import DirectiveResponse, ExitCode, ListResponse
from surveillance_ontology.armor.rendering import parse_rendered
from surveillance_ontology.owl.vocabulary import local_name

_IN_BRACKETS = re.compile(r'<([^<>]*)>')


def name_in(rendered: str) -> str:
    """The local name in ``<iri#name>``; a text of another form as it is."""
    match = _IN_BRACKETS.fullmatch(rendered)
    return local_name(match[1]) if match else rendered


def value_in(rendered: str) -> str:
    """The value in ``"1665579740"^^xsd:long``.

    Raises:
        ValueError: Not of that form.
    """
    return parse_rendered(rendered).lexical


class Query(ClientPart):
    """Directives that ask. All raise `ArmorServiceCallError` and `ArmorServiceInternalError`."""

    def _objects(self, words: str, *args: str) -> Steps[list[str]]:
        response: DirectiveResponse = checked((yield self.request(words, *args)))
        return response.queried_objects

    def _names(self, with_uri: bool, words: str, *args: str) -> Steps[list[str]]:
        objects = yield from self._objects(words, *args)
        return objects if with_uri else [name_in(rendered) for rendered in objects]

    @operation
    def ind_b2_class(self, class_name: str, with_URI: bool = False) -> Steps[list[str]]:  # noqa: N803
        """Individuals of a class: names, or ``<iri#name>`` when asked for."""
        return (yield from self._names(with_URI, 'QUERY IND CLASS', class_name))

    @operation
    def objectprop_b2_ind(
        self,
        objectprop_name: str,
        ind_name: str,
        with_URI: bool = False,  # noqa: N803
    ) -> Steps[list[str]]:
        """Individuals that an individual is related to: names, or ``<iri#name>``."""
        args = (objectprop_name, ind_name)
        return (yield from self._names(with_URI, 'QUERY OBJECTPROP IND', *args))

    @operation
    def dataprop_b2_ind(self, dataprop_name: str, ind_name: str) -> Steps[list[str]]:
        """Values of a data property, as ``"1665579740"^^xsd:long``; see `value_in`."""
        return (yield from self._objects('QUERY DATAPROP IND', dataprop_name, ind_name))

    @operation
    def check_ind_exists(self, ind_name: str) -> Steps[bool]:
        """Tell whether an individual is of any class."""
        response: DirectiveResponse = yield self.request('QUERY IND', ind_name)
        if not response.success and response.exit_code != ExitCode.OK:
            checked(response)
        return response.success and bool(response.queried_objects)

    @operation
    def class_of_ind(self, ind_name: str, with_URI: bool = False) -> Steps[list[str]]:  # noqa: N803
        """All classes of an individual: names, or ``<iri#name>``."""
        return (yield from self._names(with_URI, 'QUERY CLASS IND', ind_name, 'false'))

    @operation
    def bottom_class_of_ind(self, ind_name: str) -> Steps[str | None]:
        """Name of a class of an individual that has no subclass; None when there is none."""
        names = yield from self._objects('QUERY CLASS IND', ind_name, 'true')
        return names[0] if names else None

    @operation
    def subclasses(self, class_name: str, with_URI: bool = False) -> Steps[list[str]]:  # noqa: N803
        """Classes below a class: names, or ``<iri#name>``; without owl:Nothing."""
        objects = yield from self._objects('QUERY CLASS CLASS', class_name)
        below = [rendered for rendered in objects if rendered.startswith('<')]
        return below if with_URI else [name_in(rendered) for rendered in below]

    @operation
    def restrictions(self, class_name: str) -> Steps[list[str]]:
        """Definitions of a class as text."""
        return (yield from self._objects('QUERY CLASS RESTRICTIONS', class_name))

    @operation
    def dataprops_of_ind(self, ind_name: str, with_URI: bool = False) -> Steps[list[str]]:  # noqa: N803
        """Data properties that have a value for an individual."""
        return (yield from self._names(with_URI, 'QUERY IND DATAPROP', ind_name))

    @operation
    def objectprops_of_ind(self, ind_name: str, with_URI: bool = False) -> Steps[list[str]]:  # noqa: N803
        """Object properties that have a value for an individual."""
        return (yield from self._names(with_URI, 'QUERY IND OBJECTPROP', ind_name))

    @operation
    def sparql(self, query: str, timeout_ms: int = 0) -> Steps[list[dict[str, str]]]:
        """Run a SPARQL SELECT over asserted and derived facts.

        Args:
            query: The query with its prefixes.
            timeout_ms: Longest time in milliseconds; 0 leaves it to the server.

        Returns:
            One dictionary of variable and value for each row, without the unbound variables.
        """
        objects = yield from self._objects('QUERY SPARQL ROWS', query, str(timeout_ms))
        return [json.loads(row) for row in objects]

    @operation
    def facts(self, pattern: str) -> Steps[list[ShortFact]]:
        """Asserted and derived facts that match a pattern such as ``canReach(Robot1, ?)``."""
        parse_fact(pattern)
        objects = yield from self._objects('QUERY FACT', pattern)
        return [parse_fact(text) for text in objects]

    @operation
    def facts_by_origin(self, pattern: str) -> Steps[tuple[list[ShortFact], list[ShortFact]]]:
        """Facts that match a pattern: all of them, and those of them that are asserted."""
        parse_fact(pattern)
        rows = [
            self.request('QUERY FACT', pattern),
            self.request('QUERY FACT', pattern, 'true'),
        ]
        answer: ListResponse = yield rows
        every, asserted = (
            [parse_fact(text) for text in checked(response).queried_objects]
            for response in answer.responses
        )
        return every, asserted

    @operation
    def explain(self, fact: str) -> Steps[tuple[str, str] | None]:
        """Why a fact such as ``URGENT(R3)`` holds: a sentence and a tree; None when it does not."""
        parse_fact(fact)
        response: DirectiveResponse = yield self.request('QUERY EXPLAIN', fact)
        if not response.success and response.exit_code == ExitCode.OK:
            return None
        sentence, tree = checked(response).queried_objects
        return sentence, tree

    @operation
    def explain_inconsistency(self) -> Steps[tuple[str, str] | None]:
        """Why the ontology contradicts itself; None when it does not."""
        objects = yield from self._objects('QUERY EXPLAIN INCONSISTENCY')
        return (objects[0], objects[1]) if objects else None
