"""Modes, linearisations and equilibria to look at: shares of energy, figures, datasets, tables."""

import math

import numpy as np
import pytest

import partita as pt


def platform() -> pt.Mechanism:
    """A body on six springs without load."""
    m = pt.Mechanism("platform", gravity=None)
    top = m.add_body("top", mass=6.0, inertia=(0.4, 0.5, 0.8), position=(0, 0, 1.0))
    m.add_free("free", m.ground, top, point=(0, 0, 1.0))
    for i in range(6):
        around, below = math.radians(60 * i + (10 if i % 2 else -10)), math.radians(60 * i + (-20 if i % 2 else 20))
        foot = np.array([1.2 * math.cos(below), 1.2 * math.sin(below), 0.0])
        head = np.array([0.7 * math.cos(around), 0.7 * math.sin(around), 0.0])
        length = float(np.linalg.norm(head - foot + np.array([0.0, 0.0, 1.0])))
        m.add_spring(f"leg {i}", m.ground, foot, top, head, stiffness=1000.0 * (1 + i), length=length)
    return m


def loop() -> pt.Mechanism:
    """A four-bar on torsion springs without load and without weight."""
    light = pt.Mechanism("springs", gravity=None)
    spots = [(0, 0, 0), (0, 0.3, 0), (0.8, 0.7, 0), (1, 0, 0)]
    bars = [light.add_rod(f"bar {i}", start=spots[i], end=spots[i + 1], mass=0.3 + 0.2 * i) for i in range(3)]
    for name, one, two, at in zip("ABCD", [light.ground, *bars], [*bars, light.ground], spots, strict=True):
        light.add_revolute(name, one, two, point=at)
    for name, stiffness in (("A", 3.0), ("C", 5.0), ("D", 2.0)):
        light.add_torsion_spring(name, stiffness=stiffness, name=f"twist {name}")
    return light


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("draw", [platform, loop])
def test_strain_energy_is_kinetic_energy_times_the_square_of_the_frequency(draw, coordinates):
    """Springs without load: the potential energy of a mode is omega^2 times its kinetic energy at velocities equal to
    its displacements."""
    modes = draw().linearize(coordinates=coordinates).modes()
    for mode in modes:
        both = np.array([mode.displacements.real, mode.displacements.imag])
        strain = sum(part.sum() for part, _ in modes._shapes.elastic(both).values())
        kinetic = sum(part.sum() for part in modes._shapes.kinetic(both).values())
        assert strain == pytest.approx(abs(mode.eigenvalue) ** 2 * kinetic, rel=1e-10)


def test_shares_of_springs_and_joints():
    modes = loop().linearize().modes()
    springs, joints = modes.energy(0, of="springs"), modes.energy(0, of="joints")
    assert sum(springs.values()) == pytest.approx(1.0)
    assert joints == {name: pytest.approx(springs[f"twist {name}"]) for name in "ACD"}
    turns = modes.shape(0)
    assert springs["twist A"] / springs["twist D"] == pytest.approx(
        3.0 * abs(turns["A"][0]) ** 2 / (2.0 * abs(turns["D"][0]) ** 2), rel=1e-12
    )
    assert set(platform().linearize().modes().energy(0, of="joints")) == set()
    with pytest.raises(pt.errors.ArgumentError, match=r"bodies.*springs.*joints"):
        modes.energy(0, of="bars")


def test_figures_show_eigenvalues_and_energies(tmp_path):
    m = platform()
    modes = m.linearize().modes()
    figure = modes.plot(tmp_path / "modes.png")
    assert (tmp_path / "modes.png").stat().st_size > 10_000
    poles, bodies, springs = figure.axes
    assert len(poles.lines[2].get_xdata()) == 12
    assert springs.get_yticklabels()[0].get_text() == f"0: {modes.frequency[0]:.3g} Hz"
    assert [text.get_text() for text in bodies.get_legend().get_texts()] == ["top"]
    assert len(springs.get_legend().get_texts()) == 6
    assert m.linearize().plot().axes[0].get_xlabel() == "real part [1/s]"
    assert len(m.equilibrium().plot(tmp_path / "equilibrium.png").axes) == 1
    # an unstable one has its growing eigenvalue apart, a mechanism without springs no shares
    pendulum = pt.Mechanism("pendulum")
    bar = pendulum.add_rod("bar", start=(0, 0, 0), end=(0, 1, 0), mass=1.0)
    pendulum.add_revolute("A", pendulum.ground, bar, point=(0, 0, 0))
    figure = pendulum.linearize().plot()
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == ["growing"]
    assert figure.axes[2].texts[0].get_text() == "no springs"


def test_datasets_have_names(tmp_path):
    m = loop()
    e = m.equilibrium()
    lin = m.linearize(e, inputs=["A"], outputs=["D"])
    data = lin.to_xarray()
    assert data.A.sel(state=lin.states[1], by=lin.states[0]).item() == lin.A[1, 0]
    assert data.D.dims == ("output", "input") and data.attrs["steady"] == 1
    modes = lin.modes().to_xarray()
    assert modes.frequency.values == pytest.approx(lin.modes().frequency)
    assert modes.spring_energy.sel(mode=0).values.sum() == pytest.approx(1.0)
    assert modes["shape"].dims == ("mode", "displacement", "part")
    rest = e.to_xarray()
    assert rest.joint_force.sel(joint="C").values == pytest.approx(e.joint("C").force[0])
    assert rest.attrs == {"title": "springs", "stable": "yes"}
    for i, one in enumerate((data, modes, rest)):
        one.to_netcdf(tmp_path / f"{i}.nc", engine="scipy")


def test_tables_in_a_notebook():
    m = loop()
    e = m.equilibrium()
    lin = m.linearize(e)
    assert "stable" in e._repr_html_() and "Hz" in e._repr_html_()
    assert "bar 0" not in lin._repr_html_() and "mode 0" in lin._repr_html_()
    assert f"{lin.modes().frequency[0]:.6g} Hz" in lin.modes()._repr_html_()
    moving = pt.catalogue.load("four-bar")
    assert "depend on the coordinates" in moving.linearize(moving.assemble(rates={"A": 2.0}))._repr_html_()


def test_no_damping_is_zero_and_not_minus_zero() -> None:
    m = pt.catalogue.load("four-bar")
    modes = m.linearize(m.equilibrium(stable=True)).modes()
    assert "damping 0," in str(modes) and "-0" not in str(modes)
    assert not np.signbit(modes.damping).any()
