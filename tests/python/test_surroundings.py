"""What a mechanism meets and what drives it, on its page: floors, stops, drives, and what the list beside it shows."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from catalogue_runs import run_of
from chromium import DESKTOP, PROGRAM, Chromium
from fake_runs import data
from pages import EACH_ONCE, faults
from thorough import either

import partita as pt
from partita import viewer
from partita.viewer.page import fixed_bytes


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    if PROGRAM is None:
        pytest.skip("no Chromium is installed to open pages in")
    with Chromium() as opened:
        yield opened


def press() -> pt.Mechanism:
    """A driven press between stops, a sprung arm between stops, a ball on a floor."""
    m = pt.Mechanism("press", gravity=(0, -9.81, 0))
    crank = m.add_rod("crank", start=(0, 1, 0), end=(0.3, 1, 0), mass=0.3)
    rod = m.add_rod("rod", start=(0.3, 1, 0), end=(0, 0.4, 0), mass=0.5)
    ram = m.add_body("ram", mass=1, inertia=(0.01, 0.01, 0.01), position=(0, 0.4, 0))
    m.add_revolute("A", m.ground, crank, point=(0, 1, 0), axis=(0, 0, 1))
    m.add_revolute("B", crank, rod, point=(0.3, 1, 0), axis=(0, 0, 1))
    m.add_revolute("C", rod, ram, point=(0, 0.4, 0), axis=(0, 0, 1))
    m.add_prismatic("P", m.ground, ram, point=(0, 0.4, 0), axis=(0, 1, 0))
    m.add_drive("A", velocity=3.0)
    m.add_stop("P", lower=-0.4, upper=0.5, stiffness=1e3)
    arm = m.add_rod("arm", start=(0.6, 0.3, 0), end=(0.9, 0.6, 0), mass=0.2)
    m.add_revolute("D", m.ground, arm, point=(0.6, 0.3, 0), axis=(0, 0, 1))
    m.add_torsion_spring("D", stiffness=2.0, damping=0.05)
    m.add_stop("D", lower=-0.4, upper=0.5, stiffness=20, damping=0.01)
    ball = m.add_body("ball", mass=0.1, inertia=(4e-4,) * 3, position=(-0.5, 0.5, 0))
    m.add_planar("plane", m.ground, ball, point=(-0.5, 0.5, 0), normal=(0, 0, 1))
    m.add_contact("floor", ball, (0, 0, 0), m.ground, (0, 0.1, 0), radius1=0.08, normal=(0, 1, 0), stiffness=1e5)
    return m


def scene_of(mechanism: pt.Mechanism, start: Any = None) -> dict[str, Any]:
    t = np.linspace(0.0, 0.4, 21)
    return data(viewer.html(mechanism.simulate(0.4, t_eval=t, initial=start or mechanism.assemble(rates={"A": 3.0}))))


@pytest.mark.parametrize("turned", [0.0, 0.7])
def test_stops_and_floors_stand_where_they_act(turned: float) -> None:
    """Whatever position a run starts from, marks are where the drawing's zero position puts the ends."""
    m = press()
    scene = scene_of(m, m.assemble(targets={"A": turned, "D": 0.3 * turned}, rates={"A": 3.0}))
    (floor,) = scene["floors"]
    corners = np.array(floor["points"])
    assert np.allclose(corners[:, 1], 0.1) and floor["normal"] == [0, 1, 0]
    assert corners[:, 0].min() < -0.58 and corners[:, 0].max() > -0.42
    slide, arm = scene["stops"][:2], scene["stops"][2:]
    assert [np.mean(mark["points"], axis=0).round(6).tolist() for mark in slide] == [[0, 0, 0], [0, 0.9, 0]]
    for mark, limit in zip(arm, (-0.4, 0.5), strict=True):
        foot, tip = np.array(mark["points"])
        assert foot == pytest.approx([0.6, 0.3, 0.0], abs=1e-6)
        assert np.arctan2(*(tip - foot)[[1, 0]]) == pytest.approx(np.pi / 4 + limit, abs=1e-6)
    names = [joint["name"] for joint in scene["joints"]]
    assert [names[j] for j in scene["motors"]] == ["A"] and [names[j] for j in scene["coils"]] == ["D"]
    ball = {"kind": "ball", "radius": 0.08, "center": [0.0, 0.0, 0.0]}
    assert scene["parts"] == [{"body": 4, "part": ball}]


def test_one_floor_for_all_that_touches_it() -> None:
    m = pt.Mechanism("two balls", gravity=(0, -9.81, 0))
    for x in (0.0, 2.0):
        ball = m.add_body(f"ball {x}", mass=1, inertia=(0.01,) * 3, position=(x, 0.5, 0))
        m.add_free(f"free {x}", m.ground, ball)
        m.add_contact(f"c {x}", ball, (0, 0, 0), m.ground, (x, 0, 0), radius1=0.1, normal=(0, 1, 0), stiffness=1e5)
    (floor,) = data(viewer.html(m.simulate(0.1)))["floors"]
    corners = np.array(floor["points"])
    assert corners[:, 0].min() < -0.1 and corners[:, 0].max() > 2.1


@pytest.mark.skipif(PROGRAM is None, reason="no Chromium is installed to open pages in")
@pytest.mark.parametrize("screen", either(EACH_ONCE[:1], EACH_ONCE))
def test_the_page_of_a_press_is_legible(browser: Chromium, tmp_path: Path, screen: Any) -> None:
    m = press()
    run = m.simulate(1.0, t_eval=np.linspace(0, 1, 41), initial=m.assemble(rates={"A": 3.0}))
    path = viewer.write_html(run, tmp_path / "press.html")
    assert faults(browser, path, fixed_bytes(), screens=[screen]) == []
    run.save_animation(tmp_path / "press.gif", fps=5)


ROWS = (
    "[...document.querySelectorAll('SELECTOR .row')].filter((e) => e.checkVisibility())"
    ".map((e) => e.innerText.split('\\n'))"
)


@pytest.mark.skipif(PROGRAM is None, reason="no Chromium is installed to open pages in")
def test_driven_mechanisms_show_efforts_and_transmission(browser: Chromium, tmp_path: Path) -> None:
    run = run_of("gear-pair")
    browser.open(viewer.write_html(run, tmp_path / "gears.html"), DESKTOP)
    i = 100
    browser.value(f"partita.show({run.t[i]})")
    (effort, power) = browser.value(ROWS.replace("SELECTOR", "#efforts"))
    torque = float(run.joint("pinion shaft").drive[i, 0])
    assert float(effort[-1].split()[0]) == pytest.approx(torque, rel=5e-3) and effort[-1].endswith("N m")
    assert float(power[-1].split()[0]) == pytest.approx(torque * run.joint("pinion shaft").velocity[i, 0], rel=5e-3)
    (wheel,) = browser.value(ROWS.replace("SELECTOR", "#bars"))
    ratio = run.joint("wheel shaft").velocity[i, 0] / run.joint("pinion shaft").velocity[i, 0]
    assert float(wheel[-1]) == pytest.approx(float(ratio), rel=5e-3)


@pytest.mark.skipif(PROGRAM is None, reason="no Chromium is installed to open pages in")
def test_mechanisms_without_loops_show_coordinates(browser: Chromium, tmp_path: Path) -> None:
    run = run_of("planar-pendulum")
    browser.open(viewer.write_html(run, tmp_path / "pendulum.html"), DESKTOP)
    browser.value(f"partita.show({run.t[7]})")
    rows = browser.value(ROWS.replace("SELECTOR", "#bars"))
    assert [row[-2] for row in rows] == list(run.names.coordinates)
    assert [float(row[-1].split()[0]) for row in rows] == pytest.approx(run.q[7].tolist(), rel=5e-3)
