"""Random ontologies of every kind of axiom go through a World's file, and out of it again."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from libs.armor_service.tests.test_world_ontology import File, plainly
from libs.owl_reasoner.tests.random_ontologies import RandomOntology


@pytest.mark.parametrize('seed', range(25))
def test_axioms_come_back_and_go_one_by_one(seed: int, tmp_path: Path) -> None:
    file = File(tmp_path)
    axioms = list(plainly(RandomOntology(seed).ontology(12, 12)))
    file.change(axioms)
    first = set(file.reopen())
    several = [axiom for axiom in axioms if len(getattr(axiom, 'classes', ())) > 2]
    assert set(axioms) - first <= set(several), 'an equivalence of three is one of each pair'
    left = sorted(first, key=str)
    random.Random(seed).shuffle(left)
    while left:
        file.change(removed=[left.pop()])
        if len(left) % 4 == 0:
            assert set(file.reopen()) == set(left)
    assert file.left() == []
