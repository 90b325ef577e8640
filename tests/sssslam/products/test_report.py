"""Tests of the report page."""

import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from sssslam.products.report import render_report
from sssslam.products.write import OWNED

FREE = {"meta", "img", "br"}


class Checker(HTMLParser):
    """Collects attributes and checks that elements close in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.images: list[dict[str, str | None]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.ids += [str(values["id"])] if "id" in values else []
        self.links += [str(values["href"])] if "href" in values else []
        self.images += [values] if tag == "img" else []
        if tag not in FREE:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def page(written: Path) -> str:
    """The report of the dive."""
    return (written / "report.html").read_text()


@pytest.fixture(scope="module")
def checked(page: str) -> Checker:
    """The page, parsed."""
    checker = Checker()
    checker.feed(page)
    return checker


def test_elements_close_in_order(checked: Checker) -> None:
    assert checked.open == []


def test_every_link_of_the_page_has_its_place(checked: Checker) -> None:
    assert {link[1:] for link in checked.links} <= set(checked.ids)


def test_the_page_needs_no_other_file(page: str, checked: Checker) -> None:
    assert all(str(image["src"]).startswith("data:image/png;base64,") for image in checked.images)
    assert all(image["alt"] for image in checked.images)
    assert len(checked.images) == 7
    assert not re.search(r"https?://|<script|<link|@import|url\(", page)


def test_names_from_outside_are_escaped(page: str) -> None:
    assert "dive &lt;7&gt; &amp; more.xtf" in page
    assert "<7>" not in page


def test_it_opens_with_a_verdict(page: str) -> None:
    assert page.index("The vehicle ran") < page.index("<img")
    assert "accepted as loop closures" in page


def test_wall_times_stand_in_one_marked_block(page: str) -> None:
    assert page.count("<!-- timings -->") == page.count("<!-- /timings -->") == 1
    before, rest = page.split("<!-- timings -->")
    block, after = rest.split("<!-- /timings -->")
    assert "12.35" in block
    assert "12.35" not in before + after
    assert block.count("<tr>") == 2


def test_a_metric_stands_beside_that_of_dead_reckoning(written: Path, tmp_path: Path) -> None:
    from shutil import copytree
    from types import SimpleNamespace

    from sssslam.products.write import add_metrics

    copytree(written, tmp_path / "out")
    values = {"ate": 1.0, "ate_dr": 4.0, "closure_precision": float("nan")}
    add_metrics(tmp_path / "out", [SimpleNamespace(name=n, value=v, unit="m", how="h") for n, v in values.items()])
    page = render_report(tmp_path / "out")
    assert re.search(r"<code>ate</code></td><td[^>]*>1\.00.m</td><td[^>]*>4\.00.m</td>", page)
    assert "<code>ate_dr</code>" not in page
    assert re.search(r"<code>closure_precision</code></td><td[^>]*>unknown</td><td[^>]*></td>", page)
    assert "fell from" in page


def test_the_report_is_made_of_the_other_products_alone(written: Path) -> None:
    assert render_report(written) == (written / "report.html").read_text()
    assert "report.html" in OWNED


def test_angles_are_told_in_degrees(written: Path, page: str) -> None:
    from sssslam.products.loop_closures import read_loop_closures

    closure = next(c for c in read_loop_closures(written / "loop_closures.csv")[0] if c.accepted)
    yaw = np.rad2deg(np.arctan2(closure.T_target_source[1, 0], closure.T_target_source[0, 0]))
    assert f"{yaw:.1f}".replace("-", "\u2212") in page


def test_what_looks_wrong_stands_before_what_was_chosen(page: str) -> None:
    # The dive has an altitude of 12.0 m from the first ping to the last.
    wrong, chosen = page.index("What looks wrong in it"), page.index("What was assumed, and what was chosen")
    assert wrong < page.index("<strong>altitude does not change for") < chosen
    assert chosen < page.index("Port is the finer channel.")


def test_a_run_without_findings_can_still_be_shown(written: Path, tmp_path: Path) -> None:
    out = shutil.copytree(written, tmp_path / "old")
    manifest = json.loads((out / "run.json").read_text())
    said = manifest.pop("findings")[0]["what"]
    (out / "run.json").write_text(json.dumps(manifest | {"notes": [said]}))
    page = render_report(out)
    assert "What looks wrong in it" not in page
    assert said in page
    # A finding is not repeated among the notes.
    (out / "run.json").write_text(json.dumps(manifest | {"notes": [said], "findings": [{"what": said, "advice": "x"}]}))
    assert render_report(out).count(said) == 1
