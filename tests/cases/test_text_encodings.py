"""Text in the encodings of spreadsheets and old scanners: read, or refused in words of ours."""

import codecs

import pytest

from pcsr import UserError
from tests.clouds.reading import read_with_notes

TEXT = "# Höhe über Null\nx;y;z;Fläche\n1;2;3;7\n4;5;6;8\n"


def read(data, suffix=".csv"):
    return read_with_notes(data, suffix)


@pytest.mark.parametrize(
    ("mark", "encoding", "guess"),
    [
        (b"", "utf-8", None),
        (codecs.BOM_UTF8, "utf-8", None),
        (codecs.BOM_UTF16_LE, "utf-16-le", None),
        (codecs.BOM_UTF16_BE, "utf-16-be", None),
        (codecs.BOM_UTF32_LE, "utf-32-le", None),
        (b"", "utf-16-le", "no byte order mark and was read as UTF-16"),
        (b"", "utf-16-be", "no byte order mark and was read as UTF-16"),
        (b"", "cp1252", "not UTF-8 and was read as Windows-1252"),
        (b"", "latin-1", "not UTF-8 and was read as Windows-1252"),
    ],
)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_all_encodings_give_the_same_cloud(mark, encoding, guess, end):
    cloud, said = read(mark + TEXT.replace("\n", end).encode(encoding))
    assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert {name: column.tolist() for name, column in cloud.columns.items()} == {"Fläche": [7, 8]}
    assert len(said) == (guess is not None)
    assert all(guess in each for each in said)


def test_signs_and_spaces_of_typesetting_are_plain_ones():
    assert read("−1.5\N{NO-BREAK SPACE}2 3\n".encode(), ".xyz")[0].points.tolist() == [[-1.5, 2, 3]]
    assert read(b"1\xa02\xa03\n", ".xyz")[0].points.tolist() == [[1, 2, 3]]
    text = "1 2 3\n\N{ZERO WIDTH NO-BREAK SPACE}4 5 6\n"  # two files in one
    assert read(text.encode(), ".xyz")[0].points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert read(b"1 2 3\r\n\x1a", ".xyz")[0].points.tolist() == [[1, 2, 3]]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_meshes_of_text_are_decoded_too(encoding, end):
    for suffix, text in ((".obj", "o Höhe\nv 1 2 3\nv 4 5 6\n"), (".off", "OFF\n# Höhe\n2 0 0\n1 2 3\n4 5 6\n")):
        cloud, said = read(text.replace("\n", end).encode(encoding), suffix)
        assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6]]
        assert said == []


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"\xff\xfe1\0 \x002\0 \x003", "begins as UTF-16-LE text, and byte 10 is no character of it: it is cut off"),
        (b"\xef\xbb\xbf1 2 3 \xff\n", "begins as UTF-8 text, and byte 9 is no character of it"),
        (b"1 2 3\n\0\0\0\0", "it is no text: byte 6 is 0x00"),
        (bytes(range(256)), "it is no text: byte 0 is 0x00"),
        (b"1 2 \x01\n", "it is no text: byte 4 is 0x01"),
    ],
)
def test_what_is_no_text_is_refused_with_the_byte(data, reason):
    with pytest.raises(UserError, match=reason) as caught:
        read(data, ".xyz")
    assert "codec" not in str(caught.value)
