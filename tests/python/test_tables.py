"""Tables of drives and loads: how they are joined by default and on request, everywhere alike."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.spatial.transform import Rotation

import partita as pt
from partita.errors import DescriptionError

RELATIVE_AND_ABSOLUTE = ("relative", "absolute")
TRAPEZOID = ([0.0, 1.0, 3.0, 4.0], [0.0, 5.0, 5.0, 0.0])


def crank(**drive: Any) -> pt.Mechanism:
    m = pt.Mechanism("crank", gravity=None)
    m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, "rod", point=(0, 0, 0))
    m.add_drive("A", **drive)
    return m


@pytest.mark.parametrize("coordinates", RELATIVE_AND_ABSOLUTE)
def test_a_trapezoid_of_rates_is_one(coordinates: str) -> None:
    for end in (np.linspace(0.0, 4.0, 161), np.array([0.0, 4.0])):
        run = crank(velocity=TRAPEZOID).simulate(4.0, t_eval=end, coordinates=coordinates, rtol=1e-10, atol=1e-12)
        hinge = run.joint("A")
        assert run.success
        assert np.max(np.abs(hinge.velocity[:, 0] - np.interp(run.t, *TRAPEZOID))) < 1e-9
        assert hinge.position[-1, 0] == pytest.approx(15.0, abs=1e-8)


def test_a_stepper_and_an_ensemble_follow_the_same_trapezoid(tmp_path: Path) -> None:
    m = crank(velocity=TRAPEZOID)
    stepper = m.stepper(0.5)
    for _ in range(8):
        state = stepper.step()
    assert state.position("A") == pytest.approx(15.0, abs=1e-6)
    members = m.ensemble(states=[m.assemble()] * 2, t_eval=[2.0, 4.0])
    assert np.max(np.abs(members.q[:, -1, 0] - 15.0)) < 1e-6
    again = pt.load(m.save(tmp_path / "crank.toml").path)
    assert again.to_spec() == m.to_spec()


@pytest.mark.parametrize("coordinates", RELATIVE_AND_ABSOLUTE)
def test_positions_stay_between_their_samples(coordinates: str) -> None:
    """Seeded tables with dwells, steps and turns: inside each interval the motion goes from one sample to the next."""
    rng = np.random.default_rng(89)
    tables = [([0.0, 1.0, 2.0], [0.0, 1.0, 10.0]), ([0.0, 1.0, 2.0, 3.0], [0.0, 0.0, 1.0, 1.0])]
    for _ in range(6):
        times = np.cumsum(rng.uniform(0.05, 1.0, size=6))
        tables.append((times - times[0], np.round(rng.normal(size=6), 1)))
    for times, values in tables:
        m = crank(position=(times, values))
        at = np.linspace(0.0, times[-1], 97)
        start = m.assemble(coordinates=coordinates)
        run = m.simulate(times[-1], t_eval=at, initial=start, coordinates=coordinates)
        assert run.success and run.certificate.verdict == "valid", (times, values)
        i = np.clip(np.searchsorted(times, run.t, side="right") - 1, 0, len(times) - 2)
        ends = np.array(values)
        low, high = np.minimum(ends[i], ends[i + 1]), np.maximum(ends[i], ends[i + 1])
        turned = run.joint("A").position[:, 0]
        assert np.all(turned >= low - 1e-9) and np.all(turned <= high + 1e-9), (times, values)
        assert np.max(np.abs(turned - PchipInterpolator(times, values)(run.t))) < 1e-9


def test_a_word_says_how_tables_are_joined(tmp_path: Path) -> None:
    times, values = [0.0, 0.5, 2.0, 3.0], [0.0, 1.0, 0.5, 2.0]
    joined = {"monotone": PchipInterpolator, "spline": CubicSpline}
    m = crank(position=0.0)
    for word, curve in joined.items():
        for level in ("position", "velocity", "acceleration"):
            m.drives["drive of A"].change(
                **dict.fromkeys(("position", "velocity", "acceleration")) | {level: (times, values)}, interpolation=word
            )
            assert m.drives["drive of A"].interpolation == word
            run = m.simulate(3.0, t_eval=times)
            found = {"position": "position", "velocity": "velocity", "acceleration": "acceleration"}[level]
            assert np.max(np.abs(getattr(run.joint("A"), found)[:-1, 0] - values[:-1])) < 1e-7
            if level != "acceleration":
                table = m.to_spec()["drives"][0]["motion"]["table"]
                assert np.allclose(table["coefficients"], curve(times, values).c.T)
            assert pt.load(m.save(tmp_path / "crank.toml").path).to_spec() == m.to_spec()
    m.add_body("stone", mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("S", m.ground, "stone", axis=(1, 0, 0))
    for word, curve in {**joined, "linear": None}.items():
        m.add_torque("S", (times, values), interpolation=word, name=word)
        m.add_force("stone", (0.0, (times, values), 1.0), interpolation=word, name=f"{word} force")
        spec = {force["name"]: force for force in m.to_spec()["forces"]}
        for table in (spec[word]["value"]["table"], spec[f"{word} force"]["value"][1]["table"]):
            slopes = np.diff(values) / np.diff(times)
            wanted = (
                np.array([0 * slopes, 0 * slopes, slopes, values[:-1]]).T if curve is None else curve(times, values).c.T
            )
            assert np.allclose(table["coefficients"], wanted)
        m.bodies["stone"].mass = 2.0  # every element is made again
        assert {force["name"]: force for force in m.to_spec()["forces"]} == spec
    assert pt.load(m.save(tmp_path / "crank.toml").path).to_spec() == m.to_spec()
    text = (tmp_path / "crank.toml").read_text("utf-8").replace('interpolation = "spline"', 'curve = "smooth"')
    text = "\n".join(line for line in text.splitlines() if not line.startswith("#"))
    (tmp_path / "former.toml").write_text(text, "utf-8")
    assert pt.load(tmp_path / "former.toml").to_spec() == m.to_spec()


def test_a_wrong_word_is_refused() -> None:
    with pytest.raises(DescriptionError, match=r"jump at every sample.*monotone"):
        crank(position=([0, 1], [0, 1]), interpolation="linear")
    with pytest.raises(DescriptionError, match="'monotone', 'linear', 'spline'"):
        crank(position=([0, 1], [0, 1]), interpolation="cubic")
    m = crank(position=0.0)
    with pytest.raises(DescriptionError, match="interpolation"):
        m.add_torque("A", ([0, 1], [0, 1]), interpolation="smooth")


def posed(times: Any, turns: Any, **more: Any) -> pt.Mechanism:
    m = pt.Mechanism("dish", gravity=None)
    m.add_body("dish", mass=1.0, inertia=(1, 2, 3))
    m.add_spherical("S", m.ground, "dish", point=(0, 0, 0))
    m.add_drive("S", pose=(times, turns), **more)
    return m


def test_poses_about_one_axis_are_joined_as_positions_are(tmp_path: Path) -> None:
    times, angles, axis = (
        np.array([0.0, 0.4, 1.0, 2.0, 2.5]),
        np.array([0.0, 0.0, 1.2, 1.2, 0.3]),
        np.array([2, -1, 2]) / 3,
    )
    m = posed(times, Rotation.from_rotvec(angles[:, None] * axis))
    run = m.simulate(2.5, t_eval=np.linspace(0.0, 2.5, 51))
    assert run.success
    turned = Rotation.from_quat(run.joint("S").position[:, [1, 2, 3, 0]]).as_rotvec() @ axis
    assert np.max(np.abs(turned - PchipInterpolator(times, angles)(run.t))) < 1e-9
    for word in ("monotone", "spline"):
        other = posed(times, Rotation.from_rotvec(angles[:, None] * axis), interpolation=word)
        assert pt.load(other.save(tmp_path / "dish.toml").path).to_spec() == other.to_spec()
        assert (other.to_spec() == m.to_spec()) == (word == "monotone")


def test_poses_about_many_axes_have_continuous_rates() -> None:
    rng = np.random.default_rng(90)
    times = np.cumsum(rng.uniform(0.3, 1.0, size=6))
    times -= times[0]
    run = posed(times, Rotation.from_rotvec(0.8 * rng.normal(size=(6, 3))))
    near = np.sort(np.concatenate([times[1:-1] - 1e-7, times[1:-1] + 1e-7]))
    found = run.simulate(times[-1], t_eval=np.concatenate([[0.0], near]))
    assert found.success and found.certificate.verdict == "valid"
    rates = found.joint("S").velocity[1:]
    assert np.max(np.abs(rates[1::2] - rates[0::2])) < 1e-4


@pytest.mark.parametrize("level", ["position", "velocity"])
@pytest.mark.parametrize("method", ["dop853", "tsit5", "dopri5"])
def test_a_table_of_a_drive_costs_a_step_for_a_sample(level: str, method: str) -> None:
    """Accelerations jump at every sample: steps end there, take what acts before it, and go on with what acts after."""
    t = np.linspace(0.0, 3.0, 91)
    for coordinates in ("relative", "absolute"):
        m = pt.Mechanism("rod", gravity=None)
        m.add_rod("rod", (0, 0, 0), (1, 0, 0), 1.0)
        m.add_revolute("A", m.ground, "rod", (0, 0, 0))
        m.add_drive("A", **{level: (t, np.sin(2.0 * t))})
        run = m.simulate(3.0, t_eval=np.linspace(0.0, 3.0, 301), rtol=1e-8, method=method, coordinates=coordinates)
        assert run.success and run.certificate.verdict == "valid"
        assert run.counters["steps"] < 3 * t.size and run.counters["rejected"] < t.size
        if level == "velocity":
            rates = np.interp(run.t, t, np.sin(2.0 * t))
            assert np.abs(run.joint("A").velocity[:, 0] - rates).max() < 1e-9
