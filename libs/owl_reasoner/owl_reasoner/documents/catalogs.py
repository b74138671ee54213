"""Catalog files, which say where imported ontologies are (OASIS XML Catalogs 1.1).

Protege writes a `CATALOG` beside an ontology. Its ``uri`` entries are read, in groups and with
``xml:base`` as well; other kinds of entries name no ontology.
"""

from __future__ import annotations

from pathlib import Path
from urllib.parse import unquote, urlsplit

from owl_reasoner.documents.xml_reading import XML, OntologyFileError, XmlReader

CATALOG = 'catalog-v001.xml'
_NAMESPACE = 'urn:oasis:names:tc:entity:xmlns:xml:catalog'
_BASE = XML + 'base'
_MOST = 1 << 20


class _Reader(XmlReader):
    def __init__(self, data: bytes, folder: Path) -> None:
        super().__init__(data)
        self.found: dict[str, Path] = {}
        self._bases = [folder]

    def namespace(self, prefix: str | None, iri: str | None) -> None:
        """Take a namespace; only that of catalogs matters."""

    def start(self, name: str, attributes: dict[str, str]) -> None:
        base = self._bases[-1]
        if (stem := _path(attributes.get(_BASE, ''))) is not None:
            base = base / stem
        self._bases.append(base)
        if name == _NAMESPACE + 'uri' and 'name' in attributes:
            target = _path(attributes.get('uri', ''))
            if target is not None:
                self.found.setdefault(attributes['name'], base / target)

    def end(self, name: str) -> None:
        self._bases.pop()

    def characters(self, text: str) -> None:
        """Text says nothing."""


def _path(reference: str) -> str | None:
    """Return the path of a relative reference or a file IRI; None for anything else."""
    parts = urlsplit(reference)
    return unquote(parts.path) if reference and parts.scheme in ('', 'file') else None


def catalog_entries(catalog: Path) -> dict[str, Path]:
    """Return which file a catalog names for each IRI.

    Raises:
        OntologyFileError: It is no XML, or larger than 1 MiB.
        OSError: It cannot be read.
    """
    with catalog.open('rb') as file:
        data = file.read(_MOST + 1)
    if len(data) > _MOST:
        raise OntologyFileError(f'larger than {_MOST} bytes', path=str(catalog))
    reader = _Reader(data, catalog.parent)
    reader.read()
    return reader.found
