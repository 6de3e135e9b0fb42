"""Results: what is read by name agrees with mechanics, and survives files."""

from __future__ import annotations

import csv
import json
import math
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import xarray
from scipy.io import loadmat

import partita as pt
from partita import plots, results
from partita.files import BLANK, sealed
from partita.plots.measure import settled
from partita.results.content import content_of
from partita.results.names import Names, coordinate_units
from partita.results.record import plain

EMPTY = json.dumps({"partita_result": 3, "checksum": BLANK, "account": {}, "arrays": {}})
ENDINGS = (".json", ".nc", ".zarr", ".csv", ".mat", ".parquet")
ROD, MASS, GRAVITY = 0.8, 1.5, 9.81


@pytest.fixture(scope="module")
def pendulum() -> results.Result:
    """A slender rod that starts level, 0.8 m long, on a pin at the origin."""
    m = pt.Mechanism("pendulum", gravity=(0, -GRAVITY, 0))
    rod = m.add_rod("rod", start=(0, 0, 0), end=(ROD, 0, 0), mass=MASS)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0), axis=(0, 0, 1))
    return m.simulate(2.0, t_eval=np.linspace(0, 2, 201), rtol=1e-11, atol=1e-12)


@pytest.fixture(scope="module")
def four_bar() -> results.Result:
    """The four-bar of the catalogue, a planar mechanism drawn with spatial hinges."""
    return pt.catalogue.entry("four-bar").simulate()


@pytest.fixture(scope="module")
def user_defined() -> results.Result:
    """A point on a circle of radius 1, as matrices."""
    s = pt.System(
        n=2,
        mass=np.eye(2),
        forces=lambda t, q, v: np.array([0.0, -1.0]),
        constraints=lambda t, q: np.array([(q @ q - 1.0) / 2]),
        jacobian=lambda t, q: q[None, :],
        bias=lambda t, q, v: np.array([v @ v]),
    )
    return pt.simulate(s, 1.0, [1.0, 0.0], [0.0, 0.0])


def test_force_of_the_pin_and_newton(pendulum: results.Result) -> None:
    """m a = F + m g: with a from the angle, the force of the pin follows in closed form."""
    joint = pendulum.joint("A")
    angle, speed = joint.position[:, 0], joint.velocity[:, 0]
    assert angle == pytest.approx(pendulum.q[:, 0], abs=1e-14)
    turn = -1.5 * GRAVITY * np.cos(angle) / ROD
    outward = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    across = np.column_stack([-np.sin(angle), np.cos(angle), 0 * angle])
    acceleration = ROD / 2 * (turn[:, None] * across - (speed**2)[:, None] * outward)
    expected = MASS * (acceleration + np.array([0, GRAVITY, 0]))
    # Round-off only: force and motion stand in the same state, whatever the error of integration.
    assert joint.force == pytest.approx(expected, abs=1e-11 * MASS * GRAVITY)
    assert joint.moment == pytest.approx(np.zeros_like(expected), abs=1e-11)
    assert joint.determined.all() and joint.determined.shape == (6,)


def test_axes_turn_the_wrench_and_keep_its_size(pendulum: results.Result) -> None:
    """Expressing a vector elsewhere keeps its length; there and back is the same."""
    world = pendulum.joint("A")
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    own = world.in_frame(turn)
    assert own.force == pytest.approx(world.force @ turn)
    for other in (own, world.in_frame("joint"), world.in_frame(np.repeat(turn[None], 201, axis=0))):
        assert np.linalg.norm(other.force, axis=1) == pytest.approx(np.linalg.norm(world.force, axis=1))
        assert np.array_equal(other.in_frame("world").force, world.force)
        assert other.determined.all()


def test_axes_must_be_a_rotation(pendulum: results.Result) -> None:
    joint = pendulum.joint("A")
    for bad in ("word", np.ones((3, 3)), np.diag([1.0, 1.0, -1.0]), np.eye(2), None, np.full((3, 3), np.nan)):
        with pytest.raises(pt.errors.ArgumentError):
            joint.in_frame(bad)  # type: ignore[arg-type]


def test_points_of_a_body_and_their_velocity(pendulum: results.Result) -> None:
    """The tip of the rod lies at (l cos, l sin); its velocity is omega x r."""
    rod = pendulum.body("rod")
    angle, speed = pendulum.q[:, 0], pendulum.v[:, 0]
    tip = ROD * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    assert rod.point((ROD, 0, 0)) == pytest.approx(tip, abs=1e-13)
    expected = ROD * speed[:, None] * np.column_stack([-np.sin(angle), np.cos(angle), 0 * angle])
    assert rod.point_velocity((ROD, 0, 0)) == pytest.approx(expected, abs=1e-12)
    assert pendulum.body("ground").point((1, 2, 3)) == pytest.approx(np.tile([1.0, 2.0, 3.0], (201, 1)))
    for bad in ((1, 2), "tip", (1, 2, math.inf)):
        with pytest.raises(pt.errors.ArgumentError):
            rod.point(bad)


def test_energy_balance_and_closed_form(pendulum: results.Result) -> None:
    energy = pendulum.energy
    fallen = 0.5 * MASS * GRAVITY * ROD * np.sin(pendulum.q[:, 0])
    assert energy.potential - energy.potential[0] == pytest.approx(fallen, abs=1e-12)
    assert energy.total == pytest.approx(energy.kinetic + energy.potential)
    assert energy.balance == pytest.approx(energy.total - energy.total[0] - energy.work)
    # rtol 1e-11 over two seconds; the error of energy is a few hundred tolerances at most.
    assert energy.relative_balance < 1e-8
    assert pendulum.certificate.energy_balance == energy.relative_balance


def test_redundant_hinges_are_reported(four_bar: results.Result) -> None:
    """Planar loop, spatial hinges: three rows are redundant, so some reactions are not unique. In-plane forces are."""
    for name in four_bar.names.joints:
        determined = four_bar.joint(name).determined
        assert determined[:2].all() and not determined[2:5].all(), name
    assert four_bar.certificate.notes


def test_certificate_gathers_the_run(four_bar: results.Result) -> None:
    found = four_bar.certificate
    # the worst of all accepted steps and of all outputs
    assert found.closure == max(four_bar.closure.max(), four_bar.record.steps_open[0]) <= 1e-12
    assert found.velocity_closure == max(four_bar.velocity_closure.max(), four_bar.record.steps_open[1]) <= 1e-12
    assert found.newton_euler is not None and found.newton_euler <= 1e-9
    assert found.sigma == four_bar.sigma.min()
    assert found.switches == sum(bool(p.entering) for p in four_bar.partitions)
    assert "closure error" in str(found) and "note:" in str(found)


def test_log_of_choices_agrees_with_the_outputs(four_bar: results.Result) -> None:
    """At every output the independent columns are those of the last entry before it."""
    names = four_bar.names.velocities
    assert not four_bar.partitions[0].is_switch
    for t, columns in zip(four_bar.t, four_bar.independent, strict=True):
        last = [p for p in four_bar.partitions if p.t < t or p.t == four_bar.t[0]][-1]
        assert {names[i] for i in columns} == set(last.independent)
        assert set(last.independent) | set(last.dependent) == set(names)


@pytest.mark.parametrize("ending", ENDINGS)
def test_file_and_memory_read_the_same(four_bar: results.Result, tmp_path: Path, ending: str) -> None:
    path = four_bar.save(tmp_path / f"run{ending}")
    loaded = pt.load_result(path)
    assert_same(loaded, four_bar)
    assert loaded.names == four_bar.names and loaded.partitions == four_bar.partitions
    assert str(loaded.certificate) == str(four_bar.certificate)
    assert loaded.counters == four_bar.counters and loaded.spec == four_bar.spec
    for name in four_bar.names.joints:
        one, other = four_bar.joint(name), loaded.joint(name)
        for axes in ("world", "joint"):
            a, b = one.in_frame(axes), other.in_frame(axes)  # type: ignore[arg-type]
            assert np.array_equal(a.force, b.force) and np.array_equal(a.moment, b.moment)
            assert np.array_equal(a.determined, b.determined)
        assert np.array_equal(one.drive, other.drive) and np.array_equal(one.point, other.point)
    for name in four_bar.names.bodies:
        assert np.array_equal(four_bar.body(name).point((1, 2, 3)), loaded.body(name).point((1, 2, 3)))
    again = loaded.save(tmp_path / f"again{ending}")
    assert files_of(again) == files_of(path)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([path.name, f"again{ending}"])


def files_of(path: Path) -> dict[str, bytes]:
    """What stands in a file, or in a folder."""
    found = [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.is_file())
    return {"" if p == path else str(p.relative_to(path)): p.read_bytes() for p in found}


def assert_same(one: results.Result, other: results.Result) -> None:
    """Everything that a file holds, bit for bit; a NaN is a NaN."""
    mine, theirs = content_of(one), content_of(other)
    assert mine.header() == theirs.header()
    for a, b in zip(mine.variables, theirs.variables, strict=True):
        assert a.values.dtype == b.values.dtype and a.values.shape == b.values.shape, a.name
        known = ~np.isnan(a.values)
        assert np.array_equal(known, ~np.isnan(b.values)), a.name
        assert a.values[known].tobytes() == b.values[known].tobytes(), a.name
    assert one.options == other.options and one.certificate.findings == other.certificate.findings


def odd() -> results.Result:
    """Names that every format has to wrap up, two of which a table could confuse, and a joint that closes a loop."""
    m = pt.Mechanism('a "b", [c] ü 😀')
    rod = m.add_rod('r, "x" 😀', start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A;,'é", m.ground, rod, point=(0, 0, 0))
    m.add_revolute("A [N]", rod, m.add_rod("A", start=(1, 0, 0), end=(2, 0, 0), mass=1.0), point=(1, 0, 0))
    run = m.simulate(0.1, t_eval=[0.0, 0.1])
    run.at_once.reactions["force"][0, 0] = (np.inf, -np.inf, np.nan)
    run.at_once.reactions["force"][1, 0] = (-0.0, 5e-324, 0.1 + 0.2)
    return run


def failing(t_eval: list[float]) -> results.Result:
    """A run that ends early, at 0.3 s."""
    m = pt.Mechanism("failing")
    m.add_revolute("A", m.ground, m.add_rod("r", start=(0, 0, 0), end=(1, 0, 0), mass=1.0), point=(0, 0, 0))
    m.add_torque("A", lambda t, state: math.nan if t > 0.3 else 0.0)
    return m.simulate(1.0, t_eval=t_eval)


@pytest.fixture(scope="module")
def hard(user_defined: results.Result) -> list[results.Result]:
    """Odd names and NaN, a run without bodies, one without joints, one that failed, one without
    outputs, one with settings that are several numbers."""
    free = pt.Mechanism("free")
    free.add_body("b", mass=1.0, inertia=(1, 1, 1))
    drifting = pt.catalogue.load("slider-crank").simulate(0.05, solver=pt.Solver("baumgarte", baumgarte=(5.0, 5.0)))
    runs = [odd(), user_defined, free.simulate(0.1), failing([0.0, 0.2, 1.0]), failing([0.6]), drifting]
    assert not len(runs[4].t) and not runs[3].success
    return runs


@pytest.mark.parametrize("ending", ENDINGS)
def test_what_is_hard_to_store_comes_back(hard: list[results.Result], tmp_path: Path, ending: str) -> None:
    for run in hard if ending not in (".nc", ".zarr") else (hard[0], hard[1], hard[4]):  # these two are slow to write
        back = pt.load_result(run.save(tmp_path / f"run{ending}"))
        assert_same(back, run)
        assert (back.success, back.status, back.message) == (run.success, run.status, run.message)
        assert back.title == run.title and back.options == run.options and back.spec == run.spec


@pytest.mark.parametrize("ending", [".nc", ".zarr"])
def test_names_are_coordinates_in_the_stored_file(four_bar: results.Result, tmp_path: Path, ending: str) -> None:
    """As in the dataset in memory: any reader finds a force by the name of its joint, its unit, model and settings."""
    path = four_bar.save(tmp_path / f"run{ending}")
    engine = {".nc": "h5netcdf", ".zarr": "zarr"}[ending]
    with xarray.open_dataset(path, engine=engine) as found:
        for name in four_bar.names.joints:
            assert np.array_equal(found.force.sel(joint=name), four_bar.joint(name).force)
        crank = four_bar.names.bodies[0]
        assert np.array_equal(found.body_position.sel(body=crank, axis="y"), four_bar.body(crank).position[:, 1])
        assert found.force.dims == ("t", "joint", "axis")
        assert found.force.attrs == {"units": "N", "long_name": found.force.attrs["long_name"]}
        assert found.t.units == "s" and np.array_equal(found.t, four_bar.t)
        assert list(found.q.coords["coordinate_unit"].values) == ["rad"] * len(four_bar.names.coordinates)
        assert json.loads(found.model.item()) == four_bar.spec
        assert json.loads(found.attrs["settings"]) == four_bar.options
        assert found.attrs["source"] == f"partita {pt.__version__}" and "verdict" in found.attrs["certificate"]
        own = found.load().drop_vars("checksum", errors="ignore")
        own.attrs.pop("checksum", None)
        xarray.testing.assert_identical(own, four_bar.to_xarray())


def test_table_names_every_column_once(four_bar: results.Result, tmp_path: Path) -> None:
    with four_bar.save(tmp_path / "run.csv").open(newline="") as file:
        csv.field_size_limit(10**6)
        header, *rows = list(csv.reader(file))
    assert len(set(header)) == len(header) and header[0] == "t [s]" and header[-1] == "partita"
    assert [bool(row[-1]) for row in rows] == [True] + [False] * (len(rows) - 1)
    assert len(rows) == len(four_bar.t)
    name = four_bar.names.joints[0]
    column = header.index(f"joint.{name}.force.x [N]")
    assert [float(row[column]) for row in rows] == four_bar.joint(name).force[:, 0].tolist()


def test_matlab_reads_names_and_arrays(four_bar: results.Result, tmp_path: Path) -> None:
    found = loadmat(four_bar.save(tmp_path / "run.mat"), simplify_cells=True)
    assert list(found["names"]["joint"]) == list(four_bar.names.joints)
    assert np.array_equal(found["q"], four_bar.q)
    assert np.array_equal(np.ravel(found["independent"]), four_bar.independent.ravel() + 1)


def test_pandas_xarray_parquet(four_bar: results.Result, tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    pytest.importorskip("xarray")
    frame = four_bar.to_pandas()
    stored = pandas.read_parquet(four_bar.save(tmp_path / "run.parquet"))
    assert list(stored.columns) == ["t", *frame.columns]
    name = four_bar.names.joints[0]
    force = four_bar.to_xarray().force.sel(joint=name, axis="y").values
    assert np.array_equal(force, four_bar.joint(name).force[:, 1])
    assert np.array_equal(force, frame[f"joint.{name}.force.y"].to_numpy())
    assert frame.attrs["units"][f"joint.{name}.force.y"] == "N"


MISSING = {
    "pandas": ("pandas", "pandas", ""),
    "xarray": ("xarray", "xarray", ""),
    "parquet": ("pyarrow", "parquet", ".parquet"),
    "netcdf": ("h5netcdf", "netcdf", ".nc"),
    "netcdf without HDF5": ("h5py", "netcdf", ".nc"),
    "netcdf without xarray": ("xarray", "netcdf", ".nc"),
    "zarr": ("zarr", "zarr", ".zarr"),
}


@pytest.mark.parametrize("case", MISSING)
def test_missing_package_is_named(
    pendulum: results.Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: str
) -> None:
    package, extra, ending = MISSING[case]
    path = tmp_path / f"run{ending}"
    actions: list[Callable[[], object]] = [getattr(pendulum, f"to_{extra}")] if not ending else []
    if ending:
        stored = pendulum.save(tmp_path / f"stored{ending}")
        actions = [lambda: pendulum.save(path), lambda: pt.load_result(stored)]
    monkeypatch.setitem(sys.modules, package, None)
    for action in actions:
        with pytest.raises(pt.errors.MissingDependencyError, match=rf"pip install 'partita\[{extra}\]'") as caught:
            action()
        assert caught.value.package == package
    assert not path.exists()


def test_unknown_names_suggest(four_bar: results.Result) -> None:
    name = four_bar.names.bodies[0]
    with pytest.raises(pt.errors.UnknownNameError, match="did you mean") as caught:
        four_bar.body(name + "x")
    assert caught.value.name == name + "x"
    with pytest.raises(pt.errors.UnknownNameError):
        four_bar.joint("no such joint")
    with pytest.raises(pt.errors.UnknownNameError, match="energy"):
        four_bar.plot("enrgy")


def test_system_has_no_joints_and_says_so(user_defined: results.Result, tmp_path: Path) -> None:
    for ask in (user_defined.joint, user_defined.body):
        with pytest.raises(pt.errors.ArgumentError, match="System"):
            ask("A")
    assert not user_defined.has_energy and user_defined.certificate.energy_balance is None
    loaded = results.load_result(user_defined.save(tmp_path / "run.json"))
    assert np.array_equal(loaded.q, user_defined.q) and not loaded.is_mechanism
    user_defined.plot(path=tmp_path / "run.png")


@pytest.mark.parametrize(
    "name, content, problem",
    [
        ("a.json", "{", "not JSON"),
        ("b.json", "[]", "not a stored result"),
        ("c.json", json.dumps({"partita_result": 99}), "version"),
        ("d.json", json.dumps({"partita_result": 3, "account": {}, "arrays": {}}), "checksum"),
        ("h.json", sealed(EMPTY.encode()).decode(), "complete"),
        ("e.nc", "nonsense", "NetCDF"),
        ("f.nc", "", "NetCDF"),
        ("e.zarr", "nonsense", "Zarr"),
        ("e.csv", "t [s],partita\n", "CSV"),
        ("e.mat", "nonsense", "MAT"),
        ("e.parquet", "nonsense", "Parquet"),
        ("g.txt", "", "use one of .nc"),
    ],
)
def test_bad_files_are_reported(tmp_path: Path, name: str, content: str, problem: str) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(pt.errors.FileFormatError, match=problem) as caught:
        pt.load_result(tmp_path / name)
    assert caught.value.path == str(tmp_path / name)


def test_places_that_cannot_be_written(pendulum: results.Result, tmp_path: Path) -> None:
    with pytest.raises(pt.errors.FileFormatError, match="ending"):
        pendulum.save(tmp_path / "run.xyz")
    with pytest.raises(pt.errors.MissingFileError):
        pendulum.save(tmp_path / "nowhere" / "run.nc")
    with pytest.raises(pt.errors.MissingFileError):
        results.load_result(tmp_path / "nothing.nc")
    with pytest.raises(pt.errors.FileFormatError):
        pendulum.plot(path=tmp_path / "run.doc")


def test_figures_open_no_window(four_bar: results.Result, tmp_path: Path) -> None:
    words = ("overview", "coordinates", "closure", "energy", "measure", "reactions", four_bar.names.joints[0])
    for word in words:
        path = tmp_path / f"{word}.png"
        four_bar.plot(word, path=path)
        assert path.read_bytes().startswith(b"\x89PNG")
    figure = plots.plot_joint(four_bar, four_bar.names.joints[0], axes="joint")
    assert figure.canvas.manager is None
    four_bar.plot("energy", "measure", path=tmp_path / "two.pdf")


def test_a_coordinate_that_stays_keeps_its_strip() -> None:
    chosen = np.array([[0, 1], [1, 2], [2, 1], [3, 1]])
    assert settled(chosen).tolist() == [[0, 1], [2, 1], [2, 1], [3, 1]]


def test_units_of_quaternions_and_slides() -> None:
    summary = {
        "coordinates": ["S", "B.qw", "B.qx", "B.qy", "B.qz", "U.turn1", "U.turn2"],
        "velocities": ["S", "B.wx", "B.wy", "B.wz", "U.turn1", "U.turn2"],
        "joints": [
            {"name": "S", "q": [0, 1], "v": [0, 1], "state_q": [0, 1], "state_v": [0, 1], "axes": ["slide"]},
            {"name": "B", "q": [1, 4], "v": [1, 3], "state_q": [1, 4], "state_v": [1, 3], "axes": ["rx", "ry", "rz"]},
            {"name": "U", "q": [5, 2], "v": [4, 2], "state_q": [5, 2], "state_v": [4, 2], "axes": ["turn1", "turn2"]},
        ],
    }
    q, v = coordinate_units(summary, Names.from_summary(summary, 7, 6, 0))
    assert q == ["m", "1", "1", "1", "1", "rad", "rad"] and v == ["m/s", *["rad/s"] * 5]


def test_what_is_not_finite_becomes_null() -> None:
    assert plain({"a": np.array([1.0, np.nan]), "b": np.int64(3), "c": (float("inf"), "x")}) == {
        "a": [1.0, None],
        "b": 3,
        "c": [None, "x"],
    }


@pytest.mark.parametrize("turn", [0.3, 0.9, -0.9])
def test_turns_of_a_cut_joint_are_counted_over_most_of_a_turn(turn: float) -> None:
    """A rotor that nothing slows turns uniformly: its angle between far outputs is foretold by its speed."""
    m = pt.Mechanism("rotors", gravity=(0, 0, 0))
    for name, axis in (("a", (0, 0, 1)), ("b", (1, 0, 0))):  # two axes: no plane, in which angles are never wrapped
        m.add_body(name, mass=1.0, inertia=(0.1, 0.1, 0.1))
        m.add_revolute(f"hinge {name}", m.ground, name, point=(0, 0, 0), axis=axis)
    times = np.arange(9.0)
    start = m.convert(m.assemble(rates={"hinge a": turn * 2.0 * np.pi}), "absolute")
    run = m.simulate(8.0, t_eval=times, initial=start, coordinates="absolute")
    hinge = run.joint("hinge a")
    # eight turns at the tolerance of the run, 1e-8
    assert hinge.position[:, 0] == pytest.approx(turn * 2.0 * np.pi * times, abs=1e-6)
    assert hinge.velocity[:, 0] == pytest.approx(np.full(9, turn * 2.0 * np.pi), rel=1e-7)


def test_every_part_travels_and_is_exported() -> None:
    """Pickled and read again it has the same content, and its class has a public name."""
    m = pt.Mechanism("hook", gravity=(0, -GRAVITY, 0))
    load_ = m.add_body("load", mass=2.0, inertia=(1, 1, 1), position=(0, -1, 0))
    m.add_distance("rope", m.ground, (0, 0, 0), load_, (0, 0, 0))
    m.add_free("any", m.ground, load_)
    rod = m.add_rod("rod", start=(1, 0, 0), end=(2, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(1, 0, 0))
    m.add_drive("A", position=lambda t: t, velocity=lambda t: 1.0, acceleration=lambda t: 0.0, name="motor")
    run = m.simulate(0.1, t_eval=[0.0, 0.1])
    parts = [
        run, run.joint("A"), run.body("rod"), run.coupling("rope"), run.drive("motor"), run.energy, run.certificate,
        run.names, run.partitions[0], run.self_stresses(), results.Finding(False, 0.0, "suspect"),
    ]  # fmt: skip
    for part in parts:
        other = pickle.loads(pickle.dumps(part))
        assert type(part).__name__ in results.__all__ and type(other) is type(part) and repr(other) == repr(part)
    assert pt.Result is results.Result and pt.load_result is results.load_result
    assert {type(part).__name__ for part in parts} == set(results.__all__) - {"load_result"}


def test_a_notebook_shows_a_small_table_with_every_word_escaped() -> None:
    run = odd()
    shown = run._repr_html_()
    page = ElementTree.fromstring(shown)  # well-formed, so that no name of a user's opens a tag
    reported = {row[0].text: row[1].text for row in page.iter("tr")}
    assert reported["joints"] == "2: A;,'é, A [N]" and reported["ended"] == run.status
    m = pt.Mechanism("<script>alert(1)</script> & more")
    for i in range(40):
        m.add_body(f"<b>{i}" + 60 * "x", mass=1.0, inertia=(1, 1, 1))
    many = m.simulate(0.1, t_eval=[0.0, 0.1])
    shown = many._repr_html_()
    assert "<script" not in shown and "<b>0" not in shown and len(shown) < 4000
    assert "40: <b>0" in "".join(ElementTree.fromstring(shown).itertext()) and "and 32 more" in shown
    assert "certificate" not in shown  # it would cost all reactions
    verdict = many.certificate.verdict
    assert verdict in many._repr_html_() and verdict in ElementTree.fromstring(many.certificate._repr_html_()).text
    assert "NaN" in failing([0.6])._repr_html_() or "evaluation" in failing([0.6])._repr_html_()


def test_the_total_energy_of_a_table_is_the_sum() -> None:
    pytest.importorskip("pandas")
    run = pt.catalogue.load("four-bar").simulate(0.5, t_eval=[0.0, 0.25, 0.5])
    table = run.to_pandas()
    np.testing.assert_array_equal(table["energy.total"], run.energy.kinetic + run.energy.potential)
    assert table["energy.kinetic"].iloc[-1] > 0.0


def test_a_long_run_lists_the_first_switches_and_those_in_use_at_outputs() -> None:
    """The memory of a run is that of its outputs: a pendulum that turns in absolute coordinates switches eight times
    a second."""
    m = pt.Mechanism("pendulum", gravity=(0, -9.81, 0))
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    start = m.assemble(rates={"A": 12.0}, coordinates="absolute")
    t = np.linspace(0.0, 240.0, 9)
    few, many = (m.simulate(240.0, initial=start, t_eval=times, coordinates="absolute")
                 for times in (t, np.linspace(0.0, 240.0, 1601)))  # fmt: skip
    switches = few.counters["switches"]
    assert switches == many.counters["switches"] > 1500
    assert len(few.partitions) <= 1002 + len(t)
    listed = sum(change.is_switch for change in few.partitions)
    assert few.certificate.switches == many.certificate.switches == listed + few.counters["unlisted_switches"]
    assert any("are counted, but not listed" in note for note in few.notes)
    # outputs are described by the choice that was in use, whether few are asked for or many
    assert np.array_equal(few.independent, many.independent[::200])
    assert np.allclose(few.vdot, many.vdot[::200], rtol=1e-12) and np.allclose(few.sigma, many.sigma[::200], rtol=1e-12)
    in_use = [[p for p in few.partitions if p.t <= time][-1].independent for time in t[1:]]
    names = few.names.velocities
    assert in_use == [tuple(names[i] for i in row) for row in few.independent[1:]]
    assert pickle.loads(pickle.dumps(few)).certificate.switches == few.certificate.switches
