"""Reading of clouds from bytes and text."""

import warnings
from io import BytesIO

from pcsr import PcsrWarning
from pcsr.clouds.formats import read_cloud_pipe


def read_cloud_bytes(data, suffix, **options):
    """Read a cloud from bytes or text, which messages call "it"."""
    content = data if isinstance(data, bytes) else data.encode()
    return read_cloud_pipe(BytesIO(content), suffix, "it", **options)


def read_with_notes(data, suffix, **options):
    """Read a cloud; return it with the warnings, without the name of the file ahead of them."""
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        cloud = read_cloud_bytes(data, suffix, **options)
    assert all(each.category is PcsrWarning and str(each.message).startswith("it: ") for each in warned)
    return cloud, [str(each.message).removeprefix("it: ") for each in warned]
