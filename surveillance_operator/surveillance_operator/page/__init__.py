"""The live page of a mission: its server, and what it serves."""

from surveillance_operator.page.hub import Hub
from surveillance_operator.page.server import Page

__all__ = ['Hub', 'Page']
