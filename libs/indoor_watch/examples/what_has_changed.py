"""Three rounds through two rooms; before the last one a box is put there. No ROS.

python libs/indoor_watch/examples/what_has_changed.py
"""

from __future__ import annotations

from datetime import UTC, datetime

from indoor_watch.demo import Demo

demo = Demo(say=None)
demo.round('what is normal')
demo.round('nothing new')
demo.rooms.box = (1.0, 2.8, 0.3)
demo.round('a box')
for event in demo.book.events:
    when = datetime.fromtimestamp(event.began, UTC)
    print(f'{when:%H:%M} {event.words()}, confidence {event.confidence:.2f}: {event.rule}')
