"""The page on which a mechanism runs: what it computes is what the core computes, and what it cannot it refuses.

The scripts of the page run in Node where there is one, the page itself in Chromium.
"""

import base64
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita import catalogue
from partita.mechanism import solve
from partita.mechanism.models import layout_of
from partita.mechanism.playground import changed, recorded
from partita.playground.page import text
from partita.state import State

NODE, CHROMIUM = shutil.which("node"), shutil.which("chromium")
TIGHT = {"rtol": 1e-14, "atol": 1e-15}
"""Both programs at this tolerance: the page needs it with its order of 5 where freedoms amplify errors over 10 s."""
needs_node = pytest.mark.skipif(NODE is None, reason="there is no Node to run the scripts of the page")


def page_runs(mechanism: pt.Mechanism, initial: State | None, script: str, folder: Path) -> Any:
    """What `script` returns, run on the motion of the page at tight tolerances."""
    made = recorded(mechanism, initial)
    scripts = "\n".join(text(name) for name in ("module.js", "linear.js", "motion.js"))
    body = f"""{scripts}
        const about = {json.dumps(made.about)};
        (async () => {{
            const m = makeMotion(await loadProgram("{base64.b64encode(made.module).decode()}"), about);
            m.accuracy.relative = {TIGHT["rtol"]}; m.accuracy.absolute = {TIGHT["atol"]};
            const state = () => ({{ t: m.t, q: [...m.q], v: [...m.v], rho: [...m.rho], exchanges: m.exchanges }});
            const bodies = () => [...m.look().bodies];
            console.log(JSON.stringify((() => {{ m.reset(about.start); {script} }})()));
        }})();
    """
    file = folder / "run.js"
    file.write_text(body, encoding="utf-8")
    assert NODE is not None
    ran = subprocess.run([NODE, str(file)], capture_output=True, text=True, timeout=120, check=False)
    assert ran.returncode == 0, ran.stderr[-2000:]
    return json.loads(ran.stdout)


def native(
    mechanism: pt.Mechanism, found: Any, duration: float, parameters: dict[str, list[float]]
) -> tuple[np.ndarray, pt.Result]:
    """Poses (nb, 12) at the end of the core's own run of the changed model, from the state in which the page began."""
    wide = changed(mechanism)
    layout = layout_of(wide, "relative")[1]
    start = State(found["from"]["t"], found["from"]["q"], found["from"]["v"], layout=layout)
    run = solve.simulate(wide, duration, initial=start, parameters=parameters, **TIGHT)
    assert run.success
    poses = [np.r_[run.body(b).position[-1], np.ravel(run.body(b).rotation[-1])] for b in run.names.bodies]
    return np.array(poses), run


def agree(mechanism: pt.Mechanism, found: Any, duration: float, parameters: dict[str, list[float]]) -> None:
    poses, run = native(mechanism, found, duration, parameters)
    size = max(1.0, float(np.abs(poses).max()))
    assert np.abs(poses - np.reshape(found["bodies"], (-1, 12))).max() < 1e-9 * size
    assert np.abs(run.measure[-1] - found["to"]["rho"]).max() < 1e-7


CHANGES = {
    # the part that a length changes by, how long it runs: Andrews' mechanism turns ever faster. (Five-bars are
    # chaotic: with a left crank longer by a tenth even round-off grows to 1e-9 in 10 s.)
    "four-bar": (1.1, 10.0),
    "slider-crank": (0.9, 10.0),
    "engine-inline-two": (1.1, 1.0),
    "andrews-squeezer": (1.05, 0.05),
    "double-wishbone": (1.05, 10.0),
    "five-bar": (0.95, 10.0),
}


@needs_node
@pytest.mark.parametrize("name", CHANGES)
def test_a_changed_length_moves_as_in_the_core(name: str, tmp_path: Path) -> None:
    entry = catalogue.entry(name)
    mechanism = entry.mechanism()
    initial = entry.initial(mechanism)
    part, duration = CHANGES[name]
    # the first length of a body that is not the ground
    length = next(x for x in recorded(mechanism, initial).about["lengths"] if x["body"] != "ground")
    script = f"""
        const one = {json.dumps(length)}, before = bodies(), parameters = m.lengthened(one, {part} * one.drawn);
        const words = m.change(parameters);
        if (words) return {{ words }};
        const from = state();
        m.advance(from.t + {duration});
        const moved = bodies().some((x, i) => Math.abs(x - before[i]) > 1e-6);
        return {{ words, to: state(), from, moved, bodies: bodies(), parameters }};
    """
    found = page_runs(mechanism, initial, script, tmp_path)
    assert found["words"] == ""
    assert found["moved"]
    agree(mechanism, found, duration, found["parameters"])


@needs_node
def test_bricard_keeps_its_redundant_condition(tmp_path: Path) -> None:
    """It moves although six of its conditions follow from five; with one length changed it is a structure."""
    entry = catalogue.entry("bricard")
    mechanism = entry.mechanism()
    script = """
        const from = state();
        m.change({ "rod 1.mass": [3] });
        m.advance(from.t + 10);
        const to = state(), end = bodies();
        const one = about.lengths.find((x) => x.body === "rod 3");
        const words = m.change(m.lengthened(one, 1.05 * one.drawn));
        return { from, to, bodies: end, words, dropped: about.dropped, length: m.lengthOf(one), drawn: one.drawn };
    """
    found = page_runs(mechanism, entry.initial(mechanism), script, tmp_path)
    assert len(found["dropped"]) == 1
    agree(mechanism, found, 10.0, {"rod 1.mass": [3.0]})
    assert "stays open by" in found["words"]
    assert abs(found["length"] - found["drawn"]) < 1e-15


def four_bar() -> pt.Mechanism:
    return catalogue.load("four-bar")


@needs_node
def test_a_length_that_cannot_close_is_told_by_how_much(tmp_path: Path) -> None:
    """A crank of 2.9 m beside 1 m of ground, 0.9 m of coupler and 0.7 m of rocker: 0.3 m are missing at the least."""
    script = """
        const before = state(), b = m.get("B.point");
        const words = m.change(m.lengthened(about.lengths.find((x) => x.body === "crank"), 2.9));
        const after = state();
        m.advance(0.1);
        return { words, same: before.q.every((x, i) => Math.abs(x - after.q[i]) < 1e-14), point: m.get("B.point"), b };
    """
    found = page_runs(four_bar(), None, script, tmp_path)
    told = re.search(r'joint "C" stays open by ([\d.]+) m', found["words"])
    assert told, found["words"]
    assert abs(float(told[1]) - 0.3) < 1e-3  # three digits are told
    assert found["same"]
    assert found["point"] == found["b"]


@needs_node
def test_pulling_is_a_spring_of_the_core(tmp_path: Path) -> None:
    """The spring from the pointer is an element of the model, and pulls there as here."""
    pull = {
        "pull coupler.point1": [0.5, 1.5, 0.0],
        "pull coupler.point2": [0.4, 0.0, 0.0],
        "pull coupler.stiffness": [30.0],
        "pull coupler.damping": [2.0],
    }
    script = f"""
        const from = state();
        m.advance(1);
        const free = bodies();
        m.reset(about.start);
        m.load({json.dumps(pull)});
        m.advance(5);
        return {{ from, to: state(), bodies: bodies(), free }};
    """
    found = page_runs(four_bar(), None, script, tmp_path)
    agree(four_bar(), found, 5.0, pull)


@needs_node
@pytest.mark.parametrize("kind", ["velocity", "velocity table", "position table"])
def test_drives_run_as_in_the_core(kind: str, tmp_path: Path) -> None:
    times, values = np.linspace(0, 4, 9), 0.5 * np.sin(np.linspace(0, 4, 9))
    mechanism = four_bar()
    motion = {
        "velocity": {"velocity": 2.0},
        "velocity table": {"velocity": (times, 1.0 + values)},
        "position table": {"position": (times, values)},
    }[kind]
    mechanism.add_drive("A", **motion)
    found = page_runs(
        mechanism, None, "const from = state(); m.advance(3); return { from, to: state(), bodies: bodies() };", tmp_path
    )
    agree(mechanism, found, 3.0, {})


@needs_node
def test_a_drive_twice_as_fast_is_where_it_would_be_later(tmp_path: Path) -> None:
    mechanism = four_bar()
    mechanism.add_drive("A", velocity=1.0)
    once = page_runs(mechanism, None, "m.advance(2); return bodies();", tmp_path)
    twice = page_runs(mechanism, None, "m.prescribe(0, 2); m.advance(1); return bodies();", tmp_path)
    np.testing.assert_allclose(once, twice, atol=1e-10)
    table = four_bar()
    table.add_drive("A", position=([0, 1, 2, 3], [0, 0.3, 0.9, 1.0]))
    slow = page_runs(table, None, "m.advance(2.5); return bodies();", tmp_path)
    fast = page_runs(table, None, "m.pace(0, 2.5); m.advance(1); return bodies();", tmp_path)
    np.testing.assert_allclose(slow, fast, atol=1e-10)


@needs_node
def test_a_table_that_ends_is_told(tmp_path: Path) -> None:
    mechanism = four_bar()
    mechanism.add_drive("A", position=([0, 1], [0, 0.3]))
    script = "try { m.advance(2); } catch (e) { return e.message; } return '';"
    assert "drive of A ends at 1 s" in page_runs(mechanism, None, script, tmp_path)


@pytest.mark.parametrize("what", ["force", "drive"])
def test_what_calls_python_is_refused_by_name(what: str, tmp_path: Path) -> None:
    mechanism = four_bar()
    if what == "force":
        mechanism.add_torque("A", lambda t, state: 1.0, name="motor")
    else:
        mechanism.add_drive("A", position=lambda t: 0.1 * np.sin(t), name="motor")
    with pytest.raises(pt.errors.DescriptionError, match="motor") as refused:
        mechanism.to_playground(tmp_path / "x.html")
    assert refused.value.name
    assert not (tmp_path / "x.html").exists()


def test_bad_arguments_are_refused(tmp_path: Path) -> None:
    with pytest.raises(pt.errors.ArgumentError, match="speed"):
        four_bar().to_playground(tmp_path / "x.html", speed=-1.0)
    with pytest.raises(pt.errors.ArgumentError, match="title"):
        four_bar().to_playground(tmp_path / "x.html", title=3)  # type: ignore[arg-type]
    with pytest.raises(pt.errors.MissingFileError):
        four_bar().to_playground(tmp_path / "none" / "x.html")


@needs_node
@pytest.mark.parametrize("scale", [1e-6, 1e3])
def test_micrometres_and_kilometres(scale: float, tmp_path: Path) -> None:
    """The same slider-crank however large: with gravity in the same proportion the motion is the same, scaled."""
    mechanism = pt.Mechanism("slider-crank", gravity=(0.0, -9.81 * scale, 0.0))
    crank = mechanism.add_rod("crank", start=(0, 0, 0), end=(0.3 * scale, 0.1 * scale, 0), mass=1.0)
    rod = mechanism.add_rod("rod", start=(0.3 * scale, 0.1 * scale, 0), end=(1.2 * scale, 0, 0), mass=2.0)
    inertia = (0.1 * scale**2,) * 3
    slider = mechanism.add_body("slider", mass=1.0, inertia=inertia, position=(1.2 * scale, 0, 0))
    mechanism.add_revolute("A", mechanism.ground, crank, point=(0, 0, 0))
    mechanism.add_revolute("B", crank, rod, point=(0.3 * scale, 0.1 * scale, 0))
    mechanism.add_revolute("C", rod, slider, point=(1.2 * scale, 0, 0))
    mechanism.add_prismatic("D", mechanism.ground, slider, point=(1.2 * scale, 0, 0), axis=(1, 0, 0))
    script = """
        const from = state(), parameters = m.lengthened(about.lengths.find((x) => x.body === "crank"), %r);
        const words = m.change(parameters), closed = state();
        m.advance(2);
        return { words, from: closed, to: state(), bodies: bodies(), parameters };
    """ % (0.4 * scale)
    found = page_runs(mechanism, None, script, tmp_path)
    assert found["words"] == ""
    poses, _ = native(mechanism, found, 2.0, found["parameters"])
    own = np.reshape(found["bodies"], (-1, 12))
    assert np.abs(poses - own)[:, :3].max() < 1e-9 * scale
    assert np.abs(poses - own)[:, 3:].max() < 1e-9


def test_names_carry_no_markup(tmp_path: Path) -> None:
    mechanism = pt.Mechanism("</script><b>{{MODULE}}")
    rod = mechanism.add_rod("<i>rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    mechanism.add_revolute("</script>", mechanism.ground, rod, point=(0, 0, 0))
    page = mechanism.to_playground(tmp_path / "x.html").read_text("utf-8")
    assert page.count("</script>") == 3
    assert "<i>rod" not in page
    assert "<b>" not in page


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium to open the page in")
def test_the_page_runs_in_a_browser(tmp_path: Path) -> None:
    """It opens without a complaint, runs, takes a new length and a pull."""
    page = four_bar().to_playground(tmp_path / "x.html")
    inside = """
        setTimeout(() => {
          const field = document.querySelectorAll("#lengths input[type=number]")[1], p = window.playground;
          field.value = "0.35";
          field.dispatchEvent(new Event("change"));
          const fault = document.getElementById("fault").hidden ? "" : document.getElementById("fault").textContent;
          const before = p.motion.look().energy[0];
          p.grasp({ body: 1, point: [0.4, 0, 0], to: [0.5, 2, 0] });
          const t = p.motion.t;
          p.motion.advance(t + 0.05);
          const moves = before !== p.motion.look().energy[0];
          document.title = JSON.stringify({ fault, t, moves, length: field.value });
        }, 300);
    """
    opened = page.read_text("utf-8").replace("</body>", f"<script>{inside}</script></body>")
    page.write_text(opened, encoding="utf-8")
    assert CHROMIUM is not None
    command = [CHROMIUM, "--headless=new", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr"]
    command += [f"--user-data-dir={tmp_path / 'user'}", "--virtual-time-budget=2000", "--dump-dom", page.as_uri()]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert ":CONSOLE" not in ran.stderr, ran.stderr
    said = re.search(r"<title>(\{.*?\})</title>", ran.stdout)
    assert said, ran.stdout[:2000]
    told = json.loads(said[1])
    assert told["fault"] == ""
    assert told["t"] > 0.0
    assert told["moves"]
    assert told["length"] == "0.35"
