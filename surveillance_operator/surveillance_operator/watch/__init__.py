"""The view of a running mission in a terminal."""

from surveillance_operator.watch.view import MissionView

__all__ = ['MissionView']
