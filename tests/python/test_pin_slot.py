"""A pin in a slot: closed forms of machines with one, the generic joint of its directions, what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import partita as pt
from partita.errors import DescriptionError

R, SPEED = 0.1, 3.0
TIMES = np.linspace(0.0, 2.0, 41)


def yoke(kind: str = "add_pin_slot", tilt: float = 0.0) -> pt.Mechanism:
    """A crank whose pin slides in the slot of a slider; the slot leans by `tilt` from across the slide."""
    m = pt.Mechanism("yoke", gravity=(0.0, -9.81, 0.0))
    crank = m.add_rod("crank", start=(0, 0, 0), end=(R, 0, 0), mass=0.4)
    slider = m.add_body("slider", mass=2.0, inertia=(0.1, 0.1, 0.1))
    slot = (np.sin(tilt), np.cos(tilt), 0.0)
    m.add_revolute("A", m.ground, crank, point=(0, 0, 0))
    m.add_prismatic("S", m.ground, slider, axis=(1, 0, 0))
    if kind == "add_pin_slot":
        m.add_pin_slot("pin", slider, crank, point=(R, 0, 0), axis1=slot)
    else:
        frame = np.column_stack([slot, np.cross((0, 0, 1), slot), (0, 0, 1)])
        m.add_joint("pin", slider, crank, free=("x", "rz"), point=(R, 0, 0), frame=frame)
    m.add_drive("A", velocity=SPEED)
    return m


def driven(m: pt.Mechanism, coordinates: str = "relative") -> pt.Result:
    run = m.simulate(2.0, t_eval=TIMES, initial=m.assemble(rates={"A": SPEED}), coordinates=coordinates)
    assert run.success, run.message
    return run


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_scotch_yoke_moves_as_a_cosine(coordinates: str) -> None:
    """x = r cos(w t) - r, and the pin presses with m x'' across the slot, which leans by an angle."""
    tilt = 0.3
    run = driven(yoke(tilt=tilt), coordinates)
    angle = SPEED * TIMES
    # the pin at r (cos, sin) lies on the line through the slider along the slot (sin tilt, cos tilt)
    x = R * (np.cos(angle) - 1.0) - R * np.sin(angle) * np.tan(tilt)
    xdd = -(SPEED**2) * R * (np.cos(angle) - np.sin(angle) * np.tan(tilt))
    assert np.abs(run.joint("S").position[:, 0] - x).max() < 1e-9
    assert np.abs(run.joint("pin").position[:, 0] - R * np.sin(angle) / np.cos(tilt)).max() < 1e-9
    along = np.array([np.sin(tilt), np.cos(tilt), 0.0])
    assert np.abs(run.joint("pin").force @ along).max() < 1e-9
    assert np.abs(-run.joint("pin").force[:, 0] - 2.0 * xdd).max() < 1e-7


def test_a_slotted_lever_returns_quickly() -> None:
    """Whitworth: the lever at (0, -d) stands at atan2(r sin, d + r cos), seen from the line of centres."""
    d = 0.25
    m = pt.Mechanism("lever", gravity=None)
    crank = m.add_rod("crank", start=(0, 0, 0), end=(0, R, 0), mass=0.4)
    lever = m.add_rod("lever", start=(0, -d, 0), end=(0, 0.3, 0), mass=1.0)
    m.add_revolute("A", m.ground, crank, point=(0, 0, 0))
    m.add_revolute("B", m.ground, lever, point=(0, -d, 0))
    m.add_pin_slot("pin", lever, crank, point=(0, R, 0), axis1=(0, 1, 0))
    m.add_drive("A", velocity=SPEED)
    run = driven(m)
    angle = SPEED * TIMES
    assert np.abs(run.joint("B").position[:, 0] - np.arctan2(R * np.sin(angle), d + R * np.cos(angle))).max() < 1e-9
    length = np.hypot(R * np.sin(angle), d + R * np.cos(angle))
    assert np.abs(run.joint("pin").position[:, 0] - (length - d - R)).max() < 1e-9
    assert m.report().to_dict()["mobility"] == 0


def test_it_is_the_generic_joint_of_its_directions() -> None:
    named, generic = driven(yoke(tilt=0.2)), driven(yoke("add_joint", tilt=0.2))
    for word in ("position", "velocity", "force", "moment"):
        assert np.abs(getattr(named.joint("pin"), word) - getattr(generic.joint("pin"), word)).max() < 1e-9, word


def test_it_comes_back_from_a_file(tmp_path: Path) -> None:
    m = yoke(tilt=0.1)
    m.save(tmp_path / "yoke.toml")
    assert pt.load(tmp_path / "yoke.toml").to_spec()["joints"] == m.to_spec()["joints"]


def test_a_slot_along_its_pin_is_refused() -> None:
    m = pt.Mechanism("wrong")
    body = m.add_body("body", mass=1.0, inertia=(1, 1, 1))
    m.add_pin_slot("pin", m.ground, body, point=(0, 0, 0), axis1=(1, 0, 1), axis2=(0, 0, 1))
    with pytest.raises(DescriptionError, match=r'"pin".*45\.0000 deg'):
        m.compile()
