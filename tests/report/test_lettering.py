import pytest
from PIL import Image

from pcsr.errors import RunError
from pcsr.report.lettering import fitted, font, plain, png, rgb, save_png, sideways


@pytest.mark.parametrize(
    ("text", "shown"),
    [("cd ×10⁻³", "cd x10^-3"), ("×10³", "x10^3"), ("×10¹²", "x10^12"), ("0.1 ± 0.2", "0.1 ± 0.2"), ("a–b", "a-b")],
)
def test_letters_that_the_font_lacks_are_written_otherwise(text, shown):
    assert plain(text) == shown
    missing = bytes(font(20).getmask("\uffff"))
    assert all(bytes(font(20).getmask(letter)) != missing for letter in shown if letter != " ")


def test_a_text_is_cut_where_it_is_too_wide():
    long = "a name that goes on and on"
    assert fitted(long, 13, 1000) == long
    cut = fitted(long, 13, 80)
    assert cut.endswith("...")
    assert long.startswith(cut.removesuffix("..."))
    assert 60 < font(13).getlength(cut) <= 80


def test_a_text_reads_upwards():
    image = sideways("wide", 20)
    assert image.height > image.width
    assert image.getpixel((0, 0))[3] == 0


def test_a_colour_is_red_green_blue():
    assert rgb("#d0202b") == (0xD0, 0x20, 0x2B)


def test_a_file_opens_as_the_picture(tmp_path):
    image = Image.new("RGB", (7, 5), (1, 2, 3))
    save_png(image, tmp_path / "new" / "a.png")
    with Image.open(tmp_path / "new" / "a.png") as read:
        assert (read.format, read.size, read.convert("RGB").getpixel((6, 4))) == ("PNG", (7, 5), (1, 2, 3))


def test_fewer_colours_take_less_room():
    image = Image.radial_gradient("L").convert("RGB")
    assert len(png(image, colours=16)) < len(png(image)) / 2


def test_a_file_that_can_not_be_written_leaves_nothing(tmp_path):
    (tmp_path / "a").write_text("a file")
    with pytest.raises(RunError, match="could not be written"):
        save_png(Image.new("RGB", (2, 2)), tmp_path / "a" / "b.png")
    assert [path.name for path in tmp_path.iterdir()] == ["a"]
