"""OWL ontologies in plain Python: reading, reasoning, explaining; and an ARMOR service over ROS.

    from surveillance_ontology import KnowledgeBase, read_ontology

    document = read_ontology('map.owl', iri)
    kb = KnowledgeBase(iri, document.axioms)
    kb.reason()
    kb.instances(iri + '#URGENT')

What is exported here needs neither ROS nor Java. Each name is imported when it is first used. The
axioms themselves are in `surveillance_ontology.owl`.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from surveillance_ontology.documents.reading import OntologyDocument as OntologyDocument
    from surveillance_ontology.documents.reading import read_ontology as read_ontology
    from surveillance_ontology.documents.writing import ontology_bytes as ontology_bytes
    from surveillance_ontology.documents.writing import write_ontology as write_ontology
    from surveillance_ontology.documents.xml_reading import OntologyFileError as OntologyFileError
    from surveillance_ontology.knowledge_base import Changes as Changes
    from surveillance_ontology.knowledge_base import KnowledgeBase as KnowledgeBase
    from surveillance_ontology.reasoner.explanation import Explanation as Explanation

_HOME = {
    'Changes': 'knowledge_base',
    'Explanation': 'reasoner.explanation',
    'KnowledgeBase': 'knowledge_base',
    'OntologyDocument': 'documents.reading',
    'OntologyFileError': 'documents.xml_reading',
    'ontology_bytes': 'documents.writing',
    'read_ontology': 'documents.reading',
    'write_ontology': 'documents.writing',
}
__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(importlib.import_module(f'{__name__}.{_HOME[name]}'), name)
