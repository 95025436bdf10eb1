"""A table says which split and group each mesh belongs to."""

import pytest
import trimesh

from pcsr import UserError
from pcsr_plugins.shapes.meshes import Meshes
from pcsr_plugins.shapes.meshes.table import Row, read_table


@pytest.fixture
def parts(tmp_path):
    folder = tmp_path / "parts"
    (folder / "deep").mkdir(parents=True)
    for name in ("a.stl", "b.stl", "deep/c.stl"):
        trimesh.creation.box((1, 2, 3)).export(folder / name)
    return folder


def table(parts, text):
    path = parts.parent / "table.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_rows_say_split_and_group_and_other_columns_are_ignored(parts):
    path = table(parts, 'id,file,split,group\n1,a.stl,train,x\n2,"b.stl",VAL,\n3,deep/c.stl,test,"x, y"\n')
    assert read_table(path, parts) == {
        "a.stl": Row("train", "x"),
        "b.stl": Row("validation", "b.stl"),
        "deep/c.stl": Row("test", "x, y"),
    }


def test_paths_may_begin_with_the_folders_own_name(parts):
    path = table(parts, "\ufefffile,split\nparts/a.stl,train\nparts\\deep\\c.stl,test\n")
    assert list(read_table(path, parts)) == ["a.stl", "deep/c.stl"]


def test_meshes_follow_the_table(parts):
    path = table(parts, "file,split,group\na.stl,test,x\nb.stl,test,x\ndeep/c.stl,train,y\n")
    shapes = Meshes(folder=str(parts), table=str(path))
    assert shapes.names("test") == ["a.stl", "b.stl"]
    assert shapes.names("train") == ["deep/c.stl"]
    assert shapes.names("validation") == []
    assert (shapes.item("a.stl").group, shapes.item("deep/c.stl").group) == ("x", "y")
    assert shapes.digest("a.stl") == shapes.digest("b.stl")
    assert shapes.digest("a.stl").split()[0] == shapes.digest("deep/c.stl").split()[0]
    assert shapes.digest("a.stl") != shapes.digest("deep/c.stl")


def test_a_file_that_the_table_forgot_is_said_and_an_empty_split_leaves_it_out(parts):
    path = table(parts, "file,split\na.stl,train\nb.stl,train\n")
    with pytest.raises(UserError, match=r"doesn't name 1 of the 3 files .* such as 'deep/c\.stl': add them"):
        Meshes(folder=str(parts), table=str(path)).names("train")
    path = table(parts, "file,split\na.stl,train\nb.stl,train\ndeep/c.stl,\n")
    assert Meshes(folder=str(parts), table=str(path)).names("train") == ["a.stl", "b.stl"]


def test_a_row_without_its_file_is_counted_among_those_that_fail(parts):
    path = table(parts, "file,split\na.stl,train\nb.stl,train\ndeep/c.stl,train\ngone.stl,train\n")
    shapes = Meshes(folder=str(parts), table=str(path))
    assert "gone.stl" in shapes.names("train")
    assert shapes.digest("gone.stl") == "missing"
    with pytest.raises(UserError, match=r"'gone\.stl' is not a file under"):
        shapes.item("gone.stl")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("file,kind\na.stl,train\n", "lacks the columns split: it needs file and split"),
        ("", "lacks the columns file, split"),
        ("file,split\n", "has no rows"),
        ("file,split\na.stl,train\na.stl,test\n", r"table\.csv:3: 'a\.stl' is there already"),
        ("file,split\na.stl,tset\n", r"table\.csv:2: there is no split 'tset'"),
        ("file,split,group\na.stl,train,x\nb.stl,test,x\n", "group 'x' is in train and, with 'b.stl', in test"),
        ("file,split\n../a.stl,train\n", r"'\.\./a\.stl' is not a path below"),
        ("file,split\n/a.stl,train\n", "is not a path below"),
        ("file,split\n,train\n", "'' is not a path below"),
    ],
)
def test_a_table_that_cannot_be_used_is_named_with_its_line(parts, text, said):
    with pytest.raises(UserError, match=said):
        read_table(table(parts, text), parts)


def test_a_table_that_is_no_text_or_not_there_is_named(parts):
    (parts.parent / "table.csv").write_bytes(b"file,split\n\xff\xfe,train\n")
    with pytest.raises(UserError, match="is not CSV in UTF-8"):
        read_table(parts.parent / "table.csv", parts)
    with pytest.raises(UserError, match=r"no\.csv cannot be read"):
        read_table(parts / "no.csv", parts)
