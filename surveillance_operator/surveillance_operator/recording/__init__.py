"""Recordings of missions: files that Foxglove and `ros2 bag` open, and the time line to replay."""

from surveillance_operator.recording.bag import (
    BagWriter,
    RecordingError,
    TopicType,
    prune,
    repair,
)
from surveillance_operator.recording.reading import messages
from surveillance_operator.recording.timeline import Timeline, TimelineWriter

__all__ = [
    'BagWriter',
    'RecordingError',
    'Timeline',
    'TimelineWriter',
    'TopicType',
    'messages',
    'prune',
    'repair',
]
