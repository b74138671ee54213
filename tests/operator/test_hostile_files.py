"""A damaged file costs one line that names it, and nothing beside it.

`python benchmarks/hostile_files.py` is the long run. The seed is drawn: a failure prints it.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from benchmarks.hostile_files import READERS, Reader, attack, write_sample

pytestmark = pytest.mark.unit

SHARE = 6
"""Damages of each file."""


@pytest.fixture(scope='module')
def sample(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('sample')
    write_sample(folder)
    return folder


@pytest.mark.parametrize('reader', READERS, ids=lambda each: each.path.rpartition('/')[2])
def test_a_damaged_file_costs_one_line_and_nothing_beside_it(
    sample: Path, tmp_path: Path, reader: Reader
) -> None:
    seed = int.from_bytes(os.urandom(4), 'big')
    found = attack(reader, sample, tmp_path, np.random.default_rng(seed), SHARE)
    assert not found.faults, f'seed {seed}'
