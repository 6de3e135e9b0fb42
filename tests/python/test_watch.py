"""`partita new` and `partita watch`: a model file to change, and the page that follows it."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from chromium import PHONE, PROGRAM, Chromium

import partita as pt
from partita.cli import main
from partita.mechanism import Mechanism
from partita.mechanism.seen import still_text
from partita.watching import WatchPage


def made(name: str, where: Path, *options: str) -> Path:
    path = where / f"{name}.toml"
    assert main(["new", name, *options, "-o", str(path)]) == 0
    return path


def test_a_new_file_has_comments_shapes_and_the_axes_of_the_catalogue(tmp_path: Path) -> None:
    """Plates in place of rods: the same masses, centres, axes and pins; the inertia is that of a rectangle of length l
    and width w less two holes of radius r, by its closed form."""
    path = made("four-bar", tmp_path)
    text = path.read_text(encoding="utf-8")
    assert "partita watch" in text and "# [kg], not negative" in text and "--rate A=2" in text
    m, own = pt.load(path), pt.catalogue.load("four-bar")
    assert list(m.joints) == list(own.joints)
    for name, length in (("crank", 0.3), ("coupler", 0.9), ("rocker", 0.7)):
        body, rod = m._description.bodies[name], own._description.bodies[name]
        assert body.solid is not None and body.mass == rod.mass
        assert np.array_equal(body.position, rod.position) and np.array_equal(body.rotation, rod.rotation)
        assert body.com == pytest.approx([length / 2.0, 0.0, 0.0], abs=1e-4 * length)
        wide = {"crank": 0.024, "coupler": 0.074, "rocker": 0.058}[name]  # a twelfth in two digits, halved and doubled
        long, r = length + wide, wide / 4.0
        holes, area = np.pi * r**2, long * wide
        moment = area * (long**2 + wide**2) / 12.0 - 2.0 * holes * (r**2 / 2.0 + (length / 2.0) ** 2)
        assert body.inertia[2, 2] == pytest.approx(rod.mass * moment / (area - 2.0 * holes), rel=1e-9)
    assert m.compile().mobility == 1


def test_rods_are_kept_and_then_it_is_the_mechanism_of_the_catalogue(tmp_path: Path) -> None:
    m, own = pt.load(made("four-bar", tmp_path, "--rods")), pt.catalogue.load("four-bar")
    assert m.to_spec() == own.to_spec()


def test_nothing_is_overwritten_and_names_are_corrected(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = made("four-bar", tmp_path)
    assert main(["new", "four-bar", "-o", str(path)]) == 2
    assert main(["new", "five-baar"]) == 2
    assert main(["watch", str(tmp_path / "none.toml")]) == 2
    words = capsys.readouterr().err
    assert "exists already" in words and "'five-bar'" in words and "there is no such file" in words


@pytest.fixture
def browser() -> Iterator[Chromium]:
    if PROGRAM is None:
        pytest.skip("there is no Chromium to show a page in")
    with Chromium() as one:
        yield one


def drawn(m: Mechanism) -> tuple[str, pt.mechanism.check.Check]:
    return still_text(m), m.check()


def test_the_page_follows_the_file(tmp_path: Path, browser: Chromium) -> None:
    path = made("four-bar", tmp_path)
    text = path.read_text(encoding="utf-8")
    page = WatchPage(path, lambda: pt.load(path), drawn)
    try:
        assert not page.look().error
        browser.open(page.url, PHONE)

        def waited(number: int) -> list[str]:
            browser.value(
                f"(async () => {{ while (watching.number() < {number})"
                " await new Promise((r) => setTimeout(r, 20)); })()"
            )
            found: list[str] = browser.value(
                "['said', 'error', 'excerpt'].map((id) => document.getElementById(id).textContent)"
            )
            return found

        assert "1 degree of freedom, 3 of 20 constraints redundant" in waited(1)[0]
        wrong = text.replace("mass = 0.9", "mass = -0.9")
        path.write_text(wrong, encoding="utf-8")
        shown = page.look()
        line = 1 + wrong.splitlines().index("mass = -0.9")
        assert shown.error and shown.line == line
        words = waited(2)
        assert "cannot be drawn" in words[0] and f"line {line}" in words[1] and f"{line}  mass = -0.9" in words[2]
        assert browser.value("document.getElementById('drawn').className") == "old"
        pin = 'child = "rocker"\npoint = [1.0, 0.0, 0.0]'
        assert pin in text
        path.write_text(
            text.replace(pin, 'child = "rocker"\nchild_point = [1, 0, 0]\npoint = [4, 0, 0]'), encoding="utf-8"
        )
        page.look()
        assert "does not close" in waited(3)[0]  # drawn as it is, with its gap
        assert browser.value("document.getElementById('wrong').hidden")
        assert browser.reported == []
    finally:
        page.close()


def test_it_ends_with_ctrl_c(tmp_path: Path) -> None:
    path = made("four-bar", tmp_path)
    child = subprocess.Popen(
        [sys.executable, "-m", "partita", "watch", str(path), "--no-browser", "--time", "0.1"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert child.stdout is not None
    assert "http://127.0.0.1:" in child.stdout.readline() and "Ctrl+C" in child.stdout.readline()
    assert "1 degree of freedom" in child.stdout.readline()
    path.write_text("[mechanism\n", encoding="utf-8")
    assert "line 1" in child.stdout.readline()
    time.sleep(0.05)
    child.send_signal(signal.SIGINT)
    out, err = child.communicate(timeout=30)
    assert child.returncode == 0 and "Traceback" not in out + err
