"""The scripts of examples/paper: what they return is what theory says, and each draws its figure."""

from __future__ import annotations

import importlib
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = ROOT / "examples" / "paper"
NAMES = ("pendulum", "four_bar_turn", "drift", "orders", "determinant", "individual", "frozen", "switching")

if str(SCRIPTS) not in sys.path:
    sys.path.insert(0, str(SCRIPTS))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("paper")


@cache
def numbers(name: str, folder: Path) -> dict[str, float]:
    """What the script found in its short form."""
    found: dict[str, float] = importlib.import_module(name).main(True, folder)
    return found


@pytest.mark.parametrize("name", NAMES)
def test_figure_is_drawn(name: str, folder: Path) -> None:
    numbers(name, folder)
    assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_every_script_is_tested_and_on_the_page() -> None:
    scripts = {path.stem for path in SCRIPTS.glob("*.py")} - {"drawing", "linkage"}
    page = (ROOT / "docs" / "paper.md").read_text("utf-8")
    assert scripts == set(NAMES) == {name for name in scripts if f"paper/{name}.png" in page}


def test_linkage_has_the_regression_values() -> None:
    """Four-bar at 0.8 rad and 1.5 rad/s of its crank: matrices and accelerations, known to 12 digits."""
    import linkage
    import numpy as np

    import partita as pt

    phi = linkage.close(0.8)
    rate = linkage.tangent(phi)
    rate = 1.5 * rate / rate[0]
    t = linkage.TO_JOINTS
    assert phi == pytest.approx([0.8, 0.477935466983, -1.937228058039], abs=1e-12)
    assert np.linalg.solve(t, rate) == pytest.approx([1.5, -1.855403823966, 0.712815169891], abs=1e-11)
    m, c = linkage.joint_matrices(phi)
    assert m[0] == pytest.approx([29.469902911825, 18.768030028682, -2.909793239665], abs=1e-11)
    assert c[1] == pytest.approx([2.2, 1.503293290653, -0.7165726846961], abs=1e-11)
    assert t.T @ linkage.forces(phi, rate) == pytest.approx([-90.79193751543, -56.193111292655, 9.219518661212])
    assert linkage.bias(phi, rate) == pytest.approx([-1.756448485037, -1.520768627338], abs=1e-11)
    assert pt.partition.measure(m, c) == pytest.approx([0.881509349986, 0.750861289725, 0.457251342070], abs=1e-11)
    rho = pt.partition.measure(*linkage.absolute_matrices(phi))
    assert rho == pytest.approx(
        [0.262122438, 0.254577139, 0.210964209, 0.671499115, 0.501167177, 0.197583026, 0.229909960, 0.088231108,
         0.142177493], abs=1e-9,
    )  # fmt: skip
    assert rho @ rho == pytest.approx(1.0, abs=1e-12)


def test_pendulum(folder: Path) -> None:
    found = numbers("pendulum", folder)
    # round-off of a few operations
    assert found["point: largest deviation from |cos|, |sin|"] < 1e-14
    assert found["rod: largest deviation from the formulas"] < 1e-14
    assert found["rod: rho of the angle"] == pytest.approx(0.5, abs=1e-14)
    # seen at the end of a step: at most 6.2 rad/s times 0.005 s, 1.8 degrees, after 45 degrees
    assert found["exchanges of x and y in two seconds"] >= 3
    assert found["farthest exchange from 45 [deg]"] < 1.8


def test_four_bar_along_a_turn(folder: Path) -> None:
    found = numbers("four_bar_turn", folder)
    for joint in (1, 2):  # known to two digits
        assert found[f"joint: least rho of joint {joint}"] == pytest.approx(0.73, abs=0.005)
    assert found["joint: least rho of joint 3"] < 1e-12  # at 0 and 180 degrees exactly
    assert found["absolute: least rho of θ1"] == pytest.approx(0.105, abs=5e-4)
    others = [value for name, value in found.items() if name.startswith("absolute: least rho of ") and "θ1" not in name]
    # zeros between two positions 0.1 degrees apart; the measure rises by less than 4 per rad around them
    assert len([value for value in others if value < 0.004]) == 8
    exchanges = {margin: found[f"absolute: exchanges, margin {margin}"] for margin in ("1", "1.2", "1.5", "2", "3")}
    assert exchanges == {"1": 6, "1.2": 5, "1.5": 5, "2": 4, "3": 4}
    for margin, least in (("1.2", 0.43), ("1.5", 0.36), ("2", 0.28), ("3", 0.19)):
        name = f"absolute: least rho of the chosen, margin {margin}"
        assert found[name] == pytest.approx(least, abs=0.006)  # two digits
        assert found[name] >= 1.0 / (1.0 + float(margin) ** 2 * 8.0) ** 0.5  # the bound for k = 1, m = 8
    assert all(found[f"joint: exchanges, margin {margin}"] == 0 for margin in ("1.5", "2", "3"))


def test_drift_is_linear_and_quadratic(folder: Path) -> None:
    """Exponents fitted to the envelope of an oscillating error over two octaves: good to a tenth or two."""
    found = numbers("drift", folder)
    assert found["k + n: |Phi| grows like t to the"] == pytest.approx(1.0, abs=0.25)
    assert found["accelerations: |Phi| grows like t to the"] == pytest.approx(2.0, abs=0.25)
    assert found["accelerations: |C v| grows like t to the"] == pytest.approx(1.0, abs=0.25)
    assert found["k + n: largest |C v|"] < 1e-13  # computed, not integrated
    assert found["k + n: |Phi| falls with the step to the"] == pytest.approx(4.0, abs=0.5)
    assert found["accelerations: largest |Phi|"] > 1e3 * found["k + n: largest |Phi|"]


def test_every_formulation_keeps_the_order_of_the_method(folder: Path) -> None:
    """Slopes over less than a decade of steps: the next term of the error bends them by a tenth or two."""
    found = numbers("orders", folder)
    assert len(found) == 18
    for name, slope in found.items():
        order = int(name.split(" of order ")[1].split(",")[0])
        assert slope == pytest.approx(order, abs=0.2), name


def test_determinant_follows_the_units_and_the_measure_does_not(folder: Path) -> None:
    import linkage

    found = numbers("determinant", folder)
    first = {name: linkage.ABSOLUTE[int(value)] for name, value in found.items() if "index" in name}
    at = "determinant at 0.8 rad: index of its choice in"
    assert [first[f"{at} {unit}"] for unit in ("m, rad", "mm, rad", "m, deg")] == ["θ1", "x2", "θ1"]
    assert first["measure at 0.8 rad: index of its choice"] == "x2"
    assert found["determinant: share of the turn that changes with m to mm"] > 0.8
    assert found["measure: largest change with the units"] < 1e-13


def test_largest_one_by_one_fail_together(folder: Path) -> None:
    found = numbers("individual", folder)
    for name, least in (("pendulum and carts", 0.577), ("3-RRR robot", 0.46), ("coupled inertia", 0.40)):
        assert found[f"{name}: sigma of the k largest rho"] < 1e-12  # zero; round-off of a singular block
        assert found[f"{name}: |det C_D| of that choice"] < 1e-12
        assert found[f"{name}: sigma of the collective choice"] >= least
    assert found["robot, many poses: least sigma of the collective choice"] > 0.25
    assert found["robot, many poses: least sigma of the k largest rho"] < 0.1


def test_frozen_tangent_fades(folder: Path) -> None:
    found = numbers("frozen", folder)
    for angle, value in ((0, 1.0), (10, 0.98), (40, 0.83), (80, 0.46), (120, 0.04)):  # two digits
        assert found[f"frozen tangent after {angle} deg"] == pytest.approx(value, abs=0.006)
    assert found["least quality of the exchanged coordinates"] > 0.5


def test_exchanges_cost_nothing(folder: Path) -> None:
    found = numbers("switching", folder)
    assert found["exchanges among them, forced"] == 1231
    for name in ("order, the better coordinate", "order, forced"):
        # the leading error changes sign on the way, so that the fit over a sixteenth of the step has its own error
        assert found[name] == pytest.approx(4.0, abs=0.6), name
    # what a measure of 0.3 may cost: the error of a partition is magnified by at most 1 / rho each way
    ratio = found["error at the smallest step, forced"] / found["error at the smallest step, the better coordinate"]
    assert ratio < 1.0 / 0.3**2
    assert found["largest jump of q' at an exchange"] < 1e-14
