"""The page on which mechanisms are drawn as a file: the core is in it, so its numbers are the core's."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import PROGRAM, Chromium
from sketches import DRAWN, FOUR, LOADED, QUICK, SLIDER, User, bar, drawing, place

import partita as pt
from partita.cli import main
from partita.io.toml_writer import document
from partita.sketch import drawing_of, mechanism_of, script_of
from partita.sketch.answer import answer
from partita.sketch.static import MODULE

sys.path.insert(0, str(Path(__file__).parents[2] / "tools"))
from website.tilt import tilt_page

TIGHT = {"relative": 1e-13, "absolute": 1e-14}
AGREES = 1e-12
"""Largest difference to `simulate`, lengths and cosines as they are, loads over the largest force."""

pytestmark = [
    pytest.mark.skipif(PROGRAM is None, reason="there is no Chromium to draw in"),
    pytest.mark.skipif(
        not MODULE.is_file(), reason="the core is built for pages by `make web`, for `make docs` and `make trust`"
    ),
]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "draw.html"
    assert main(["draw", "--static", str(path)]) == 0
    return path


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    with Chromium() as one:
        yield one


def four_bar(user: User) -> None:
    user.four_bar()
    user.drag("spring", (0.75, 0.75), (0.75, 1.5))
    user.put("stiffness", 60.0)


def slider_crank(user: User) -> None:
    user.drag("bar", (0, 0), (0.2, 0.5))
    user.drag("bar", (0.2, 0.5), (1.5, 0))
    user.drag("ground", (0, 0))
    user.drag("slide", (1.5, 0), (1.8, 0.02))
    user.drag("motor", (0, 0))


def five_bar(user: User) -> None:
    user.drag("bar", (0, 0), (-0.2, 0.6))
    user.drag("bar", (-0.2, 0.6), (0.6, 1.0))
    user.drag("bar", (0.6, 1.0), (1.4, 0.6))
    user.drag("bar", (1.4, 0.6), (1.2, 0))
    user.drag("ground", (0, 0))
    user.drag("ground", (1.2, 0))


def compared(browser: Chromium, data: dict[str, Any], seconds: float) -> None:
    """The run on the page against `simulate`: poses, reactions of every joint, their flags."""
    browser.value(f"(drawing.link.accuracy = {json.dumps(TIGHT)}, drawing.link.seconds = {seconds}, drawing.run())")
    found = browser.value("inside.running().found")
    m = mechanism_of(drawing_of(data))
    assert found["success"] and found["t"][-1] == seconds
    run = m.simulate(seconds, t_eval=np.array(found["t"]), rtol=TIGHT["relative"], atol=TIGHT["absolute"])
    count = len(run.t)
    bodies = np.reshape(found["bodies"], (count, -1, 12))
    force, moment = (np.reshape(found[key], (count, -1, 3)) for key in ("force", "moment"))
    flags = np.reshape(found["determined"], (count, -1, 6)).astype(bool)
    largest = max(np.abs(run.joint(name).force).max() for name in run.names.joints)
    for i, name in enumerate(run.names.bodies):
        assert np.abs(bodies[:, i, :3] - run.body(name).position).max() < AGREES
        assert np.abs(bodies[:, i, 3:] - run.body(name).rotation.reshape(count, 9)).max() < AGREES
    for j, name in enumerate(run.names.joints):
        known, joint = flags[:, j], run.joint(name)
        assert np.abs(np.where(known[:, :3], force[:, j] - joint.force, 0.0)).max() < AGREES * largest
        assert np.abs(np.where(known[:, 3:], moment[:, j] - joint.moment, 0.0)).max() < AGREES * largest
        assert np.array_equal(known, joint.determined_at)
    browser.value("drawing.back()")


@pytest.mark.parametrize(
    ("draw", "mobility", "seconds"),
    [(four_bar, 1, 2.0), (slider_crank, 0, 2.0), (five_bar, 2, 1.0)],  # a five-bar that falls is chaotic: 1e-16 grows
    ids=["four-bar", "slider-crank", "five-bar"],
)
def test_drawn_by_pointer_run_shared_and_opened_again(
    browser: Chromium, page: Path, draw: Any, mobility: int, seconds: float
) -> None:
    with User(browser, static=page) as user:
        draw(user)
        user.settled()
        found, data = user.answer(), user.data()
        known = answer(drawing_of(data))
        assert found["mobility"] == mobility and found["message"] == known["message"]
        assert found["redundancy"] == known["redundancy"] and "3 of the " in found["redundancy"]
        assert browser.value("document.getElementById('redundancy').textContent") == found["redundancy"]
        compared(browser, data, seconds)
        address = browser.value("drawing.link.share()")
        assert address.startswith("file://") and browser.value("location.href") == address
        browser.load("about:blank")
        browser.load(address)
        browser.value(LOADED)
        again = user.data()  # numbers by their shortest digits: the bits
        assert json.dumps(again, sort_keys=True) == json.dumps(data, sort_keys=True)
        assert mechanism_of(drawing_of(again)).to_spec() == mechanism_of(drawing_of(data)).to_spec()
        assert browser.reported == []


def test_descriptions_files_and_scripts_are_those_of_python(browser: Chromium, page: Path) -> None:
    """To the character; a number of the description to round-off."""
    long = json.loads(json.dumps(FOUR))
    long["bars"][1]["length"] = 1.7
    open_chain = {
        "nodes": [place("A", 0, 1e-7), place("B", 1, 0.3), place("C", 1, 1), place("D", 3e-5, -2)],
        "bars": [bar("one", "A", "B"), bar("two", "B", "C", mass=1e5)],
        "springs": [{"name": "s", "a": "A", "b": "C", "stiffness": 3.0, "damping": 0.0, "length": None}],
    }
    with User(browser, static=page):
        for tables in (*DRAWN.values(), long, open_chain):
            data = drawing(**tables)
            m = mechanism_of(drawing_of(data))
            found = browser.value(
                f"(() => {{ const m = new inside.Meaning({json.dumps(data)});"
                " return [m.description(), m.script(), m.toml()]; })()"
            )
            assert found[1] == script_of(drawing_of(data))
            assert written(found[2]) == written(document(m))
            own = json.loads(json.dumps(m.to_spec()))
            assert parts(found[0]) == parts(own)
            ours, theirs = leaves(found[0]), leaves(own)
            assert np.allclose(ours, theirs, rtol=1e-14, atol=1e-15)


def parts(x: Any) -> Any:
    """All of it but its numbers."""
    if isinstance(x, dict):
        return {key: parts(value) for key, value in x.items()}
    return [parts(value) for value in x] if isinstance(x, list) else None if isinstance(x, int | float) else x


def leaves(x: Any) -> list[float]:
    """Its numbers, in the order of its keys."""
    if isinstance(x, dict):
        return [number for key in sorted(x) for number in leaves(x[key])]
    if isinstance(x, list):
        return [number for value in x for number in leaves(value)]
    return [float(x)] if isinstance(x, int | float) else []


def written(text: str) -> str:
    """A model file without points in the axes of a body: these are compared as numbers of the description."""
    return "\n".join(line for line in text.splitlines() if not line.startswith(("point1 = ", "point2 = ")))


def test_what_cannot_be_is_said_as_by_python(browser: Chromium, page: Path) -> None:
    far = json.loads(json.dumps(FOUR))
    far["bars"][1]["length"] = 9.0
    wrong = {**FOUR, "bars": [bar("one", "A", "A")]}
    with User(browser, static=page):
        for tables in (far, wrong, {**QUICK, "motors": [{"name": "m", "node": "T", "bar": None, "rate": 1.0}]}):
            data = drawing(**tables)
            known = answer(drawing_of(data))
            found = browser.value(f"inside.answerTo({json.dumps(data)})")
            assert (found["kind"], found["message"]) == (known["kind"], known["message"])
            assert [gap["label"] for gap in found["gaps"]] == [gap["label"] for gap in known["gaps"]]
        long = json.loads(json.dumps(FOUR))
        long["bars"][1]["length"] = 1.7
        closed = browser.value(f"inside.answerTo({json.dumps(drawing(**long))}).closed")
        known = answer(drawing_of(drawing(**long)))["closed"]
        assert {key: pytest.approx(at, abs=1e-12) for key, at in known.items()} == closed


def test_a_tilted_hinge_locks_and_a_remedy_lets_go(browser: Chromium, tmp_path: Path) -> None:
    """Degrees of freedom by theory: a planar four-bar and Bennett's linkage move as drawn, not with a hinge tilted;
    with a ball and a cylindrical joint Kutzbach's count 7 - 6 = 1 holds at any tilt."""
    path = tmp_path / "tilt.html"
    path.write_text(tilt_page(), encoding="utf-8")
    browser.open(path)
    browser.value(LOADED.replace("drawing", "tilting"))
    for name in browser.value("[...document.getElementById('linkage').options].map((x) => x.value)"):
        browser.value(
            f"(() => {{ const x = document.getElementById('linkage'); x.value = {json.dumps(name)};"
            " x.dispatchEvent(new Event('change')); })()"
        )
        for slider, remedy, moves in ((0, False, "yes"), (4, False, "yes"), (30, False, "no"), (30, True, "yes")):
            found = browser.value(
                f"(() => {{ document.getElementById('tilt').value = {slider};"
                f" document.getElementById('remedy').checked = {json.dumps(remedy)}; tilting.change();"
                " return tilting.state(); })()"
            )
            assert (found["moves"], found["running"]) == (moves, moves == "yes"), (name, slider, found)
            locked = "structure only because" if moves == "no" else "Nothing is redundant"
            assert {0: "redundant", 4: "drawing tolerance", 30: locked}[slider] in found["why"]
    assert browser.reported == []


@pytest.mark.parametrize("address", ["#%%%", "#e30", "#" + "A" * 300_000])
def test_addresses_without_a_drawing_are_refused(browser: Chromium, page: Path, address: str) -> None:
    with User(browser, static=page):
        data = browser.value("drawing.sketch.data")
        browser.value(f"(location.hash = {json.dumps(address)}, new Promise((r) => setTimeout(r, 50)))")
        assert "This link cannot be opened" in browser.value("document.getElementById('said').textContent")
        assert browser.value("drawing.sketch.data") == data


def test_a_link_is_checked_element_by_element(browser: Chromium, page: Path) -> None:
    """What the served page refuses is refused here: numbers, names, references, keys."""
    data = drawing(**SLIDER)
    changes = [
        ("bars", "mass", 0), ("bars", "mass", "1"), ("bars", "a", 99), ("nodes", "name", "<b>"), ("nodes", "x", 1e7),
        ("nodes", "id", 1.5), ("slides", "along", 99), ("springs", "damping", -1), ("motors", "rate", None),
        ("nodes", "z", 1),
    ]  # fmt: skip
    with User(browser, static=page):
        assert browser.value(f"inside.drawingOf('#' + inside.addressOf({json.dumps(data)}))") == data
        for table, key, value in changes:
            changed = json.loads(json.dumps(data))
            changed[table][0][key] = value
            with pytest.raises(pt.errors.ArgumentError):
                drawing_of(changed)
            text = json.dumps(changed)
            refused = browser.value(
                f"(() => {{ try {{ inside.drawingOf('#' + inside.addressOf({text})); return ''; }}"
                " catch (error) { return error.message; } })()"
            )
            assert refused, (table, key, value)
