"""What the directive service allows and how far it goes."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

DATA = Path(__file__).parent.parent / 'data'
"""The ontologies that come with this package."""


@dataclass(frozen=True)
class Settings:
    """Choices of an `ArmorService`.

    Attributes:
        directories: Where LOAD, SAVE and LOG may read and write.
        read_only_directories: Where LOAD may read as well.
        enforce_mount: Refuse changes by other clients while one is mounted; ARMOR does not.
        narrow_doubles: Store DOUBLE as xsd:float, as ARMOR does.
        allow_web: Let LOAD WEB fetch documents.
        sparql_derived: SPARQL sees derived facts too; ARMOR shows it the asserted ones only.
        sparql_timeout: Longest time a SPARQL query may take, seconds, whatever it asks for.
        sparql_rows: Most rows of a SPARQL answer.
        max_file_bytes: Largest document that is loaded.
        max_arguments: Most arguments of one directive.
        max_characters: Most characters of all arguments of one directive together.
        max_batch: Most directives in a list.
    """

    directories: tuple[str | Path, ...] = ('.',)
    read_only_directories: tuple[str | Path, ...] = field(default=(DATA,))
    enforce_mount: bool = True
    narrow_doubles: bool = False
    allow_web: bool = False
    sparql_derived: bool = True
    sparql_timeout: float = 30.0
    sparql_rows: int = 100_000
    max_file_bytes: int = 64 * 1024 * 1024
    max_arguments: int = 100_000
    max_characters: int = 16 * 1024 * 1024
    max_batch: int = 100_000
