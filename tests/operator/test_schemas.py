"""Message types by name, and their definitions."""

from __future__ import annotations

import pytest
from std_msgs.msg import Bool

from surveillance_operator.recording.schemas import SEPARATOR, definition, message_class


def test_a_type_is_found_by_its_name_also_that_of_an_action() -> None:
    assert message_class('std_msgs/msg/Bool') is Bool
    feedback = message_class('surveillance_interfaces/action/FollowPath_FeedbackMessage')
    assert 'feedback' in feedback.get_fields_and_field_types()
    for name in ('std_msgs/msg/Nothing', 'nowhere/msg/Bool', 'Bool'):
        with pytest.raises(ValueError, match='is not installed here'):
            message_class(name)


def test_a_definition_has_those_of_the_types_that_it_uses() -> None:
    text = definition('geometry_msgs/msg/PoseStamped')
    first, *others = text.split(SEPARATOR)
    fields = [line.split() for line in first.splitlines() if line and line[0] != '#']
    assert fields == [['std_msgs/Header', 'header'], ['Pose', 'pose']]
    named = {each.split()[1] for each in others}
    assert {'std_msgs/Header', 'geometry_msgs/Pose', 'builtin_interfaces/Time'} <= named
