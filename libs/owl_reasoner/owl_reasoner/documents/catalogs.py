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


class _CatalogReader(XmlReader):
    def __init__(self, data: bytes, folder: Path) -> None:
        super().__init__(data)
        self.found: dict[str, Path] = {}
        self._bases: list[Path | None] = [folder]

    def namespace(self, prefix: str | None, iri: str | None) -> None:
        """Take a namespace; only that of catalogs matters."""

    def start(self, name: str, attributes: dict[str, str]) -> None:
        base = self._bases[-1]
        if reference := attributes.get(_BASE):
            base = _located(reference, base)
        self._bases.append(base)
        if name == _NAMESPACE + 'uri' and 'name' in attributes and attributes.get('uri'):
            target = _located(attributes['uri'], base)
            if target is not None:
                self.found.setdefault(attributes['name'], target)

    def end(self, name: str) -> None:
        self._bases.pop()

    def characters(self, text: str) -> None:
        """Text says nothing."""


def _located(reference: str, base: Path | None) -> Path | None:
    """Return where a relative reference or a file IRI leads; None where that is no file.

    `base` is None where it is no folder of this machine, but one of the web.
    """
    parts = urlsplit(reference)
    if parts.scheme not in ('', 'file') or (base is None and not parts.scheme):
        return None
    return (base or Path()) / unquote(parts.path)


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
    reader = _CatalogReader(data, catalog.parent)
    reader.read()
    return reader.found
