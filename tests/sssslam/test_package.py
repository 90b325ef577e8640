"""The distribution holds three top-level packages; a stranger of the same name is noticed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def run_python(code: str, folder: Path, path: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": path}
    return subprocess.run(
        [sys.executable, "-c", code], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("name", ["frontend", "backend"])
def test_a_foreign_package_in_front_is_named_with_its_path(tmp_path: Path, name: str) -> None:
    stranger = tmp_path / name / "__init__.py"
    stranger.parent.mkdir()
    stranger.write_text("raise RuntimeError('was run')\n")
    done = run_python("import sssslam", tmp_path, os.pathsep.join([str(tmp_path), str(ROOT)]))
    assert done.returncode == 1
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith(f"ImportError: sssslam needs its own package '{name}' from {ROOT}")
    assert str(stranger.resolve()) in last
    assert "was run" not in done.stderr


def test_a_foreign_module_in_front_is_named_too(tmp_path: Path) -> None:
    (tmp_path / "backend.py").write_text("")
    done = run_python("import sssslam", tmp_path, os.pathsep.join([str(tmp_path), str(ROOT)]))
    assert "ImportError: sssslam needs its own package 'backend'" in done.stderr
    assert str(tmp_path / "backend.py") in done.stderr


def test_a_folder_without_code_is_no_package(tmp_path: Path) -> None:
    # a namespace package never hides a regular one that comes later on the path
    (tmp_path / "frontend").mkdir()
    done = run_python("import sssslam", tmp_path, os.pathsep.join([str(tmp_path), str(ROOT)]))
    assert done.returncode == 0, done.stderr


def test_importing_loads_neither_optimiser_nor_compiler(tmp_path: Path) -> None:
    heavy = "{'gtsam', 'open3d', 'numba', 'matplotlib', 'rasterio'}"
    code = f"import sys, sssslam; print(sorted({heavy} & set(sys.modules)))"
    done = run_python(code, tmp_path, str(ROOT))
    assert done.stdout.strip() == "[]", done.stderr
