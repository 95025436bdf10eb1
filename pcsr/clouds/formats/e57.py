"""E57."""

from pcsr.clouds.cloud import Cloud


def read(data: bytes) -> Cloud:
    raise NotImplementedError
