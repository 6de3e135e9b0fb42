"""What a page shows at first: curves that move, outputs close enough for them, the ground that is rolled on, units."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from catalogue_runs import entry_of, run_of
from chromium import DESKTOP, PHONE, PROGRAM, Chromium
from fake_runs import data
from pages import LAYOUT

import partita as pt
from partita import viewer
from partita.result_view import FEW, turn_between_outputs

FINE = np.radians(20.0)
"""Farthest rotation from output to output of the catalogue's own runs: eighteen outputs a turn keep a curve's shape."""


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    if PROGRAM is None:
        pytest.skip("no Chromium is installed to open pages in")
    with Chromium() as opened:
        yield opened


@pytest.mark.parametrize("name", pt.catalogue.names())
def test_outputs_of_the_catalogue_keep_the_shape_of_curves(name: str) -> None:
    assert turn_between_outputs(run_of(name))[1] < FINE


def test_a_ball_that_turns_too_far_between_outputs_is_noticed() -> None:
    """Its joint has no angle: how far it turns follows from its angular velocity."""
    entry = entry_of("rolling-ball")
    name, step = turn_between_outputs(entry.simulate(t_eval=entry.t_eval(201)))
    spin = np.linalg.norm(run_of("rolling-ball").body("ball").angular_velocity, axis=1)
    assert name == "flight" and step > FEW
    assert step == pytest.approx(0.05 * np.median(spin), rel=0.05)


def test_plots_begin_with_what_moves() -> None:
    m = pt.Mechanism("a ball that falls", gravity=(0, -9.81, 0))
    ball = m.add_body("ball", mass=0.2, inertia=(8e-5, 8e-5, 8e-5), position=(0, 0.5, 0))
    m.add_planar("flight", m.ground, ball, point=(0, 0.5, 0))
    page = data(viewer.html(m.simulate(0.2)))
    assert page["curves"][page["firstCurves"][0]]["name"] == "velocity of flight.y"


def test_what_rolls_does_so_on_its_plane() -> None:
    """The plane of the ground, on an incline as well; what does not roll has none."""
    for name, normal in (("rolling-ball", [0, 0, 1]), ("whipple-bicycle", [0, 0, -1])):
        ground = data(viewer.html(run_of(name)))["ground"]
        assert list(ground) == ["point", "normal"]
        assert np.allclose([ground["point"], ground["normal"]], [[0, 0, 0], normal], rtol=0.0, atol=1e-9)
    assert data(viewer.html(run_of("gear-pair")))["ground"] is None


WHOLE = "document.getElementById('whole')"
OUTSIDE = "partita.joints().filter((joint) => joint.x < 0 || joint.x > partita.size()[0]).length"


def test_a_long_chain_begins_with_a_part_that_can_be_seen(browser: Chromium, tmp_path: Path) -> None:
    """On a phone a link of forty four-bars is eight pixels long; on a desktop they are seen whole, and so is a bar that
    is long and thin itself."""
    chain = viewer.write_html(run_of("n-four-bar"), tmp_path / "chain.html")
    gaps = "partita.joints().map((joint) => joint.x).sort((a, b) => a - b).map((x, i, all) => x - (all[i - 1] ?? x))"
    browser.open(chain, PHONE, at="#still")
    assert browser.value(f"Math.max(...{gaps})") > 40 and browser.value(OUTSIDE) > 60
    assert browser.value(f"{WHOLE}.checkVisibility()") and not browser.value(f"{WHOLE}.checked")
    browser.value(f"{WHOLE}.click()")
    browser.rest_a_frame()
    assert browser.value(OUTSIDE) == 0 and browser.value(f"Math.max(...{gaps})") < 16
    browser.value(f"{WHOLE}.click()")
    browser.rest_a_frame()
    assert browser.value(OUTSIDE) > 60
    m = pt.Mechanism("bar", gravity=None)
    m.add_revolute("A", m.ground, m.add_rod("bar", (0, 0, 0), (40, 0.1, 0), mass=1.0), point=(0, 0, 0))
    bar = m.to_html(tmp_path / "bar.html")
    for page, screen, at in ((chain, DESKTOP, ""), (chain, PHONE, "?bare"), (bar, PHONE, "")):
        browser.open(page, screen, "light", at)
        assert browser.value(OUTSIDE) == 0 and not browser.value(f"{WHOLE}.checkVisibility()"), (page, screen, at)


def test_outputs_left_out_are_judged_by_what_moves() -> None:
    """The hinge of a pendulum and the origin of its rod stay: its centre of mass does not."""
    m = pt.Mechanism("pendulum", gravity=(0, -9.81, 0))
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    run = m.simulate(10.0, t_eval=np.linspace(0.0, 10.0, 2001))
    assert 1e-7 < data(viewer.html(run))["strays"] < 1e-3


def test_numbers_have_no_needless_exponents_and_units_have_prefixes(browser: Chromium, tmp_path: Path) -> None:
    browser.open(viewer.write_html(run_of("four-bar"), tmp_path / "page.html"))
    written = {
        (1843.2, 3): "1843",
        (99_950.0, 3): "99950",
        (0.4561, 3): "0.456",
        (9.9996, 4): "10.00",
        (1.35e10, 4): "1.35e10",
    }
    for (x, digits), text in written.items():
        assert browser.value(f"partita.short({x!r}, {digits})") == text
    for value, text in {
        2e-12: "2 pN",
        5e-7: "500 nN",
        0.02: "0.02 N",
        2000.0: "2000 N",
        5e9: "5 GN",
        2e13: "2e13 N",
    }.items():
        assert browser.value(f"partita.withUnit({value!r}, 'N')") == text


def test_long_names_differ_where_they_are_cut(browser: Chromium, tmp_path: Path) -> None:
    browser.open(viewer.write_html(run_of("watt-axle"), tmp_path / "page.html"), PHONE)
    ends = browser.value("[...document.querySelectorAll('.row .name .end')].map((e) => e.textContent)")
    assert ".turn1" in ends and ".turn2" in ends
    assert not [word for word in browser.value(LAYOUT) if "the end of the name" in word]
    browser.value("document.querySelectorAll('.row .name').forEach((e) => { e.style.display = 'block'; })")
    assert any("the end of the name" in word for word in browser.value(LAYOUT))
