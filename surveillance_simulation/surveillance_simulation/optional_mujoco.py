"""The package `mujoco`, an extra: None where it is not installed.

It chooses how to draw when it is imported first; without a display it must draw through EGL.
"""

from __future__ import annotations

import os

if not os.environ.get('DISPLAY'):
    os.environ.setdefault('MUJOCO_GL', 'egl')
try:
    import mujoco
except ImportError:
    mujoco = None

__all__ = ['mujoco']
