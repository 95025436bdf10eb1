"""Upsampling of clouds that are larger than memory, from file to file.

The points are sorted into tiles on disk (`sorting`), the tiles are upsampled one after the other (`filling`), and the
result is put together (`upsampling`). All that is finished stays in a folder beside the result (`work_folder`), so that
an interrupted command continues where it was.
"""

from pcsr.streaming.upsampling import Streamed, upsample_file

__all__ = ["Streamed", "upsample_file"]
