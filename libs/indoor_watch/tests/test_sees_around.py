"""Whether a turn would show more is said once all is there that a look needs."""

from __future__ import annotations

from indoor_watch.sees_around import CAMERA_PATIENCE, SeesAround


def judged(around: SeesAround, now: float, **what: bool) -> bool | None:
    given = {'has_camera': False, 'has_map': True, 'all_around': True, **what}
    return around.judged(now, **given)


def test_nothing_is_said_before_a_sweep_and_a_map_came() -> None:
    around = SeesAround()
    assert judged(around, 1.0) is None
    around.scanned(1.0)
    assert judged(around, 1.0, has_map=False) is None
    assert judged(around, 1.0) is True
    assert judged(around, 1.0, all_around=False) is False


def test_a_camera_is_waited_for_and_looks_to_one_side() -> None:
    around = SeesAround()
    around.scanned(1.0)
    assert judged(around, 2.0, has_camera=True) is None
    around.pictured()
    assert judged(around, 2.0, has_camera=True) is False
    late = SeesAround()
    late.scanned(1.0)
    assert judged(late, 1.1 + CAMERA_PATIENCE, has_camera=True) is False
