"""Tests of writing whole or not at all."""

import stat
from pathlib import Path

import pytest

from sssslam.products.files import atomic_write, staged

OWNED = ("a.txt", "run.json", "parts/[0-9]*.ply")


def write_parts(out: Path, n_parts: int, text: str = "new") -> None:
    with staged(out, OWNED, last="run.json") as stage:
        (stage / "parts").mkdir()
        for i in range(n_parts):
            (stage / "parts" / f"{i:04d}.ply").write_text(text)
        (stage / "run.json").write_text(text)


def test_a_file_is_written_with_its_bytes_and_leaves_nothing_beside_it(tmp_path: Path) -> None:
    atomic_write(tmp_path / "a.txt", "π\n")
    assert (tmp_path / "a.txt").read_bytes() == "π\n".encode()
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_a_failed_write_keeps_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    atomic_write(tmp_path / "a.txt", "old")
    monkeypatch.setattr("os.replace", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        atomic_write(tmp_path / "a.txt", "new")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.txt": "old"}


def test_files_of_an_earlier_run_do_not_survive_and_those_of_the_user_do(tmp_path: Path) -> None:
    write_parts(tmp_path, 5)
    (tmp_path / "a.txt").write_text("stale")
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "parts" / "mine.ply").write_text("mine")
    write_parts(tmp_path, 2)
    names = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file())
    assert names == ["notes.txt", "parts/0000.ply", "parts/0001.ply", "parts/mine.ply", "run.json"]


def interrupt(out: Path) -> None:
    with staged(out, OWNED, last="run.json") as stage:
        (stage / "a.txt").write_text("half")
        raise KeyboardInterrupt


def test_an_interrupted_run_leaves_the_folder_as_it_was(tmp_path: Path) -> None:
    write_parts(tmp_path, 3, "old")
    with pytest.raises(KeyboardInterrupt):
        interrupt(tmp_path)
    assert not (tmp_path / "a.txt").exists()
    assert (tmp_path / "parts" / "0002.ply").read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["parts", "run.json"]


def test_the_last_file_is_absent_while_the_others_are_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import os

    write_parts(tmp_path, 2, "old")
    seen: list[tuple[str, bool]] = []
    replace = os.replace

    def watch(source: Path, target: Path) -> None:
        seen.append((Path(target).name, (tmp_path / "run.json").exists()))
        replace(source, target)

    monkeypatch.setattr("os.replace", watch)
    write_parts(tmp_path, 2, "new")
    assert seen == [("0000.ply", False), ("0001.ply", False), ("run.json", False)]


def test_products_can_be_read_by_others(tmp_path: Path) -> None:
    write_parts(tmp_path, 1)
    assert stat.S_IMODE((tmp_path / "run.json").stat().st_mode) & stat.S_IRUSR
    assert stat.S_IMODE((tmp_path / "parts").stat().st_mode) == stat.S_IMODE(_fresh_folder(tmp_path).stat().st_mode)


def _fresh_folder(folder: Path) -> Path:
    (folder / "fresh").mkdir()
    return folder / "fresh"


def test_a_file_in_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with pytest.raises(ValueError, match=r"must be a folder, got .*out which is or lies under a file"):
        write_parts(tmp_path / "out", 1)
    with pytest.raises(ValueError, match="lies under a file"):
        write_parts(tmp_path / "out" / "deeper", 1)


def test_a_folder_that_cannot_be_made_is_refused() -> None:
    with pytest.raises(ValueError, match="must be a folder that can be written"):
        write_parts(Path("/proc/nowhere"), 1)
