"""Writing of files in parts gives the bytes of writing them whole."""

import datetime
from itertools import product

import numpy as np
import pytest

from pcsr import RunError, UserError
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import read_cloud, write_cloud
from pcsr.clouds.formats.chunks import CHUNKED, open_chunks
from pcsr.clouds.formats.row_writing import row_writer
from pcsr.streaming.examples import deciding
from tests.clouds.formats.test_chunks import coloured

TODAY = datetime.date.today()


def in_parts(source, target, size=64):
    """Write a file in parts to another one."""
    whole, chunked = read_cloud(source), open_chunks(source)
    writer = row_writer(target.suffix, whole.chosen(deciding(whole)), TODAY)
    writer.write(target, len(whole), (writer.rows(part) for part in chunked.chunks(size)))


@pytest.mark.parametrize(("given", "made"), list(product(CHUNKED, [".ply", ".npy"])))
def test_parts_give_the_bytes_of_the_whole(tmp_path, given, made):
    write_cloud(tmp_path / f"in{given}", coloured())
    in_parts(tmp_path / f"in{given}", tmp_path / f"parts{made}")
    write_cloud(tmp_path / f"whole{made}", read_cloud(tmp_path / f"in{given}"))
    assert (tmp_path / f"parts{made}").read_bytes() == (tmp_path / f"whole{made}").read_bytes()


@pytest.mark.parametrize(("given", "made"), list(product(CHUNKED, [".las", ".laz"])))
def test_las_in_parts_has_the_points_and_header_of_the_whole(tmp_path, given, made):
    write_cloud(tmp_path / f"in{given}", coloured())
    in_parts(tmp_path / f"in{given}", tmp_path / f"parts{made}")
    write_cloud(tmp_path / f"whole{made}", read_cloud(tmp_path / f"in{given}"))
    parts, whole = read_cloud(tmp_path / f"parts{made}"), read_cloud(tmp_path / f"whole{made}")
    np.testing.assert_array_equal(parts.points, whole.points)
    assert list(parts.columns) == list(whole.columns)
    for name, column in whole.columns.items():
        np.testing.assert_array_equal(parts.columns[name], column)
    one, other = parts.about["las"]["header"], whole.about["las"]["header"]
    for about in ("point_count", "mins", "maxs", "scales", "offsets", "creation_date", "number_of_points_by_return"):
        np.testing.assert_array_equal(getattr(one, about), getattr(other, about))


def test_colours_of_16_bits_become_8_bits_in_every_part(tmp_path):
    """The brightest colour is in the last part alone, and decides for the first."""
    wide = np.linspace(0, 65535, 100).astype(np.uint16)
    points = np.random.default_rng(0).normal(size=(100, 3))
    write_cloud(tmp_path / "in.las", Cloud(points, dict.fromkeys(("red", "green", "blue"), wide)))
    in_parts(tmp_path / "in.las", tmp_path / "out.ply", 10)
    red = read_cloud(tmp_path / "out.ply").columns["red"]
    assert red.dtype == np.uint8
    np.testing.assert_array_equal(red, wide // 256)


def test_a_part_that_needs_another_layout_is_an_error():
    small = Cloud(np.eye(3), {"n": np.arange(3, dtype=np.int64)})
    writer = row_writer(".ply", small, TODAY)
    with pytest.raises(RunError, match=r"do not fit into the rows of the \.ply file"):
        writer.rows(Cloud(np.eye(3), {"n": np.arange(3, dtype=np.int64) + 2**31}))


def test_other_formats_are_refused():
    with pytest.raises(UserError, match=r"a \.xyz file cannot be written in parts: choose one of \.ply, \.npy"):
        row_writer(".xyz", Cloud(np.eye(3)), TODAY)
