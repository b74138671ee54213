"""Recordings of missions: files that Foxglove and `ros2 bag` open, and the time line to replay."""

from surveillance_operator.recording.bag import BagWriter, TopicType, prune, repair
from surveillance_operator.recording.reading import Messages
from surveillance_operator.recording.timeline import Timeline, TimelineWriter

__all__ = [
    'BagWriter',
    'Messages',
    'Timeline',
    'TimelineWriter',
    'TopicType',
    'prune',
    'repair',
]
