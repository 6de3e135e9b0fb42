"""Writers walk a mechanism by a table: no element leaves unheard, and what is heard is what the table says."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.io.writing_table import CHANGED, DROPPED, OMITTED, PARTLY, REFUSED, TABLE, WRITTEN

Add = Callable[[pt.Mechanism, str], Any]
STEP = iter(range(10**6))


def beside(m: pt.Mechanism, name: str) -> tuple[str, tuple[float, float, float]]:
    """A new body, and the place where it is drawn."""
    at = (float(len(m.bodies)), 0.3, 0.2)
    m.add_body(f"{name} body", mass=1.0, inertia=(0.1, 0.2, 0.25), position=at)
    return f"{name} body", at


def joined(kind: str, **how: Any) -> Add:
    """A joint that carries a new body."""

    def add(m: pt.Mechanism, name: str) -> None:
        body, at = beside(m, name)
        getattr(m, f"add_{kind}")(name, m.ground, body, **({"point": at} | how))

    return add


AXES = {"axis1": (1, 0, 0), "axis2": (0, 1, 0)}
JOINTS: dict[str, Add] = {
    "revolute": joined("revolute", axis=(0, 1, 0)),
    "prismatic": joined("prismatic", axis=(0, 1, 0)),
    "cylindrical": joined("cylindrical", axis=(0, 1, 0)),
    "screw": joined("screw", axis=(0, 1, 0), pitch=0.01),
    "universal": joined("universal", **AXES),
    "spherical": joined("spherical"),
    "planar": joined("planar", normal=(0, 0, 1)),
    "fixed": joined("fixed"),
    "free": joined("free"),
    "constant velocity": joined("constant_velocity", axis=(1, 0, 0)),
    "generic": joined("joint", free=["x", "rz"]),
    "pin slot": joined("pin_slot", **AXES),
    "point on line": joined("point_on_line", axis=(1, 0, 0)),
    "point on plane": joined("point_on_plane", normal=(0, 0, 1)),
    "parallel": joined("parallel", axis=(1, 0, 0)),
    "perpendicular": joined("perpendicular", **AXES),
    "orientation": joined("orientation"),
    "custom": joined("custom_joint", free=["rz"], follows={"x": lambda a: 0.1 * a}),
}
OTHERS: dict[str, Add] = {
    "body": lambda m, name: m.add_body(name, mass=1.0, inertia=(1, 1, 1)),
    "rod": lambda m, name: m.add_rod(name, (0, 0, 1), (1, 0, 1), mass=1.0),
    "solid": lambda m, name: m.add_solid(name, pt.shapes.Disc(0.1, 0.02), material="steel"),
    "form": lambda m, name: m.add_solid(name, pt.shapes.Sphere(0.1), material="steel"),
    "body without gravity": lambda m, name: m.add_body(name, mass=1.0, inertia=(1, 1, 1), gravity=False),
    "compliance": lambda m, name: m.add_compliance("A", translation=1e-6),
    "rotor": lambda m, name: m.add_rotor("A", 1e-3, ratio=50.0, name=name),
    "coupler": lambda m, name: m.add_coupler(name, ["A", "B"], [1.0, -2.0]),
    "gear": lambda m, name: m.add_gear("B", "P", ratio=-2.0, name=name),
    "belt": lambda m, name: m.add_belt("P", "Q", radius1=0.1, radius2=0.2, name=name),
    "rack": lambda m, name: m.add_rack("Q", "S", radius=0.2, name=name),
    "cam": lambda m, name: m.add_cam("T", "U", ([0.0, 1.0, 2.0, 3.0], [0.0, 0.1, 0.3, 0.2]), name=name),
    "distance": lambda m, name: m.add_distance(name, "a", (0, 0, 0.1), "c", (0, 0, 0)),
    "rolling": lambda m, name: m.add_rolling(name, "c", 0.2, ball=True, point=(0, 0, -0.2), normal=(0, 0, 1)),
    "point on curve": lambda m, name: m.add_point_on_curve(
        name, "a", "c", (0, 0, 0), curve=([-9.0, -3.0, 3.0, 9.0], [0.0, 0.1, 0.3, 0.2])
    ),
    "constraint": lambda m, name: m.add_constraint(name, lambda t, u, v: u - v, of=["U", "V"]),
    "drive": lambda m, name: m.add_drive("V", velocity=1.0, name=name),
    "spring": lambda m, name: m.add_spring(name, "a", (0, 0, 0), "b", (0, 0, 0), stiffness=10.0, damping=0.1),
    "torsion spring": lambda m, name: m.add_torsion_spring("A", stiffness=2.0, damping=0.1, name=name),
    "torque": lambda m, name: m.add_torque("A", value=1.0, name=name),
    "force": lambda m, name: m.add_force("a", force=(1, 0, 0), name=name),
    "gas spring": lambda m, name: m.add_gas_spring("S", force=100.0, length=0.5, name=name),
    "force law": lambda m, name: m.add_force_law(
        name, lambda t, a: ((0, 0, 1), (0, 0, 0)), sees=["a"], on=[("a", (0, 0, 0))]
    ),
    "bushing": lambda m, name: m.add_bushing(name, "a", "b", (0, 0, 0), stiffness=np.eye(6), damping=np.eye(6)),
    "friction": lambda m, name: m.add_friction("A", 0.1, stick_velocity=0.01, name=name),
    "stop": lambda m, name: m.add_stop("A", lower=-1.0, upper=1.0, stiffness=100.0, name=name),
    "freewheel": lambda m, name: m.add_freewheel("A", name=name),
    "latch": lambda m, name: m.add_latch("A", at=1.0, name=name),
    "contact": lambda m, name: m.add_contact(
        name, "a", (0, 0, 0), m.ground, (0, 0, -1), normal=(0, 0, 1), radius1=0.1, stiffness=1e3
    ),
    "rope": lambda m, name: m.add_rope(name, "a", (0, 0, 0), m.ground, (0, 0, 2), stiffness=100.0),
    "gas strut": lambda m, name: m.add_gas_strut(
        name, "a", (0, 0, 0), m.ground, (0, 0, 2), force=100.0, progression=1.3, stroke=0.2
    ),
    "tyre": lambda m, name: m.add_tyre(
        name, "a", center=(0, 0, 0), axis=(0, 1, 0), radius=0.3, normal=(0, 0, 1), point=(0, 0, -0.3), stiffness=1e4,
        friction=0.5, longitudinal=5.0, lateral=4.0, slow_speed=0.3,
    ),
    "sensor": lambda m, name: m.add_sensor(name, m.joints["A"], "position"),
}  # fmt: skip
ADDED = {**JOINTS, **OTHERS}


def base() -> pt.Mechanism:
    m = pt.Mechanism("base", gravity=(0, 0, -9.81))
    for i, name in enumerate("abc"):
        m.add_body(name, mass=1.0, inertia=(0.1, 0.2, 0.25), position=(0.4 * i, 0, 0))
    m.add_revolute("A", m.ground, "a", point=(0, 0, 0), axis=(0, 1, 0))
    m.add_revolute("B", "a", "b", point=(0.4, 0, 0), axis=(0, 1, 0))
    m.add_free("C", m.ground, "c")
    for i, name in enumerate("PQUVST"):
        m.add_body(name.lower() + "b", mass=1.0, inertia=(0.1, 0.2, 0.25), position=(0, 1.0 + i, 0))
        add = m.add_prismatic if name in "ST" else m.add_revolute
        add(name, m.ground, name.lower() + "b", point=(0, 1.0 + i, 0), axis=(0, 0, 1))
    return m


def saved(m: pt.Mechanism, folder: Path, suffix: str) -> tuple[str, list[str], list[str]]:
    """All files that are written, and what is said."""
    inside = folder / f"{next(STEP)}"
    inside.mkdir()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pt.errors.LossyFileWarning)
        written = m.save(inside / f"model{suffix}")
    return "".join(file.read_text("utf-8") for file in written.files), written.changed, written.dropped


def test_the_table_has_every_element() -> None:
    """By the methods that add them; a new one needs a rule in each format."""
    named = {"add_joint": "generic", "add_custom_joint": "custom", "add_imu": "sensor"}  # an IMU is two sensors
    named["add_brake"] = "friction"
    methods = {
        named.get(name, name.removeprefix("add_").replace("_", " ")) for name in dir(pt.Mechanism) if name[:4] == "add_"
    }
    settings = {"gravity", "time-dependent gravity", "drawing tolerance"}
    assert methods | {"body without gravity", "form"} | settings == set(TABLE)
    assert methods | {"body without gravity", "form"} == set(ADDED)


@pytest.mark.parametrize("suffix", [".urdf", ".mjcf", ".usda", ".toml"])
def test_no_element_leaves_unheard(suffix: str, tmp_path: Path) -> None:
    """Each element, added to a mechanism, changes its file or what is said of it, as its rule says."""
    kind = suffix.removeprefix(".").upper()[:4].replace("USDA", "USD")
    m = base()
    text, changed, dropped = saved(m, tmp_path, suffix)
    for element, add in ADDED.items():
        rule = TABLE[element][kind].rule
        name = f"the {element}"
        before = m._description.copy()
        add(m, name)
        if rule == REFUSED:
            with pytest.raises(
                pt.errors.DescriptionError, match=re.escape(TABLE[element][kind].effect.removeprefix("its coordinates"))
            ):
                saved(m, tmp_path, suffix)
            m._description = before
            continue
        now = saved(m, tmp_path, suffix)
        new_changed = [line for line in now[1] if line not in changed]
        new_dropped = [line for line in now[2] if line not in dropped]
        assert now != (text, changed, dropped), element
        if rule == DROPPED:
            (line,) = (line for line in new_dropped if name in line or element == "compliance")
            assert line.endswith(TABLE[element][kind].effect), element
        elif rule == OMITTED:
            assert any(name in line for line in new_changed), element
        elif rule in (WRITTEN, CHANGED):
            assert now[0] != text or new_changed, element
            assert not new_dropped, element
        else:
            assert rule == PARTLY
        text, changed, dropped = now


@pytest.mark.parametrize("suffix", [".urdf", ".mjcf", ".usda", ".toml"])
def test_settings_of_a_mechanism_are_heard(suffix: str, tmp_path: Path) -> None:
    found = []
    for settings in (
        {"gravity": (0, 0, -9.81)},
        {"gravity": (0, 0, -1.62)},
        {"gravity": (0, 0, ((0.0, 1.0), (-9.81, -1.0)))},
        {"gravity": (0, 0, -9.81), "drawing_tolerance": 1e-3},
    ):
        m = pt.Mechanism("one", **settings)  # type: ignore[arg-type]
        m.add_rod("rod", (0, 0, 0), (1, 0, 0), mass=1.0)
        m.add_revolute("A", m.ground, "rod", point=(0, 0, 0), axis=(0, 1, 0))
        found.append(saved(m, tmp_path, suffix))
    assert all(found[i] != found[j] for i in range(len(found)) for j in range(i))
