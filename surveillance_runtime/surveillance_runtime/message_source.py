"""Which publisher a message is from: what rcl tells with each message, and rclpy leaves out.

rclpy's `take_message` gives a message's stamps and numbers, but not the identity of its publisher
(`rmw_message_info_t.publisher_gid`), by which several publishers of a topic are told from each
other. `SourceTaker` takes a serialized message by rcl's C function itself. The layouts are those of
`rmw/types.h` and `rcutils/types/uint8_array.h` of ROS 2 Jazzy.
"""

from __future__ import annotations

import ctypes
from typing import Any

SOURCE = 'publisher_gid'
"""Key of the publisher's identity in what is told with a message; bytes, as `endpoint_gid`."""
_FIRST_BYTES = 4096
_TAKEN = 0
_ALLOCATOR = [(name, ctypes.c_void_p) for name in ('allocate', 'free', 'move', 'zero', 'state')]


class _Allocator(ctypes.Structure):
    _fields_ = _ALLOCATOR


class _Bytes(ctypes.Structure):
    _fields_ = (
        ('buffer', ctypes.c_void_p),
        ('length', ctypes.c_size_t),
        ('capacity', ctypes.c_size_t),
        ('allocator', _Allocator),
    )


class _Info(ctypes.Structure):
    _fields_ = (
        ('source_timestamp', ctypes.c_int64),
        ('received_timestamp', ctypes.c_int64),
        ('publication_sequence_number', ctypes.c_uint64),
        ('reception_sequence_number', ctypes.c_uint64),
        ('implementation', ctypes.c_void_p),
        ('publisher_gid', ctypes.c_uint8 * 16),
        ('from_intra_process', ctypes.c_bool),
        # Room for what a later ROS adds at the end.
        ('more', ctypes.c_uint8 * 64),
    )


class SourceTaker:
    """Takes serialized messages with their publisher's identity, in one thread.

    Raises:
        OSError: rcl's libraries are not there under their usual names.
    """

    def __init__(self) -> None:
        rcutils = ctypes.CDLL('librcutils.so')
        self._take = ctypes.CDLL('librcl.so').rcl_take_serialized_message
        self._take.argtypes = [ctypes.c_void_p] * 4
        rcutils.rcutils_get_default_allocator.restype = _Allocator
        self._reset_error = rcutils.rcutils_reset_error
        self._free = rcutils.rcutils_uint8_array_fini
        self._free.argtypes = [ctypes.c_void_p]
        allocator = rcutils.rcutils_get_default_allocator()
        self._bytes, self._info = _Bytes(), _Info()
        rcutils.rcutils_uint8_array_init(
            ctypes.byref(self._bytes), ctypes.c_size_t(_FIRST_BYTES), ctypes.byref(allocator)
        )
        self._bytes_at, self._info_at = ctypes.addressof(self._bytes), ctypes.addressof(self._info)

    def take(self, handle: Any) -> tuple[bytes, dict[str, Any]] | None:
        """Take a message of a subscription's handle, which is held by the caller.

        Returns:
            The serialized message, and what is told with it, as rclpy gives it, with `SOURCE`;
            None: there was none.
        """
        if self._take(handle.pointer, self._bytes_at, self._info_at, None) != _TAKEN:
            self._reset_error()
            return None
        info = self._info
        told = {
            'source_timestamp': info.source_timestamp,
            'received_timestamp': info.received_timestamp,
            'publication_sequence_number': info.publication_sequence_number,
            'reception_sequence_number': info.reception_sequence_number,
            SOURCE: bytes(info.publisher_gid),
        }
        return ctypes.string_at(self._bytes.buffer, self._bytes.length), told

    def close(self) -> None:
        """Free the memory."""
        self._free(self._bytes_at)
