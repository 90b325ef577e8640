"""Tests of opening a page: in the browser where there is a display, else said."""

import webbrowser
from pathlib import Path

import pytest

from sssslam.browser import open_page


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What a stand-in for the system's browser was asked to open."""
    asked: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda url: asked.append(url) or True)
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    return asked


def test_without_a_display_no_browser_is_asked(opened: list[str], tmp_path: Path) -> None:
    assert not open_page(tmp_path / "view.html")
    assert opened == []


@pytest.mark.parametrize("name", ["DISPLAY", "WAYLAND_DISPLAY", "BROWSER"])
def test_with_a_display_the_browser_gets_the_page_by_its_full_name(
    opened: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv(name, ":0")
    monkeypatch.chdir(tmp_path)
    assert open_page(Path("a b.html"))
    assert opened == [f"{tmp_path.as_uri()}/a%20b.html"]


def test_a_system_of_windows_needs_no_display_variable(
    opened: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.platform", "darwin")
    assert open_page(tmp_path / "view.html")
    assert len(opened) == 1


def test_a_browser_that_fails_is_as_good_as_none(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def fail(_: str) -> bool:
        raise webbrowser.Error("could not locate runnable browser")

    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(webbrowser, "open", fail)
    assert not open_page(tmp_path / "view.html")
