"""The page on which a mechanism runs: what it computes is what the core computes, and what it cannot it refuses.

The scripts of the page run in Node where there is one, the page itself in Chromium.
"""

import base64
import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import DESKTOP, PHONE, PROGRAM, Chromium
from pages import CONTRAST

import partita as pt
from partita import catalogue
from partita.mechanism import solve
from partita.mechanism.models import layout_of
from partita.mechanism.playground import changed, recorded
from partita.playground.page import COMPUTES, text
from partita.state import State
from partita.webpage import part_of

NODE = shutil.which("node")
TIGHT = {"rtol": 1e-14, "atol": 1e-15}
"""Both programs at this tolerance: the page needs it where degrees of freedom amplify errors over 10 s."""
needs_node = pytest.mark.skipif(NODE is None, reason="there is no Node to run the scripts of the page")


OWN = {"rtol": 1e-8, "atol": 1e-10}
"""The page's own."""


def page_runs(
    mechanism: pt.Mechanism, initial: State | None, script: str, folder: Path, accuracy: dict[str, float] = TIGHT
) -> Any:
    """What `script` returns, run on the motion of the page."""
    made = recorded(mechanism, initial)
    scripts = "\n".join((part_of("partita", "tolerance.js"), *map(text, COMPUTES)))
    body = f"""{scripts}
        const about = {json.dumps(made.about)};
        (async () => {{
            const m = makeMotion(await loadProgram("{base64.b64encode(made.module).decode()}"), about);
            m.accuracy.relative = {accuracy["rtol"]}; m.accuracy.absolute = {accuracy["atol"]};
            const state = () => ({{ t: m.t, q: [...m.q], v: [...m.v], rho: [...m.rho], switches: m.switches }});
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


@dataclass(frozen=True)
class Zoo:
    """What is changed of an entry: these lengths to this part, other numbers to these parts; what is pulled, and which
    lengths cannot close at which part. `own`: seconds that it runs with all other numbers as they are, where it cannot
    for 10 s."""

    lengths: tuple[str, ...]
    part: float
    pulled: str
    too_far: tuple[tuple[str, ...], float]
    parts: dict[str, float] = field(default_factory=dict)
    own: float | None = None


THROWS = ("crankshaft: main to big end left", "crankshaft: main to big end right")
SIX = {
    "four-bar": Zoo(("crank: length",), 1.1, "coupler", (("crank: length",), 9.0)),
    # both rods sit on one pin: a longer throw is two lengths
    "engine-v-twin": Zoo(THROWS, 1.1, "piston left", (THROWS, 9.0)),
    # its torque turns it ever faster, some thousand radians a second after 0.2 s; a ten-thousandth of all loads is the
    # same motion a hundred times as slow
    "andrews-squeezer": Zoo(
        ("OF: length",),
        1.05,
        "HE",
        (("OF: length",), 20.0),
        {"torque on O.value": 1e-4, "spring.stiffness": 1e-4},
        own=0.1,
    ),
    "double-wishbone": Zoo(("lower: length",), 1.05, "tie rod", (("lower: length",), 9.0)),
    # free, and chaotic at high speed
    "five-bar": Zoo(("left crank: length",), 0.95, "right rod", (("left crank: length",), 9.0)),
    # of its six lengths two in a row may change together: the sums of squares of every second one stay equal
    "bricard": Zoo(("rod 1: length", "rod 2: length"), 1.05, "rod 3", (("rod 3: length",), 1.05)),
}


@needs_node
@pytest.mark.parametrize("name", SIX)
def test_six_of_the_zoo(name: str, tmp_path: Path) -> None:
    """Changed lengths and pulls move it as in the core, over 10 s; one that cannot close is reported."""
    entry, zoo = catalogue.entry(name), SIX[name]
    mechanism = entry.mechanism()
    initial = entry.initial(mechanism)
    about = recorded(mechanism, initial).about
    of = {f"{x['body']}: {x['what']}": x for x in about["lengths"]}
    lengths, wrong = [of[x] for x in zoo.lengths], [of[x] for x in zoo.too_far[0]]
    others = {key: [part * x for x in about["values"][key]] for key, part in zoo.parts.items()}
    mass = sum(about["values"].get(f"{body}.mass", [0.0])[0] for body in about["bodies"])
    spring = f"pull {zoo.pulled}"
    pull = {
        f"{spring}.point1": [0.1 * about["length"]] * 2 + [0.0],
        f"{spring}.point2": [0.01 * about["length"], 0.0, 0.0],
        f"{spring}.stiffness": [20.0 * mass],
        f"{spring}.damping": [5.0 * mass],
    }
    script = f"""
        const longer = (list, part) => Object.assign({{}}, ...list.map((x) => m.lengthened(x, part * x.drawn)));
        const wrong = longer({json.dumps(wrong)}, {zoo.too_far[1]}), right = longer({json.dumps(lengths)}, {zoo.part});
        const others = {json.dumps(others)}, before = bodies(), start = state();
        const old = Object.keys(wrong).map(m.get), refused = m.change(wrong), kept =
            state().q.every((x, i) => Math.abs(x - start.q[i]) < 1e-12) &&
            Object.keys(wrong).every((name, i) => m.get(name).every((x, j) => x === old[i][j]));
        const changes = [], runs = {{}};
        const ran = (name, duration, parameters) => {{
            m.load(about.values);
            m.reset(about.start);
            changes.push(m.change(parameters));
            const from = state();
            m.advance(duration);
            runs[name] = {{ duration, from, to: state(), bodies: bodies(), parameters }};
        }};
        ran("changed", 10, {{ ...others, ...right }});
        ran("pulled", 2, {{ ...others, ...{json.dumps(pull)} }});
        if ({json.dumps(zoo.own)}) ran("own", {json.dumps(zoo.own)}, right);
        return {{ before, refused, kept, changes, runs }};
    """
    found = page_runs(mechanism, initial, script, tmp_path)
    assert re.search(r'joint ".*" stays open by [\d.e-]+ (m|rad).*\(loop of .*, .*\)', found["refused"]), found[
        "refused"
    ]
    assert found["kept"]
    assert not any(found["changes"])
    for run in found["runs"].values():
        assert np.abs(np.subtract(run["bodies"], found["before"])).max() > 1e-4
        agree(mechanism, run, run["duration"], run["parameters"])


@needs_node
def test_the_module_computes_what_the_core_computes(tmp_path: Path) -> None:
    """Phi, C, a, b, M and h of each entry of the zoo without drives, anywhere near its start at rates by chance."""
    rng = np.random.default_rng(12)
    cases, wanted = [], []
    for name in catalogue.names():
        mechanism = catalogue.entry(name).mechanism()
        try:
            made = recorded(mechanism, None)
        except pt.errors.DescriptionError:
            continue  # calls Python
        if made.about["drives"]:
            continue
        core, about = layout_of(changed(mechanism), "relative")[0].core, made.about
        q = np.array(about["start"]["q"]) + 0.1 * rng.standard_normal(about["coordinates"])
        for i, j in about["coordinates_of"]:
            if j - i == 4:
                q[i:j] /= np.linalg.norm(q[i:j])
        v = rng.standard_normal(about["velocities"])
        cases.append(
            {"module": base64.b64encode(made.module).decode(), "about": about, "q": q.tolist(), "v": v.tolist()}
        )
        c, lower = core.jacobian(0.0, q), np.tril_indices(core.nv)
        rows = np.repeat(np.arange(core.rows), np.diff(about["row_start"]))
        wanted.append(
            {
                "phi": core.constraints(0.0, q)[: about["holonomic"]],
                "c": c[rows, about["columns"]],
                "a": core.rate(0.0, q),
                "b": core.bias(0.0, q, v),
                "mass": core.mass_matrix(0.0, q)[lower][about["patterns"]["mass"]],
                "h": core.forces(0.0, q, v),
            }
        )
        assert np.count_nonzero(np.tril(core.mass_matrix(0.0, q))) <= len(about["patterns"]["mass"])
    assert len(cases) > 80
    script = f"""{text("module.js")}
        (async () => {{
            const found = [];
            for (const {{ module, about, q, v }} of {json.dumps(cases)}) {{
                const run = await loadProgram(module), w = new Float64Array(run.memory.buffer);
                w.set(q, 1);
                w.set(v, 1 + about.coordinates);
                for (const [name, [at]] of Object.entries(about.parameters)) w.set(about.values[name], at);
                run.prepare();
                run.position();
                run.velocity();
                const part = ([at, count]) => [...w.subarray(at, at + count)];
                const outputs = Object.entries(about.outputs);
                found.push(Object.fromEntries(outputs.map(([name, where]) => [name, part(where)])));
            }}
            console.log(JSON.stringify(found));
        }})();
    """
    assert NODE is not None
    ran = subprocess.run([NODE, "-"], input=script, capture_output=True, text=True, timeout=120, check=False)
    assert ran.returncode == 0, ran.stderr[-2000:]
    for found, known in zip(json.loads(ran.stdout), wanted, strict=True):
        for what, values in known.items():
            np.testing.assert_allclose(
                found[what], values, rtol=1e-12, atol=1e-12 * max(1.0, np.abs(values).max(initial=0))
            )


# seconds until the reactions are compared
REACTING = {
    "four-bar": 1.3,
    "engine-v-twin": 0.02,
    "andrews-squeezer": 0.02,
    "double-wishbone": 0.3,
    "five-bar": 0.7,
    "four-bar-spring": 0.9,
    "gear-pair": 0.4,
    "planetary-gear": 0.6,
    "rssr": 0.8,
    "scissor-lift": 0.3,
    # rigid bodies leave some of these open
    "bricard": 0.6,
    "bennett": 0.9,
    "screw-press": 0.2,  # but nothing loads them
    "sarrus": 0.3,
}


def reactions_agree(mechanism: pt.Mechanism, initial: State | None, until: float, folder: Path) -> Any:
    """Forces and moments of all joints, and which of them rigid bodies leave open, at the same state."""
    script = f"""
        const go = (until) => {{ m.reset(about.start); m.advance(until); }};
        go({until});
        const at = state(), {{ wrenches, open }} = m.reactions(), loads = [...wrenches];
        m.advance(m.t + 1e-3);
        const after = state();
        go({until});
        m.advance(m.t + 1e-3);
        return {{ at, loads, open, after, without: state(), wide: m.wide }};
    """
    found = page_runs(mechanism, initial, script, folder)
    assert all(found["after"][key] == found["without"][key] for key in "tqv")  # asking changes nothing
    wide = changed(mechanism)
    at = State(found["at"]["t"], found["at"]["q"], found["at"]["v"], layout=layout_of(wide, "relative")[1])
    run = solve.simulate(wide, 1e-6, initial=at, t_eval=[at.t], **TIGHT)
    about = recorded(mechanism, initial).about
    normal = about["normal"] if any(row["owner"].startswith("joint ") for row in about["conditions"]) else None
    wrenches = np.reshape(found["loads"], (-1, 2, 3))
    assert np.isfinite(wrenches).all()
    known = np.array([[run.joint(j["name"]).force[0], run.joint(j["name"]).moment[0]] for j in about["joints"]])
    if normal is not None:
        known[:, 0] -= np.outer(known[:, 0] @ normal, normal)
        known[:, 1] = np.outer(known[:, 1] @ normal, normal)
    sizes = [np.linalg.norm(known[:, 0], axis=-1).max(), np.linalg.norm(known[:, 1], axis=-1).max()]
    sizes = [max(size, sizes[0] * about["length"] ** i) for i, size in enumerate(sizes)]
    assert sizes[0] > 1e-3
    for i in (0, 1):
        assert np.abs(wrenches[:, i] - known[:, i]).max() < 1e-9 * sizes[i]
    # marked are the reactions of which a component that is not zero is open in the core, too
    for joint, marks, own in zip(about["joints"], found["open"], known, strict=True):
        axes = run.joint(joint["name"]).in_frame("joint")
        for i, part in enumerate((axes.determined[:3], axes.determined[3:])):
            values = (axes.force, axes.moment)[i][0]
            if normal is None and np.linalg.norm(own[i]) > 1e-6 * sizes[i]:
                assert marks[i] == bool(np.abs(values[~part]).max(initial=0.0) > 1e-9 * sizes[i])
    return found


@needs_node
@pytest.mark.parametrize("name", REACTING)
def test_reactions_are_those_of_the_core(name: str, tmp_path: Path) -> None:
    entry = catalogue.entry(name)
    mechanism = entry.mechanism()
    found = reactions_agree(mechanism, entry.initial(mechanism), REACTING[name], tmp_path)
    assert any(any(marks) for marks in found["open"]) == (name in ("bricard", "bennett", "sarrus"))


@needs_node
def test_reactions_of_many_degrees_of_freedom(tmp_path: Path) -> None:
    """Accelerations and multipliers come from one sparse system there."""
    m = pt.Mechanism("twenty five-bars")
    for i in range(20):
        points = [(3 * i, 0, 0), (3 * i - 0.2, 0.8, 0), (3 * i + 0.5, 1.6, 0), (3 * i + 1.3, 0.9, 0), (3 * i + 1, 0, 0)]
        for k in range(4):
            m.add_rod(f"{i} rod {k}", start=points[k], end=points[k + 1], mass=1.0 + 0.1 * i)
        ends = ["ground", *(f"{i} rod {k}" for k in range(4)), "ground"]
        for k in range(5):
            m.add_revolute(f"{i} pin {k}", ends[k], ends[k + 1], point=points[k])
    assert reactions_agree(m, None, 0.2, tmp_path)["wide"]


@needs_node
def test_loads_shared_in_a_plane(tmp_path: Path) -> None:
    """A third rocker of a parallelogram is redundant, and takes a share of its load that rigid bodies leave open."""
    m = pt.Mechanism("three rockers")
    m.add_rod("beam", start=(0, 1, 0), end=(3, 1, 0), mass=4.0)
    for i, x in enumerate((0.0, 1.0, 3.0)):
        m.add_rod(f"rocker {i}", start=(x - 0.5, 0, 0), end=(x, 1, 0), mass=1.0)
        m.add_revolute(f"foot {i}", "ground", f"rocker {i}", point=(x - 0.5, 0, 0))
        m.add_revolute(f"head {i}", f"rocker {i}", "beam", point=(x, 1, 0))
    found = reactions_agree(m, None, 0.3, tmp_path)
    assert all(force for force, _ in found["open"])


@needs_node
def test_redundant_conditions_take_turns(tmp_path: Path) -> None:
    """Five of Bennett's eight conditions say all as drawn; after 0.6 s those five no longer do, and others must."""
    entry = catalogue.entry("bennett")
    mechanism = entry.mechanism()
    script = "const from = state(); m.advance(10); return { from, to: state(), bodies: bodies() };"
    agree(mechanism, page_runs(mechanism, entry.initial(mechanism), script, tmp_path), 10.0, {})


@needs_node
def test_ratios_radii_and_rods_are_changed_on_the_page(tmp_path: Path) -> None:
    """A weight on the rack of a geared shaft, and a pendulum on a rod; what drawing refuses is shown on the page."""
    m = pt.Mechanism("winch", gravity=(0, -9.81, 0))
    for i in (1, 2):
        wheel = m.add_body(f"wheel {i}", mass=1.0, inertia=(1, 1, 2), position=(i, 0, 0))
        m.add_revolute(f"A{i}", m.ground, wheel, point=(i, 0, 0))
    load = m.add_body("load", mass=3.0, inertia=(1, 1, 1), position=(3, 0, 0))
    bob = m.add_body("bob", mass=1.0, inertia=(0.1, 0.1, 0.1), position=(5, -0.3, 0))
    m.add_prismatic("R", m.ground, load, axis=(0, 1, 0), point=(3, 0, 0))
    m.add_gear("A1", "A2", -2.0, name="gear")
    m.add_rack("A2", "R", 0.2, name="rack")
    m.add_distance("wire", m.ground, (4.6, 0, 0), bob, (0, 0, 0))
    script = """
        const parameters = { "gear.ratio": [-1.5], "rack.radius": [0.3], "wire.length": [0.6] };
        const words = m.change(parameters), from = state();
        m.advance(2);
        return { words, from, to: state(), bodies: bodies(), parameters, bounds: about.bounds };
    """
    found = page_runs(m, None, script, tmp_path)
    assert found["words"] == ""
    assert found["bounds"] == {"gear.ratio": "not", "rack.radius": "not", "wire.length": "above"}
    agree(m, found, 2.0, found["parameters"])


@needs_node
def test_a_driven_five_bar(tmp_path: Path) -> None:
    """With one crank driven it is not chaotic, whatever its lengths."""
    mechanism = catalogue.load("five-bar")
    mechanism.add_drive("A", velocity=2.0)
    script = """
        const parameters = m.lengthened(about.lengths.find((x) => x.body === "left crank"), 0.44);
        const words = m.change(parameters), from = state();
        m.advance(10);
        return { words, from, to: state(), bodies: bodies(), parameters };
    """
    found = page_runs(mechanism, None, script, tmp_path)
    assert found["words"] == ""
    agree(mechanism, found, 10.0, found["parameters"])


def parallelogram(drive: bool) -> pt.Mechanism:
    """Upright, its crank half of its coupler: flat after a quarter of a turn."""
    m = pt.Mechanism("parallelogram", gravity=(0, 0, 0))
    for name, start, end in (("crank", (0, 0), (0, 1)), ("coupler", (0, 1), (2, 1)), ("rocker", (2, 0), (2, 1))):
        m.add_rod(name, start=(*start, 0), end=(*end, 0), mass=1.0)
    for name, parent, child, at in (
        ("A", "ground", "crank", (0, 0)),
        ("B", "crank", "coupler", (0, 1)),
        ("C", "coupler", "rocker", (2, 1)),
        ("D", "ground", "rocker", (2, 0)),
    ):
        m.add_revolute(name, parent, child, point=(*at, 0))
    if drive:
        m.add_drive("A", velocity=-np.pi / 2)
    return m


@needs_node
@pytest.mark.parametrize("drive", [True, False])
def test_flat_positions_are_passed_on_the_branch(drive: bool, tmp_path: Path) -> None:
    """Where all links are in line the loops lose rank and the antiparallelogram begins. A step that would end there
    ends beyond; crank and rocker stay parallel through ten of them."""
    mechanism = parallelogram(drive)
    initial = None if drive else mechanism.assemble(rates={"A": -np.pi / 2})
    script = (
        "m.advance(1); const t = m.t; for (let i = 1; i < 1200; i++) m.advance(1 + i / 60); return { t, to: state() };"
    )
    found = page_runs(mechanism, initial, script, tmp_path, OWN)
    assert found["t"] > 1.001
    a, d, _ = found["to"]["q"]
    assert abs(a - d) < 1e-9
    assert abs(a + np.pi / 2 * found["to"]["t"]) < 1e-6
    np.testing.assert_allclose(found["to"]["v"][:2], -np.pi / 2, rtol=1e-6)


@needs_node
def test_a_drive_into_the_stretched_position_is_reported(tmp_path: Path) -> None:
    """Told in words, with the last good position kept."""
    mechanism = parallelogram(False)
    mechanism.add_drive("A", position=0.0)
    script = "return { words: m.prescribe(0, -Math.PI / 2), to: state(), then: m.prescribe(0, -2), last: state() };"
    found = page_runs(mechanism, None, script, tmp_path)
    assert "branches meet here" in found["words"]
    assert np.abs(found["to"]["q"]).max() < 1e-12
    assert found["then"] == ""
    assert abs(found["last"]["q"][0] + 2) < 1e-9


def chain(loops: int) -> pt.Mechanism:
    return catalogue.load("n-four-bar", loops=loops)


@needs_node
def test_the_work_of_a_step_is_in_proportion_to_the_loops(tmp_path: Path) -> None:
    """Operations of the equations and of the elimination, of a chain twice as long: at most a tenth more than twice."""
    script = (
        "m.advance(0.1); return { equations: about.operations[1] + about.operations[2], elimination: m.operations };"
    )
    short, long = (page_runs(m, m.assemble(rates={"P0": -1.0}), script, tmp_path) for m in (chain(20), chain(40)))
    for what in short:
        assert long[what] < 2.2 * short[what], what


def four_bar() -> pt.Mechanism:
    return catalogue.load("four-bar")


@needs_node
def test_a_length_that_cannot_close_is_reported_by_how_much(tmp_path: Path) -> None:
    """A crank of 2.9 m beside 1 m of ground, 0.9 m of coupler and 0.7 m of rocker: 0.3 m are missing at the least."""
    script = """
        const before = state(), b = m.get("B.point");
        const words = m.change(m.lengthened(about.lengths.find((x) => x.body === "crank"), 2.9));
        const after = state();
        m.advance(0.1);
        return { words, same: before.q.every((x, i) => Math.abs(x - after.q[i]) < 1e-14), point: m.get("B.point"), b };
    """
    found = page_runs(four_bar(), None, script, tmp_path)
    reported = re.search(r'joint "C" stays open by ([\d.]+) m', found["words"])
    assert reported, found["words"]
    assert abs(float(reported[1]) - 0.3) < 1e-3  # three digits are shown
    assert found["same"]
    assert found["point"] == found["b"]


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
def test_a_table_that_ends_is_reported(tmp_path: Path) -> None:
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


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    if PROGRAM is None:
        pytest.skip("there is no Chromium to open the page in")
    with Chromium() as opened:
        yield opened


def shown(browser: Chromium, page: Path, screen: tuple[int, int, bool] = DESKTOP, scheme: str = "light") -> None:
    """Opens a page and waits until it computes."""
    browser.open(page, screen, scheme)
    browser.value("(async () => { while (!window.playground) await new Promise((r) => setTimeout(r, 10)); })()")


def test_the_page_runs_in_a_browser(browser: Chromium, tmp_path: Path) -> None:
    """It opens without an error, runs, takes a new length and a pull, and reports what is impossible."""
    shown(browser, four_bar().to_playground(tmp_path / "x.html"))
    reported = browser.value("""
        (async () => {
          await new Promise((r) => setTimeout(r, 200));
          const field = document.querySelectorAll("#lengths input[type=number]")[1], p = window.playground;
          const box = document.getElementById("fault"), fault = () => (box.hidden ? "" : box.textContent);
          const take = (x) => { field.value = x; field.dispatchEvent(new Event("change")); return fault(); };
          const first = take("0.35"), length = field.value;
          const mass = document.querySelectorAll("#masses input[type=number]")[1];
          const heavy = ["123456789012", "0.00000123456", mass.value].map((x) => {
            mass.value = x;
            mass.dispatchEvent(new Event("change"));
            return mass.value;
          });
          take("0.35");
          const second = take("2.9"), before = p.motion.look().energy[0];
          p.grasp({ body: 1, point: [0.4, 0, 0], to: [0.5, 2, 0] });
          const t = p.motion.t;
          p.motion.advance(t + 0.05);
          const moves = before !== p.motion.look().energy[0], rho = [...p.motion.rho];
          return { first, second, t, length, heavy, moves, rho };
        })()
    """)
    assert browser.reported == []
    assert reported["first"] == ""
    assert "stays open by 0.3 m (loop of" in reported["second"]
    assert reported["t"] > 0.0
    assert reported["moves"]
    assert reported["length"] == "0.35"
    assert reported["heavy"] == ["1.2346e+11", "1.2346e-6", "0.3"]
    assert all(0.0 < x <= 1.0 for x in reported["rho"])


def test_forty_loops_at_sixty_frames_a_second(browser: Chromium, tmp_path: Path) -> None:
    """A frame of the chain costs some ten evaluations, which take a fiftieth of its time on a small machine; here half
    of all frames must be computed in theirs however busy it is."""
    m = chain(40)
    shown(browser, m.to_playground(tmp_path / "x.html", initial=m.assemble(rates={"P0": -1.0})))
    found = browser.value("""
        (() => {
          const { motion, about } = window.playground, took = [];
          document.getElementById("play").click();
          motion.reset(about.start);
          for (let i = 0; i < 60; i++) motion.advance(motion.t + 1 / 60);
          const before = motion.evaluations;
          for (let i = 0; i < 60; i++) {
            const from = performance.now();
            motion.advance(motion.t + 1 / 60);
            took.push(performance.now() - from);
          }
          took.sort((x, z) => x - z);
          const evaluations = (motion.evaluations - before) / 60;
          return { evaluations, median: took[30], loops: Object.keys(about.loops).length };
        })()
    """)
    assert browser.reported == []
    assert found["loops"] == 40
    assert found["evaluations"] < 12
    assert found["median"] < 1000 / 60


@pytest.mark.parametrize("name", SIX)
def test_pages_can_be_read(name: str, browser: Chromium, tmp_path: Path) -> None:
    """On desktop and phone nothing leaves the page, covers another part of it, or has too little contrast; names in the
    drawing lie apart."""
    entry = catalogue.entry(name)
    mechanism = entry.mechanism()
    page = mechanism.to_playground(tmp_path / "x.html", initial=entry.initial(mechanism))
    for screen, scheme in ((DESKTOP, "light"), (PHONE, "dark")):
        shown(browser, page, screen, scheme)
        browser.rest_a_frame()
        assert browser.value(RESULT_VIEW) == []
        assert browser.value(CONTRAST) == []
        assert browser.reported == []


RESULT_VIEW = """
(() => {
  const bad = [], wide = document.documentElement.clientWidth, words = window.playground.drawing.written;
  const meet = (a, b) => a.left < b.right - 0.5 && b.left < a.right - 0.5 &&
    a.top < b.bottom - 0.5 && b.top < a.bottom - 0.5;
  words.forEach((a, i) => words.slice(i + 1).forEach((b) => { if (meet(a, b)) bad.push(`${a.word} on ${b.word}`); }));
  if (words.length === 0) bad.push("no names");
  for (const e of document.querySelectorAll("body *")) {
    const box = e.getBoundingClientRect();
    if (box.width && box.right > wide + 0.5 && e.checkVisibility()) bad.push(`${e.id} is wider than the page`);
  }
  const parts = [...document.querySelectorAll("header > *, #stage, aside, footer > *")];
  const boxes = parts.filter((e) => e.checkVisibility()), rect = (e) => e.getBoundingClientRect();
  const floats = (e) => e.parentElement.tagName === "FOOTER";
  boxes.forEach((a, i) => boxes.slice(i + 1).forEach((b) => {
    if (floats(a) === floats(b) && meet(rect(a), rect(b))) bad.push(`${a.id} over ${b.id}`);
  }));
  return bad;
})()
"""
