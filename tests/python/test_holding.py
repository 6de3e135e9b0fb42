"""Mechanisms of the catalogue that hold at times: their known answers in every setting, and who refuses them."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from catalogue_runs import WITHOUT_EVENTS, entry_of, run_of

import partita as pt
from partita.errors import DescriptionError

NAMES = [name for name in pt.catalogue.names() if name not in WITHOUT_EVENTS]
ROOT = Path(__file__).parents[2]
each = pytest.mark.parametrize("name", NAMES)
BY_ELEMENTS = [name for name in NAMES if "events" not in pt.catalogue.entry(name).options]
of_elements = pytest.mark.parametrize("name", BY_ELEMENTS)


def kinds(run: pt.Result) -> list[tuple[str, str]]:
    return [(event.name, event.kind) for event in run.events]


def test_each_kind_of_element_has_an_entry() -> None:
    found = {
        (force.kind, getattr(force, "restitution", None) is not None)
        for name in NAMES
        for force in pt.catalogue.load(name).forces.values()
    }
    assert {("latch", False), ("freewheel", False), ("friction", False), ("contact", True)} <= found


@each
def test_known_answers_in_absolute_coordinates_too(name: str) -> None:
    entry = entry_of(name)
    m = entry.mechanism()
    start = m.convert(entry.initial(m), "absolute")
    run = entry.simulate(coordinates="absolute", initial=start)
    assert run.success and run.certificate.verdict == "valid", run.message
    assert not [str(m) for m in entry.measure(run) if not m.passed]


@each
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
def test_events_are_the_same_at_any_tolerance(name: str, rtol: float) -> None:
    """Where they are is as exact as the run, here of a few slow motions over seconds."""
    known, run = run_of(name), entry_of(name).simulate(rtol=rtol, atol=1e-2 * rtol)
    assert run.success and run.certificate.verdict == "valid", run.message
    assert kinds(run) == kinds(known)
    assert run.events.t == pytest.approx(known.events.t, abs=rtol, rel=rtol)


@each
def test_compiled_runs_are_the_same_to_the_bit(name: str) -> None:
    plain, run = (entry_of(name).simulate(compiled=compiled) for compiled in (False, True))
    assert kinds(run) == kinds(plain) and (run.events.t == plain.events.t).all()
    assert np.array_equal(run.q, plain.q) and np.array_equal(run.v, plain.v)


@each
def test_saved_and_loaded_they_hold_the_same(name: str, tmp_path: Path) -> None:
    entry = entry_of(name)
    path = tmp_path / "m.toml"
    entry.mechanism().save(path)
    m = pt.load(path)
    run = m.simulate(entry.duration, initial=entry.start(m), t_eval=entry.t_eval(), **entry.options)
    assert kinds(run) == kinds(run_of(name)) and (run.events.t == run_of(name).events.t).all()


@of_elements
def test_who_cannot_follow_them_refuses_them_by_name(name: str, tmp_path: Path) -> None:
    m = pt.catalogue.load(name)
    calls: list[Callable[[], Any]] = [
        lambda: m.to_playground(tmp_path / "m.html"),
        lambda: m.export_c(tmp_path / "m.c"),
    ]
    for call in calls:
        with pytest.raises(DescriptionError, match="only simulate, steppers and FMUs can"):
            call()


@of_elements
def test_steppers_and_ensembles_follow_them(name: str) -> None:
    entry = pt.catalogue.entry(name)
    run = entry.simulate(rtol=1e-10, atol=1e-12)
    m, start, end = entry.mechanism(), run.state(float(run.t[0])), float(run.t[-1] - run.t[0])
    sim = m.stepper(end / 400, initial=start, substeps=4)
    seen = []
    for _ in range(400):
        sim.step()
        seen += [(event.name, event.kind) for event in sim.events]
    assert sim.q == pytest.approx(run.q[-1], rel=1e-5, abs=1e-6)  # its steps do not end at kinks of loads
    first = [(event.name, event.kind) for event in run.events if event.t > run.t[0]]
    assert seen == first
    found = m.ensemble(t_eval=[float(run.t[-1])], states=[start, start])
    assert found.success.all() and found.q[1, -1] == pytest.approx(run.q[-1], abs=1e-5)


@each
def test_reports_and_checks_take_them(name: str) -> None:
    """Mobility is that of the mechanism where nothing holds."""
    m = pt.catalogue.load(name)
    assert "degree" in str(m.report()) and not m.check()
    driven = len(m.drives)
    two = ("ratchet-wrench", "bicycle-hub", "stick-slip", "valve-float", "geneva-wheel")
    wanted = {**dict.fromkeys(two, 2), "trebuchet": 3}.get(name, 1)
    assert m.compile().mobility == wanted - driven


def example(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    found = importlib.util.spec_from_file_location("holding_example", ROOT / "examples" / "holding.py")
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
    monkeypatch.setitem(sys.modules, "holding_example", module)
    found.loader.exec_module(module)
    return module


def test_the_example_meets_its_known_answers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """And the picture of docs/holding.md is the one that it draws."""
    pytest.importorskip("matplotlib")
    assert example(monkeypatch).main(tmp_path) == 0
    lines = capsys.readouterr().out.splitlines()[1:-1]
    page = (ROOT / "docs" / "holding.md").read_text("utf-8")
    assert f"compares {len(lines)} times, rates" in page and "better than 1e-9" in page
    assert max(float(line.split()[-1]) for line in lines) < 1e-9
    drawn, shown = ((folder / "holding.svg").read_text("utf-8") for folder in (tmp_path, ROOT / "docs" / "pictures"))
    assert 0.8 < len(drawn) / len(shown) < 1.25 and len(shown) < 150_000
    for danger in ("<script", "http://localhost", "foreignObject", "onload"):
        assert danger not in shown
