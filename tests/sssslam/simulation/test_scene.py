from pathlib import Path

import pytest
from pydantic import ValidationError

from sssslam.simulation import Scene, load_scene, scene_names, with_seed
from sssslam.simulation.scene import parse_scene


def test_every_shipped_scene_is_whole_and_says_what_it_is_for() -> None:
    names = scene_names()
    assert {"demo", "straight", "mud", "ripples"} <= set(names)
    for name in names:
        scene = load_scene(name)
        assert scene.name == name
        assert len(scene.description) > 20


def test_what_is_not_said_has_a_default() -> None:
    assert parse_scene("", "empty") == Scene(name="empty")


def test_a_section_that_does_not_say_its_kind_is_of_the_usual_one() -> None:
    scene = parse_scene("[survey]\nn_legs = 7\n[seabed]\nexponent = 1.0\n", "short")
    assert scene.survey.pattern == "lawnmower"
    assert scene.seabed.law == "lambert"


def test_another_seed_is_another_dive_of_the_same_scene() -> None:
    scene = load_scene("demo")
    assert with_seed(scene, 7) == scene.model_copy(update={"seed": 7})
    assert scene.seed != 7


def test_a_negative_seed_is_refused() -> None:
    with pytest.raises(ValueError, match="seed must not be negative, got -1"):
        with_seed(load_scene("demo"), -1)


def test_a_scene_cannot_be_changed_by_accident() -> None:
    with pytest.raises(ValidationError):
        load_scene("demo").seed = 3  # type: ignore[misc]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("sede = 1", "mine: sede: Extra inputs are not permitted, got 1"),
        ("[sonar]\nfrequenzy = 3.0", r"mine: sonar\.frequenzy: Extra inputs are not permitted, got 3\.0"),
        ("[terrain]\nspacing = -1.0", r"mine: terrain\.spacing: Input should be greater than 0, got -1\.0"),
        ("[drift]\ngrade = 'gold'", "mine: drift: grade 'gold' given, one of none, navigation"),
        ("sonar = 3", "mine: sonar: Input should be .* got 3"),
        ("[[terrain.layers]]\nkind = 'lava'", r"mine: terrain\.layers\.0: Input tag 'lava' found"),
        ("seed = -1\n[vehicle]\nspeed = 0", r"mine: seed: .*, got -1 \(1 more\)"),
        ("position = [95.0, 0.0]", r"mine: position: a latitude up to 90 and .* wanted, got \(95\.0, 0\.0\)"),
        ("[sonar]\nrange_max = inf", r"mine: sonar\.range_max: Input should be .*, got inf"),
        ("[vehicle]\nspeed = nan", r"mine: vehicle\.speed: Input should be .*, got nan"),
        ("seed = ", "mine: not TOML: Invalid value"),
        (
            "[survey]\npattern='polyline'\npoints=[[0,0],[0,0]]",
            r"mine: survey\.polyline\.points: points at least 0\.25",
        ),
    ],
)
def test_what_is_wrong_is_refused_by_name_in_one_line(text: str, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint) as caught:
        parse_scene(text, "mine")
    assert "\n" not in str(caught.value)


def test_a_scene_file_is_named_in_complaints_and_names_its_scene(tmp_path: Path) -> None:
    path = tmp_path / "reef2.toml"
    path.write_text("seed = 4\n", encoding="utf-8")
    assert load_scene(path) == Scene(name="reef2", seed=4)
    path.write_text("sead = 4\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"reef2\.toml: sead: Extra inputs are not permitted"):
        load_scene(path)


def test_files_are_looked_for_beside_the_scene_that_names_them(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(
        "[survey]\npattern = 'track'\nfile = 'way.csv'\n[[terrain.layers]]\nkind = 'grid'\nfile = 'floor.npz'\n",
        encoding="utf-8",
    )
    scene = load_scene(path)
    assert scene.survey.file == tmp_path / "way.csv"  # type: ignore[union-attr]
    assert scene.terrain.layers[0].file == tmp_path / "floor.npz"  # type: ignore[union-attr]


def test_a_scene_that_is_nowhere_is_refused_with_what_there_is() -> None:
    with pytest.raises(ValueError, match=r"atlantis given, a scene file or one of .*demo.*straight.* wanted"):
        load_scene("atlantis")


def test_a_scene_that_is_not_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bytes.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match=r"bytes\.toml: not a text file \(byte 0\)"):
        load_scene(path)
