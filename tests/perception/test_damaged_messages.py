"""No message of a camera ends the conversions or the detector.

`python benchmarks/perception.py --fuzz 100000` is the long run.
"""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.damaged_messages import damaged, taken
from marker_detection import MarkerDetector


@pytest.mark.parametrize('seed', range(4))
def test_damaged_messages_are_of_use_or_refused_in_one_line(seed):
    generator = np.random.default_rng(seed)
    detector = MarkerDetector()
    good = sum(taken(damaged(generator), detector) for _ in range(250))
    assert 20 < good < 230
