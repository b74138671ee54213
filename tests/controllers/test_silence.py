"""A topic that a robot needs and does not hear is named."""

from __future__ import annotations

from surveillance_controllers.motion.silence import SILENT_AFTER, SilenceWatch
from surveillance_runtime.incidents import Incidents


def test_a_silent_topic_is_named_once_until_it_speaks() -> None:
    lines: list[str] = []
    silence = SilenceWatch(Incidents(lambda told: lines.append(told.line())))
    # What never came is told elsewhere, once.
    silence.look(1000.0)
    assert not lines
    silence.hear('scan', 0.0)
    for second in range(30):
        silence.hear('odom', float(second))
        silence.look(float(second))
    assert lines == [
        'incident [topic scan, alarm]: nothing is published on scan: the robot cannot drive'
    ]
    silence.hear('scan', 31.0)
    assert lines[1:] == ['incident [topic scan, over]: scan is published again']
    silence.look(31.0 + SILENT_AFTER - 1.0)
    silence.look(1000.0)
    assert {line.split(',')[0] for line in lines[2:]} == {
        'incident [topic odom',
        'incident [topic scan',
    }
