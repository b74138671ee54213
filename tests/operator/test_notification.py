"""A notification has what the incident says, and one key for one call."""

from __future__ import annotations

import json
from pathlib import Path

from surveillance_operator.notify.notification import Notification, notification_of
from surveillance_runtime.incidents import (
    Incident,
    IncidentCall,
)
from tests.operator.notify_peers import of_door


def test_a_notification_of_a_finding_has_its_pictures_and_one_key_for_one_call(
    tmp_path: Path,
) -> None:
    told = of_door(evidence=('3_1_a.jpg', '../3_2_b.jpg'), action='shut it')
    call = IncidentCall('door', Incident(told, 10.0), 1, over=False)
    sent = notification_of(call, 'Robot1', 1000.0, tmp_path)
    assert (sent.event['number'], sent.event['place'], sent.event['rule']) == (
        *(3, 'C1'),
        'D1 is shut',
    )
    assert sent.pictures == (str(tmp_path / '3_1_a.jpg'), str(tmp_path / '3_2_b.jpg'))
    assert sent.key == notification_of(call, 'Robot1', 1200.0, tmp_path).key
    assert sent.key != notification_of(call._replace(number=2), 'Robot1', 1000.0, tmp_path).key
    assert Notification.from_kept(json.loads(sent.kept())) == sent
