import importlib

import pytest

from frontend import open3d_loader
from frontend.open3d_loader import load_open3d


def failing(message):
    def import_module(_name):
        raise ImportError(message)

    return import_module


def test_open3d_loads_once():
    assert load_open3d() is load_open3d()
    assert load_open3d().__name__ == "open3d"


@pytest.mark.parametrize("library", ["libGL.so.1", "libEGL.so.1", "libusb-1.0.so.0", "libX11.so.6"])
def test_a_missing_system_library_is_named_with_the_command_that_installs_it(monkeypatch, library):
    message = f"{library}: cannot open shared object file: No such file or directory"
    monkeypatch.setattr(importlib, "import_module", failing(message))
    with pytest.raises(
        ImportError, match=f"{library}.*apt-get install --no-install-recommends libegl1 libgl1"
    ) as caught:
        load_open3d.__wrapped__()
    assert "\n" not in str(caught.value)


def test_another_missing_library_is_added_to_the_command(monkeypatch):
    monkeypatch.setattr(importlib, "import_module", failing("libgomp.so.1: cannot open shared object file"))
    with pytest.raises(ImportError, match="libegl1 libgl1 libusb-1\\.0-0 libgomp1"):
        load_open3d.__wrapped__()


def test_any_other_failure_says_how_to_install_open3d(monkeypatch):
    monkeypatch.setattr(importlib, "import_module", failing("No module named 'open3d'"))
    with pytest.raises(ImportError, match=r"No module named 'open3d'.*pip install --force-reinstall open3d"):
        load_open3d.__wrapped__()


def test_no_other_module_imports_open3d():
    from pathlib import Path

    sources = Path(open3d_loader.__file__).parent.rglob("*.py")
    importing = [path.name for path in sources if "import open3d" in path.read_text(encoding="utf-8")]
    assert importing in ([], ["open3d_loader.py"])
