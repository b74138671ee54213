"""The fields of a record as parameters."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from rclpy.parameter import Parameter

from strict_files.settings import converted, parameter, parameters
from surveillance_runtime.parameters import ParameterError


@dataclass(frozen=True)
class Lamp:
    colour: str = parameter('white', 'Colour.', choices=('white', 'red'))


@dataclass(frozen=True)
class Drive:
    speed: float = parameter(0.5, 'Top speed, m/s.', 0.01, 20.0)
    gears: int = parameter(3, 'Gears.', 1, name='gear_count')
    names: tuple[str, ...] = parameter(
        ('slow', 'fast'), 'Names.', check=lambda names: None if names else 'at least one name'
    )
    marks: frozenset[int] = converted(frozenset, [], 'Marks.', of=int)
    lamp: Lamp = parameters(Lamp)
    wheel: float = 0.1

    def __post_init__(self) -> None:
        if self.speed > 2 * self.gears:
            raise ValueError(f'speed is {self.speed}: expected at most twice the gears')


def declared(graph, parameters=None, **options):
    node = graph.add(type(graph.node), parameters=parameters, name='driver')
    return node, node.declare_fields(Drive(), prefix='drive.', **options)


def test_defaults_are_the_records_and_given_values_take_their_place(graph):
    _, default = declared(graph)
    assert default == Drive()
    given = {
        'drive.speed': 2,
        'gear_count': 5,
        'drive.names': ['one'],
        'drive.marks': [4, 4],
        'drive.colour': 'red',
    }
    _, drive = declared(graph, given)
    assert drive == Drive(2.0, 5, ('one',), frozenset({4}), Lamp('red'))
    assert isinstance(drive.speed, float)


@pytest.mark.parametrize(
    ('given', 'complaint'),
    [
        ({'drive.speed': 21.0}, 'parameter drive.speed: got 21.0, expected a number from 0.01'),
        ({'gear_count': 0}, 'parameter gear_count: got 0, expected an integer, at least 1'),
        ({'drive.speed': 9.0}, 'parameter drive.speed is 9.0: expected at most twice the gears'),
        ({'drive.names': []}, 'parameter drive.names: got [], expected at least one name'),
    ],
)
def test_values_out_of_bounds_are_refused(graph, given, complaint):
    with pytest.raises(ParameterError) as error:
        declared(graph, given)
    assert str(error.value).startswith(complaint)


def test_they_are_read_only_unless_somebody_follows(graph):
    fixed, _ = declared(graph)
    (refused,) = fixed.set_parameters([Parameter('drive.speed', value=1.0)])
    assert not refused.successful
    heard = []
    open_, _ = declared(graph, on_change=heard.append)
    for name, value in (('drive.speed', 1), ('drive.names', ['a', 'b']), ('drive.marks', [1])):
        (result,) = open_.set_parameters([Parameter(name, value=value)])
        assert result.successful
    assert heard == [
        Drive(1.0),
        Drive(1.0, names=('a', 'b')),
        Drive(1.0, names=('a', 'b'), marks=frozenset({1})),
    ]


def test_a_change_that_does_not_go_with_the_other_fields_is_refused(graph):
    heard = []
    node, _ = declared(graph, on_change=heard.append)
    (refused,) = node.set_parameters([Parameter('drive.speed', value=7.0)])
    assert refused.reason == 'parameter drive.speed is 7.0: expected at most twice the gears'
    both = [Parameter('drive.speed', value=7.0), Parameter('gear_count', value=4)]
    assert node.set_parameters_atomically(both).successful
    assert heard == [Drive(7.0, 4)]
