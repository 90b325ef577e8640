"""The command that shows a run: what it writes, when it opens a browser, and what it says where there is nothing."""

import sys
from pathlib import Path

import numpy as np
import pytest

from frontend.heightfield import Heightfield
from frontend.submaps import Submap
from sssslam.cli import main
from sssslam.products.ply import format_ply


@pytest.fixture
def shape(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a reconstruction by itself, of one submap; no display."""
    z = np.add.outer(np.linspace(-12.0, -11.0, 8), np.linspace(0.0, 1.0, 10))
    flat = {"sigma": np.full(z.shape, 0.1), "log_reflectivity": np.zeros(z.shape), "is_shadow": np.zeros(z.shape, bool)}
    submap = Submap(0, 0, 10, 5, 100.0, np.eye(4), np.eye(4), Heightfield(z, 1.0, (0.0, 0.0)), **flat)
    (tmp_path / "shape" / "submaps").mkdir(parents=True)
    (tmp_path / "shape" / "submaps" / "0000.ply").write_bytes(format_ply(submap, np.eye(4)))
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    return tmp_path / "shape"


def view(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["sssslam", "view", *map(str, arguments)])
    try:
        main()
    except SystemExit as stop:
        return int(str(stop.code or 0))
    return 0


def test_without_a_display_the_page_is_written_and_named(
    shape: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert view(monkeypatch, shape) == 0
    assert capsys.readouterr().out == (
        f"view: {shape / 'view.html'}\nno display or browser to show it; open it in any browser\n"
    )
    assert (shape / "view.html").is_file()


def test_only_who_asks_for_no_browser_gets_none(shape: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr("webbrowser.open", lambda url: opened.append(url) or True)
    assert view(monkeypatch, shape, "--no-open") == 0
    assert opened == []
    assert view(monkeypatch, shape) == 0
    assert opened == [(shape / "view.html").as_uri()]


@pytest.mark.parametrize(("name", "words"), [("none", "is not there"), (".", "no run.json and no submaps")])
def test_nothing_to_show_is_one_line(
    shape: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str, words: str
) -> None:
    assert view(monkeypatch, shape.parent / name) == 1
    errors = capsys.readouterr().err
    assert words in errors
    assert errors.startswith("sssslam: ")
    assert errors.count("\n") == 1


def test_a_damaged_submap_is_one_line(
    shape: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = shape / "submaps" / "0000.ply"
    path.write_bytes(path.read_bytes()[:-7])
    assert view(monkeypatch, shape) == 1
    assert "0000.ply: a submap that sssslam wrote is wanted" in capsys.readouterr().err
    assert not (shape / "view.html").exists()
