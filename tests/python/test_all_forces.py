"""All forces at once: in both coordinates, in other units, with parameters, in files."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from force_mechanisms import G, balanced, everything

import partita as pt
from partita.errors import DescriptionError


def test_all_forces_at_once_in_relative_and_absolute_coordinates() -> None:
    m = everything()
    start = m.assemble(rates={"A": (0.4, 1.0), "B": (0.5, -0.7)})
    runs = [
        m.simulate(0.6, initial=start, coordinates=c, t_eval=[0.0, 0.3, 0.6], rtol=1e-11)
        for c in ("relative", "absolute")
    ]
    for x, y in zip(*[(r.body("b").position, r.joint("B").velocity, r.energy.work) for r in runs], strict=True):
        np.testing.assert_allclose(x, y, atol=1e-9)
    # reactions at both coordinates are the same wrenches
    np.testing.assert_allclose(runs[0].joint("B").force, runs[1].joint("B").force, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(runs[0].joint("A").moment, runs[1].joint("A").moment, rtol=1e-7, atol=1e-7)
    for run in runs:
        balanced(run, 1e-11)


@pytest.mark.parametrize("scale", [1e3, 1e-6])
def test_the_unit_of_length_does_not_matter(scale: float) -> None:
    """Kilometres and micrometres: the same motion, times the scale."""
    m, other = everything(), everything(scale)
    v = np.array([0.4, 1.0, 0.5, -0.7])
    q = m.assemble().q
    short = {"t_eval": [0.0, 0.2], "rtol": 1e-10}
    run = m.simulate(0.2, initial=pt.State(0.0, q, v), **short)
    there = other.simulate(0.2, initial=pt.State(0.0, q, v * (scale, 1, 1, 1)), atol=1e-13, **short)
    assert there.success, there.message
    np.testing.assert_allclose(there.body("b").position / scale, run.body("b").position, atol=1e-8)


def test_parameters_of_the_new_forces_are_those_of_a_new_mechanism() -> None:
    model = everything().compile()
    q, v = np.array([-0.25, 0.2, 0.4, 0.1]), np.ones(4)
    changes: dict[str, Any] = {}
    for name, value in model.parameters.items():
        if name.split(".")[0] in ("bushing", "floor", "tyre", "stop of A", "stop of B", "friction in B"):
            changes[name] = np.asarray(value) * 1.1
    assert len(changes) > 25
    moved = model.with_parameters(changes)
    assert not np.allclose(moved.forces(q, v), model.forces(q, v))
    back = moved.with_parameters({name: model.parameters[name] for name in changes})
    np.testing.assert_allclose(back.forces(q, v), model.forces(q, v), rtol=1e-14)
    assert moved.parameters["floor.stiffness"] == pytest.approx(1100.0)


def test_all_forces_but_laws_are_written_to_a_file_and_read_again(tmp_path: Path) -> None:
    m = everything()
    with pytest.raises(DescriptionError, match="Python function"):
        m.save(tmp_path / "law.toml")
    times = ((0.0, 1.0), (-G, -1.0))
    rest = pt.Mechanism("rest", gravity=(0.5, times, 1.0))
    rest._description.bodies.update(m._description.bodies)
    rest._description.joints.update(m._description.joints)
    rest._description.forces.update({k: v for k, v in m._description.forces.items() if k != "drag"})
    rest.add_rod("light", start=(0, 0, 1), end=(1, 0, 1), mass=1.0, gravity=False)
    rest.add_body("still", mass=1.0, inertia=(1, 1, 1), gravity=False)
    rest.add_friction("A", ((0.0, 2.0), (1.0, 2.0)), stick_velocity=0.1, coordinate=1)
    rest.add_contact("balls", "light", (0, 0, 0), "still", (0, 0, 0), radius1=0.1, radius2=0.2, stiffness=5.0)
    rest.save(tmp_path / "rest.toml")
    again = pt.load(tmp_path / "rest.toml")
    for x, y in zip(rest.to_spec()["forces"], again.to_spec()["forces"], strict=True):
        assert x.keys() == y.keys()
        for key in x:
            if isinstance(x[key], list) and key in ("frame1", "frame2", "point1", "point2", "normal", "axis"):
                np.testing.assert_allclose(y[key], x[key], atol=1e-15)
            else:
                assert y[key] == x[key], key
