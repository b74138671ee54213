"""OWL 2 DL in plain Python: documents, an incremental reasoner, rules, explanations.

    from owl_reasoner import KnowledgeBase, read_ontology

    document = read_ontology('map.owl', iri)
    kb = KnowledgeBase(iri, document.axioms)
    kb.reason()
    kb.instances(iri + '#URGENT')

Begin with `python -m owl_reasoner.demo`, then `knowledge_base`. `documents` reads and writes,
`reasoner` derives and explains, `owlready` does the same for owlready2's worlds. Nothing here needs
Java. Each name is imported when it is first used.

Public modules: `documents.manchester`, `documents.reading`, `documents.writing`, `knowledge_base`,
`notifier`, `open_world`, `owl`, `owl.axiom_text`, `owl.axioms`, `owl.entities`, `owl.expressions`,
`owl.vocabulary`, `owlready`.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from owl_reasoner.documents.reading import OntologyDocument as OntologyDocument
    from owl_reasoner.documents.reading import read_ontology as read_ontology
    from owl_reasoner.documents.writing import ontology_bytes as ontology_bytes
    from owl_reasoner.documents.writing import write_ontology as write_ontology
    from owl_reasoner.documents.xml_reading import OntologyFileError as OntologyFileError
    from owl_reasoner.knowledge_base import KnowledgeBase as KnowledgeBase
    from owl_reasoner.notifier import Changes as Changes
    from owl_reasoner.owlready.reasoning import sync_reasoner_native as sync_reasoner_native
    from owl_reasoner.reasoner.answers import Unknown as Unknown
    from owl_reasoner.reasoner.budget import Progress as Progress
    from owl_reasoner.reasoner.budget import ReasoningBudgetError as ReasoningBudgetError
    from owl_reasoner.reasoner.explanation import Explanation as Explanation

_HOME = {
    'Changes': 'notifier',
    'Explanation': 'reasoner.explanation',
    'KnowledgeBase': 'knowledge_base',
    'OntologyDocument': 'documents.reading',
    'OntologyFileError': 'documents.xml_reading',
    'Progress': 'reasoner.budget',
    'ReasoningBudgetError': 'reasoner.budget',
    'Unknown': 'reasoner.answers',
    'ontology_bytes': 'documents.writing',
    'read_ontology': 'documents.reading',
    'sync_reasoner_native': 'owlready.reasoning',
    'write_ontology': 'documents.writing',
}
__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(importlib.import_module(f'{__name__}.{_HOME[name]}'), name)
