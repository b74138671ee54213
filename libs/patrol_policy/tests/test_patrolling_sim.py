"""Graph files of patrolling_sim are read as they are, and what is wrong with one is named."""

from __future__ import annotations

from pathlib import Path

import pytest

from patrol_policy.graph import GraphError
from patrol_policy.patrolling_sim import read_patrolling_sim

VERTICES = '0 10 10 1 1 E 40\n1 50 10 2 0 W 40 2 S 20\n2 50 30 1 1 N 20\n'


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / 'three.graph'
    path.write_text(text)
    return path


@pytest.mark.parametrize('header', ['3 100 80 0.1 -5.0 -4.0\n', '3\n100\n80\n0.1\n\n'])
def test_a_file_is_read_with_and_without_an_origin(tmp_path: Path, header: str) -> None:
    graph = read_patrolling_sim(
        written(tmp_path, header + VERTICES), speed=0.5, exploration_seconds=2.0
    )
    assert graph.leg_seconds == {'0': {'1': 8.0}, '1': {'0': 8.0, '2': 4.0}, '2': {'1': 4.0}}
    assert graph.seconds('0', '2') == pytest.approx(16.0)


@pytest.mark.parametrize(
    ('text', 'problem'),
    [
        ('', 'ends before the number of vertices'),
        ('3 100 80 0.1 0 0\n0 10 10 1 1 E', 'ends before the cost from vertex 0 to 1'),
        ('two', "expected the number of vertices, a number, got 'two'"),
        ('0 1 1 1 0 0', 'expected the number of vertices, a whole number of at least 1, got 0'),
        ('3 100 80 0 0 0\n' + VERTICES, 'the resolution is 0, expected more than 0'),
        ('3 100 80 0.1 0 0\n' + VERTICES + '7', '1 words after the last vertex'),
        ('1 9 9 0.1 0 0\n0 1 1 1 5 E 4\n', '0 leads to 5, which is not a place'),
        ('2 9 9 0.1 0 0\n0 1 1 1 1 E 4\n0 1 1 1 0 W 4\n', 'vertex 0 stands twice'),
    ],
)
def test_a_broken_file_is_named_with_what_was_expected(
    tmp_path: Path, text: str, problem: str
) -> None:
    with pytest.raises(GraphError, match=f'three.graph: {problem}'):
        read_patrolling_sim(written(tmp_path, text))


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(GraphError, match=r'nowhere\.graph: cannot be read'):
        read_patrolling_sim(tmp_path / 'nowhere.graph')
