"""Another robot of the fleet that drives past is no news; what stands beside it is."""

from __future__ import annotations

from indoor_watch import Kind

from .test_change_monitor import HERE, Round, beams, texture


def drive_past(watch: Round, heard: bool, boxes=()) -> None:
    """Another robot of a radius of 0.25 m drives past one that stands, and stays."""
    for number in range(24):
        watch.time += 0.25
        x, y = 1.0 + 0.2 * min(number, 14), 1.2
        if heard:
            # What is told is an estimate, some centimetres and a moment off.
            watch.others.hear('robot2', x - 0.08, y + 0.05, watch.time - 0.2)
        things = [(x, y, 0.25), *boxes]
        watch.watcher.sweep(HERE, *beams(HERE, things, True, seed=number), watch.time)
        if number % 6 == 5:
            watch.watcher.assess(watch.time)


def watcher() -> Round:
    watch = Round()
    watch.visit('R1', HERE)
    watch.watcher.arrive('R1', watch.time)
    return watch


def test_a_robot_that_says_where_it_is_is_neither_a_person_nor_a_thing() -> None:
    unheard = watcher()
    drive_past(unheard, heard=False)
    assert [each.kind for each in unheard.book.events] == [Kind.PERSON]
    watch = watcher()
    drive_past(watch, heard=True)
    assert not [each for each in watch.book.events if each.kind in (Kind.OBJECT, Kind.PERSON)]


def test_a_box_elsewhere_is_told_of_while_a_robot_is_there() -> None:
    watch = watcher()
    drive_past(watch, heard=True, boxes=[(1.5, 3.8, 0.2)])
    assert [each.seen for each in watch.book.events if each.kind == Kind.OBJECT] == ['appeared']


def test_a_picture_is_not_compared_while_a_robot_may_be_in_it() -> None:
    watch = watcher()
    view = (1.0, 1.0, 0.5)
    empty, with_robot = texture(), texture()
    with_robot[150:330, 200:400] = texture(9)[150:330, 200:400]
    watch.watcher.picture(empty, view, watch.time, None)
    watch.others.hear('robot2', 3.0, 2.0, watch.time + 1.0)
    watch.watcher.picture(with_robot, view, watch.time + 1.0, None)
    assert not [each for each in watch.told if each.kind == Kind.VIEW]
    # It has not been heard for a while: what is there is news.
    watch.watcher.picture(with_robot, view, watch.time + 30.0, None)
    told = [each.state for each in watch.told if each.kind == Kind.VIEW]
    assert told[-1] == 'changed'
