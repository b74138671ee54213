"""Images from files, videos and webcams, and how to subscribe to them."""

from surveillance_perception.stream.image_files import (
    ImageArray,
    ImageError,
    decode_image,
    read_image,
)
from surveillance_perception.stream.video import FrameSource, open_source

__all__ = ['FrameSource', 'ImageArray', 'ImageError', 'decode_image', 'open_source', 'read_image']
