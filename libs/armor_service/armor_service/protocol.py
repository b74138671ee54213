"""Requests, responses and exit codes of ARMOR's two services, and what stands in an answer.

The fields and codes are those of ARMOR 2.2 (`armor_msgs`), so that its clients need not change.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

from owl_reasoner.owl.vocabulary import local_name


class ExitCode(IntEnum):
    """What a directive's ``exit_code`` says."""

    OK = 0
    UNSUPPORTED_TYPE = 101
    """A value type outside the table; ADD and REMOVE report it with success all the same."""
    REFERENCE_BUSY = 102
    """A manipulation while another client is mounted on the reference."""
    NO_REFERENCE_NAME = 201
    NO_COMMAND = 202
    MOUNT_REFUSED = 203
    NOT_IMPLEMENTED = 204
    """Defined by ARMOR, never sent."""
    INVALID_COMMAND = 205
    """Unknown command or reference, wrong arguments, a file that cannot be loaded or saved."""
    SEVERAL_VALUES = 206
    """Client side only: a single value was to be replaced, and there are several."""


@dataclass(slots=True)
class DirectiveRequest:
    """One directive. Commands are matched in any letter case, arguments are not.

    Attributes:
        client_name: Who asks; matters for mounting only, several nodes may share it.
        reference_name: The loaded ontology that is meant.
        command: For example ``ADD``.
        primary: Primary specification, for example ``OBJECTPROP``, or empty.
        secondary: Secondary specification, for example ``IND``, or empty.
        args: Local names, full IRIs, literals or texts, as the command wants them.
    """

    client_name: str
    reference_name: str
    command: str
    primary: str = ''
    secondary: str = ''
    args: Sequence[str] = ()

    @property
    def words(self) -> str:
        """The command with its specifications, for messages."""
        return ' '.join(word for word in (self.command, self.primary, self.secondary) if word)


class QueryItem(NamedTuple):
    """A variable of a row of a SPARQL answer, and its value."""

    key: str
    value: str


@dataclass(slots=True)
class DirectiveResponse:
    """The answer to one directive.

    Attributes:
        success: The directive did what it says.
        timeout: A query ran into its time limit.
        exit_code: See `ExitCode`.
        error_description: One line; may also carry a remark when ``success`` holds, for example
            that a class in a query is unknown.
        is_consistent: The ontology's state as of the last reasoning; False without a reference.
        queried_objects: ``<iri#Name>`` for entities, ``"value"^^xsd:type`` for literals.
        sparql_queried_objects: Variable and value of QUERY SPARQL FORMATTED, row after row.
    """

    success: bool = True
    timeout: bool = False
    exit_code: int = 0
    error_description: str = ''
    is_consistent: bool = False
    queried_objects: list[str] = field(default_factory=list)
    sparql_queried_objects: list[QueryItem] = field(default_factory=list)


@dataclass(slots=True)
class ListResponse:
    """The answers to a batch: ``success`` only if every directive succeeded."""

    success: bool
    is_consistent: bool
    responses: list[DirectiveResponse]


class StoreError(ValueError):
    """What a service keeps cannot be read or written; one line that says which file."""


class DirectiveError(Exception):
    """A directive that cannot be carried out.

    Args:
        description: One line for ``error_description``.
        exit_code: See `ExitCode`.
        success: What the response says; ARMOR reports unsupported types with success.
        timeout: A time limit was the reason.

    Attributes:
        response: The answer to the directive.
    """

    def __init__(
        self,
        description: str,
        exit_code: ExitCode = ExitCode.INVALID_COMMAND,
        *,
        success: bool = False,
        timeout: bool = False,
    ) -> None:
        super().__init__(description)
        self.response = DirectiveResponse(success, timeout, int(exit_code), description)


_IN_BRACKETS = re.compile(r'<([^<>]*)>')
RENDERED = re.compile(
    # Possessive: what it could go back to for each character fills the memory.
    r'"(?P<text>[^"\\]*+(?:\\.[^"\\]*+)*+)"'
    r'(?:\^\^(?:<(?P<iri>[^<>\s]+)>|(?P<name>[^\s<>"]+))'
    r'|@(?P<language>[A-Za-z]+(?:-[A-Za-z0-9]+)*))?\Z',
    re.DOTALL,
)
"""A literal as answers have it; see `rendering`."""


def name_in(rendered: str) -> str:
    """Return the local name in ``<iri#name>``; a text of another form as it is."""
    match = _IN_BRACKETS.fullmatch(rendered)
    return local_name(match[1]) if match else rendered


def value_in(rendered: str) -> str:
    """Return the value in ``"1665579740"^^xsd:long``.

    Raises:
        ValueError: Not of that form.
    """
    match = RENDERED.match(rendered)
    if match is None:
        raise ValueError(f'{rendered[:80]!r} is not a literal, expected "text"^^xsd:type')
    return unescaped(match['text'])


def unescaped(text: str) -> str:
    """Return what stands between the quotes of a literal without backslashes before characters."""
    # Not by a pattern: from Python 3.13 on that takes 50 bytes for each backslash.
    return '\\'.join(part.replace('\\', '') for part in text.split('\\\\'))
