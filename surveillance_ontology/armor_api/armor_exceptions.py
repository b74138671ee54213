"""The exceptions of armor_py_api: `msg` says what went wrong, `code` is ARMOR's exit code."""

from armor_service.client import (
    ArmorError,
    ArmorServiceCallError,
    ArmorServiceInternalError,
)

ArmorPyException = ArmorError
"""What the two others derive from."""

__all__ = ['ArmorPyException', 'ArmorServiceCallError', 'ArmorServiceInternalError']
