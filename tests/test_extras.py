"""Optional packages: found, missing, not to be had, broken."""

import sys

import pytest

from pcsr import UserError
from pcsr.extras import PACKAGES, imported, installed, remedy, require


@pytest.fixture
def machine(monkeypatch):
    def be(system, processor):
        monkeypatch.setattr("platform.system", lambda: system)
        monkeypatch.setattr("platform.machine", lambda: processor)

    be("Linux", "x86_64")
    return be


@pytest.fixture
def without(monkeypatch):
    def hide(*packages):
        for package in packages:
            monkeypatch.setitem(sys.modules, package, None)

    return hide


def test_what_is_there_is_imported_with_its_modules():
    assert imported("json", "this") is sys.modules["json"]
    assert imported("xml.dom.minidom", "this") is sys.modules["xml.dom.minidom"]
    require({"json": "this", "xml": "that"})


def test_what_is_missing_is_named_with_who_needs_it_and_the_extra(machine, without):
    without("plotly")
    assert not installed("plotly")
    said = "^the report needs plotly, which is not installed: pip install 'pcsr\\[report\\]'$"
    with pytest.raises(UserError, match=said) as error:
        imported("plotly.offline", "the report")
    assert error.value.exit_code == 2
    with pytest.raises(UserError, match=said):
        require({"json": "this", "plotly": "the report"})


def test_all_that_is_missing_is_one_message(machine, without):
    without("plotly", "ot", "lightning_fabric", "onnx", "onnxscript")
    needs = {"onnx": "a graph", "onnxscript": "a graph", "ot": "emd", "lightning_fabric": "training"}
    with pytest.raises(UserError) as error:
        require(needs)
    assert str(error.value) == (
        "a graph needs onnx and onnxscript, emd needs pot, training needs lightning-fabric, none of which is "
        "installed: pip install 'pcsr[onnx,train]'"
    )


def test_a_package_that_no_extra_brings_is_named_by_itself(machine):
    with pytest.raises(UserError, match=r"touch 'mine' needs nobody_has_this, .*: pip install nobody_has_this$"):
        require({"nobody_has_this": "touch 'mine'"})
    assert remedy(["nobody_has_this", "ot"]) == "pip install 'pcsr[train]' nobody_has_this"


def test_who_cannot_install_it_here_is_told(machine, without):
    without("embreex", "manifold3d")
    machine("Linux", "aarch64")
    with pytest.raises(UserError) as error:
        require({"embreex": "touch 'digit'"})
    assert str(error.value) == (
        "touch 'digit' needs embreex, which is not installed: embreex has no wheel for Linux on aarch64, so do this on "
        "another machine"
    )
    with pytest.raises(UserError, match=r"pip install 'pcsr\[simulate\]'; embreex has no wheel for Linux on aarch64"):
        require({"manifold3d": "shapes 'blobs'", "embreex": "touch 'digit'"})
    machine("Darwin", "arm64")
    assert remedy(["embreex"]) == "pip install 'pcsr[simulate]'"


def test_a_package_that_is_broken_is_told_from_one_that_is_missing(machine, tmp_path, monkeypatch):
    (tmp_path / "broken_one.py").write_text("import nobody_has_this")
    monkeypatch.syspath_prepend(tmp_path)
    assert installed("broken_one")
    with pytest.raises(
        UserError, match="broken_one, which is installed but cannot be loaded: it needs nobody_has_this"
    ):
        imported("broken_one", "this")


def test_the_table_names_packages_not_modules():
    assert all("." not in package for package in PACKAGES)


@pytest.mark.parametrize("kind", ["OSError", "ImportError"])
@pytest.mark.parametrize("library", ["libusb-1.0.so.0", "libGL.so.1", "libgomp.so.1", "libX11.so.6"])
def test_a_missing_library_of_the_system_is_named_with_its_remedy(machine, tmp_path, monkeypatch, kind, library):
    said = f"{library}: cannot open shared object file: No such file or directory"
    (tmp_path / "open3d.py").write_text(f"raise {kind}({said!r})")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "open3d", raising=False)
    with pytest.raises(UserError) as error:
        imported("open3d", "a surface")
    assert str(error.value) == (
        f"a surface needs open3d, which is installed but cannot be loaded: the library {library} of the system is "
        f"missing: on Debian and Ubuntu, apt-get install libusb-1.0-0 libgl1 libgomp1"
    )


def test_a_system_that_is_too_old_and_a_broken_package_are_told(machine, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "too_new.py").write_text("""raise ImportError("/lib/libm.so.6: version `GLIBC_2.35' not found")""")
    with pytest.raises(UserError, match=r"cannot be loaded: it needs glibc 2\.35 or newer"):
        imported("too_new", "this")
    (tmp_path / "damaged_one.py").write_text("raise ImportError('bad magic number')")
    with pytest.raises(UserError, match="it is damaged, or made for another version of Python: pip install damaged_"):
        imported("damaged_one", "this")
