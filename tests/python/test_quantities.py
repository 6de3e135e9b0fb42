"""Quantities with units: the same bits however a number is said, and refused where the dimension is another."""

import itertools
import json
import math
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita import units
from partita.errors import ArgumentError, DescriptionError, FileFormatError, PartitaError
from partita.units.door import QuantityError, in_si
from partita.units.table import UNITS
from partita.units.text import quantity_of, unit_of


def spec(m: pt.Mechanism) -> str:
    return json.dumps(m.to_spec())


# ---------------------------------------------------------------- texts

EXACT = [
    ("250 mm", "m", Fraction(1, 4)),
    ("25cm", "m", Fraction(1, 4)),
    ("0.00025 km", "m", Fraction(1, 4)),
    (".25e3 mm", "m", Fraction(1, 4)),
    ("+250000 µm", "m", Fraction(1, 4)),
    ("0.1 mm", "m", Fraction(1, 10_000)),
    ("3/4 inch", "m", Fraction("0.01905")),
    ("-1/3 ft", "m", -Fraction("0.1016")),
    ("7 oz", "kg", 7 * Fraction("0.45359237") / 16),
    ("2 kN/m", "N/m", Fraction(2000)),
    ("2 N/mm", "N/m", Fraction(2000)),
    ("0.5 N m s/rad", "N m s/rad", Fraction(1, 2)),
    ("0.5 N*m*s/rad", "N m s/rad", Fraction(1, 2)),
    ("0.5 N·m·s", "N m s/rad", Fraction(1, 2)),
    ("12 kg m^2", "kg m^2", Fraction(12)),
    ("12 kg*m**2", "kg m^2", Fraction(12)),
    ("12 kg m²", "kg m^2", Fraction(12)),
    ("300 g cm^2", "kg m^2", Fraction(3, 100_000)),
    ("9.81 m s^-2", "m/s^2", Fraction("9.81")),
    ("9.81 m s⁻²", "m/s^2", Fraction("9.81")),
    ("1 g_n", "m/s^2", Fraction("9.80665")),
    ("981 cm/s/s", "m/s^2", Fraction("9.81")),
    ("36 km/h", "m/s", Fraction(10)),
    ("1 lbf inch", "N m", Fraction("0.45359237") * Fraction("9.80665") * Fraction("0.0254")),
    ("1 slug", "kg", Fraction("0.45359237") * Fraction("9.80665") / Fraction("0.3048")),
    ("5 N/(mm s)", "N/(m s)", Fraction(5000)),
    ("3 min", "s", Fraction(180)),
    ("1e-30 m", "m", Fraction(1, 10**30)),
    ("0 rpm", "rad/s", Fraction(0)),
]


@pytest.mark.parametrize(("text", "unit", "value"), EXACT)
def test_one_rounding(text: str, unit: str, value: Fraction) -> None:
    """The float nearest to the exact product."""
    assert in_si("x", text, unit) == float(value)


def test_every_decimal_of_a_length() -> None:
    """Digits moved by hand: the reader of floats rounds correctly, and so must this."""
    for digits in ("1", "3", "7.1", "123456789", "0.30000000000000004", "9007199254740993"):
        for unit, power in (("mm", -3), ("cm", -2), ("km", 3), ("µm", -6), ("nm", -9)):
            assert in_si("x", f"{digits} {unit}", "m") == float(f"{digits}e{power}")


def test_degrees_are_those_of_python() -> None:
    for number in [30.0, 90.0, 180.0, 0.1, 1e-9, 1e9, *np.linspace(-720.0, 720.0, 97).tolist()]:
        assert in_si("x", f"{number!r} deg", "rad") == math.radians(number) == number * units.deg
        assert in_si("x", f"{number!r} rpm", "rad/s") == number * units.rpm
    # of the sizes themselves the nearest float: pi to twenty digits more than a float has
    pi = Fraction("3.14159265358979323846264338327950288")
    assert units.deg == float(pi / 180) and units.rpm == float(pi / 30) and units.rev == float(2 * pi)


def test_constants_and_names_agree() -> None:
    for name in set(units.__all__) & set(UNITS):
        assert float(unit_of(name).size) == getattr(units, name), name
        for other in set(units.__all__) & set(UNITS):
            if UNITS[name].dimension == UNITS[other].dimension:
                there = units.convert(1.0, name, other)
                assert there * units.convert(1.0, other, name) == pytest.approx(1.0, rel=3e-16)


def test_units_multiply_as_numbers_do() -> None:
    """Every pair of units, a product and a quotient: sizes multiply and exponents add."""
    for (a, first), (b, second) in itertools.product(list(UNITS.items())[::7], list(UNITS.items())[::5]):
        product, quotient = unit_of(f"{a} {b}"), unit_of(f"{a}/{b}")
        assert product.size == first.size * second.size and quotient.size == first.size / second.size
        sums = [x + y for x, y in zip(first.dimension, second.dimension, strict=True)]
        assert list(product.dimension) == sums == list(unit_of(f"({b}) * ({a})").dimension)


@pytest.mark.parametrize(
    ("text", "unit", "words"),
    [
        ("3 kg", "m", r"x is a length \[m\]; '3 kg' is a mass"),
        ("3 m", "kg", r"x is a mass \[kg\]; '3 m' is a length"),
        ("5 N", "N m", r"a torque \[N m\]; '5 N' is a force"),
        ("5 N m/rad", "N m", "a torque .* is a torsional stiffness"),
        ("1 m^4/s", "m", r"is a quantity in m\^4 s\^-1"),
        ("2 kg", "", "a number without unit; '2 kg' is a mass"),
        ("2 Hz", "rad/s", "is a frequency; turns per second are rev/s"),
        ("2 1/s", "rad/s", "one number comes first"),
        ("2/s", "rad/s", "is a frequency"),
        ("2", "m", "a text without unit; write '2 m'"),
        ("m", "m", "real numbers"),
        ("", "m", "real numbers"),
        ("three mm", "m", "real numbers"),
        ("3 mmm", "m", "no unit 'mmm'; did you mean 'mm'"),
        ("3 MM", "m", "did you mean 'mm'"),
        ("3 Newton", "N", "did you mean 'newton'"),
        ("1,5 mm", "m", "decimal separator"),
        ("5 N/m s", "N", "ambiguous"),
        ("5 N/m*s", "N", "ambiguous"),
        ("5 ft 3", "m", "one number"),
        ("5 3 mm", "m", "one number"),
        ("5 mm2", "m", "powers are m"),
        ("5 (mm", "m", "not closed"),
        ("5 mm)", "m", "does not belong"),
        ("5 mm^", "m", "an exponent must be a number"),
        ("5 mm^99", "m", "exponent beyond"),
        ("5 m^0.123456", "m", "few digits"),
        ("5 mm/0", "m", "divides by zero"),
        ("5 mm/(0 s)", "m", "divides by zero"),
        ("1e999999999 m", "m", "no float|cannot be represented"),
        ("1e399 m", "m", "no float"),
        ("9" * 300 + " m", "m", "characters long"),
        ("((((((((((1 m))))))))))", "m", "does not belong"),
        ("nan m", "m", "real numbers"),
        ("inf m", "m", "real numbers"),
        ("5 m\n", "kg", "is a length"),
        ("-+5 m", "m", "does not belong"),
        ("5 m $", "m", "belongs to no quantity"),
    ],
)
def test_what_does_not_fit_is_reported(text: str, unit: str, words: str) -> None:
    with pytest.raises(QuantityError, match=words):
        in_si("x", text, unit)


def test_a_radian_may_be_left_out_where_it_is_redundant() -> None:
    assert in_si("x", "5 N m", "N m/rad") == in_si("x", "5 N m/rad", "N m/rad") == 5.0
    assert in_si("x", "1 N m/deg", "N m/rad") == float(unit_of("1/deg").size)
    for text, unit in (("1 m/m", "rad"), ("1/s", "rad/s"), ("1/s^2", "rad/s^2"), ("1 rad", "")):
        with pytest.raises(QuantityError):
            in_si("x", text, unit)


# ---------------------------------------------------------------- the whole door


def machine(
    length: Any, mass: Any, inertia: Any, angle: Any, rate: Any, stiffness: Any, torsion: Any, damping: Any, force: Any,
    torque: Any, time: Any, gravity: Any, speed: Any,
) -> pt.Mechanism:  # fmt: skip
    """A quantity in every argument that has a dimension; `length` makes lengths of metres and so on."""
    m = pt.Mechanism("m", gravity=(0, gravity(-9.81), 0))
    box = m.add_body("box", mass(2.0), [inertia(x) for x in (0.1, 0.2, 0.25)], (0, length(0.1), 0), (length(1.5), 0, 0))
    rod = m.add_rod("rod", (0, 0, 0), (length(0.25), length(0.5), 0), mass(0.3))
    m.add_revolute("A", m.ground, rod, (0, 0, length(0.1)), child_point=(0, 0, length(0.1)))
    m.add_revolute("R", m.ground, box, (0, length(0.2), 0))
    m.add_cylindrical("C", m.ground, box, (length(1.5), 0, 0))
    m.add_screw("W", m.ground, box, (0, length(0.2), 0), pitch=length(0.01))
    m.add_planar("P", rod, box)
    m.add_spring("s", rod, (length(0.1), 0, 0), box, (0, length(1.0), 0), stiffness=stiffness(50.0), length=length(0.3))
    m.add_torsion_spring("A", stiffness=torsion(5.0), damping=damping(0.2), angle=angle(30.0))
    m.add_torsion_spring("C", stiffness=stiffness(5.0), angle=length(0.3))
    m.add_torque("A", ([time(0.5), time(1.5)], [torque(1.0), torque(2.0)]))
    m.add_torque("C", ([length(0.5), length(1.5)], [torque(1.0), torque(2.0)]), over=pt.Coordinate("C"), coordinate=1)
    m.add_force(box, (force(1.5), 0, ([time(0.0), time(1.5)], [force(1.0), force(2.0)])), (0, length(0.1), 0))
    six = [stiffness(1.0), stiffness(2.0), stiffness(3.0), torsion(4.0), torsion(5.0), torsion(6.0)]
    m.add_bushing("b", rod, box, (0, 0, length(0.2)), stiffness=six)
    m.add_friction("A", torque(0.4), stick_velocity=rate(6.0))
    m.add_friction("C", force(0.4), stick_velocity=speed(0.5))
    m.add_stop("A", lower=angle(-90.0), stiffness=torsion(1e3))
    m.add_stop("C", upper=length(1.5), stiffness=stiffness(1e3))
    plane = {"normal": (0, 1, 0), "stiffness": stiffness(1e5)}
    floor = {**plane, "exponent": 1, "stick_velocity": speed(0.1), "friction": 0.5}
    m.add_contact("c", box, (0, 0, 0), m.ground, (0, length(-9.0), 0), radius1=length(0.1), **floor)
    m.add_rope("r", box, (0, 0, 0), m.ground, (0, length(2.0), 0), length=length(0.5), stiffness=stiffness(1e3))
    strut = {"length": length(0.5), "stroke": length(0.2), "end_stiffness": stiffness(1e3)}
    m.add_gas_strut("gs", box, (0, 0, 0), m.ground, (0, length(2.0), 0), force=force(9.0), progression=1.3, **strut)
    m.add_tyre("t", box, center=(0, 0, 0), axis=(0, 0, 1), radius=length(0.3), point=(0, length(-9.0), 0), **plane)
    m.add_drive("C", angle(30.0), coordinate=1)
    m.add_drive("A", velocity=([time(0.0), time(0.5), time(1.5)], [rate(6.0), rate(9.0), rate(9.0)]))
    m.add_drive("P", pt_table(time, length))
    m.add_drive("W", acceleration=speed(1.0, "/s"), rate=speed(0.5))
    m.add_belt("A", "R", length(0.1), length(0.3))
    m.add_rack("A", "C", radius=length(0.02))
    m.add_distance("d", rod, (0, 0, length(0.1)), box, (0, 0, 0), length=length(1.5))
    m.add_coupler("k", ["C", pt.Coordinate("C", 1)], [1.0, length(0.02, "/rad")], offset=length(0.1))
    m.add_cam("P", "A", ([angle(0.0), angle(90.0), angle(180.0)], [length(0.1), length(0.2), length(0.1)]))
    m.add_rolling("r", box, radius=length(1.5), point=(0, length(-1.5), 0))
    return m


def pt_table(time: Any, length: Any) -> Any:
    return [time(0.0), time(0.5), time(1.5)], [length(0.0), length(0.1), length(0.2)]


SI = {
    "length": "m", "mass": "kg", "inertia": "kg m^2", "stiffness": "N/m", "torsion": "N m/rad", "damping": "N m s/rad",
    "force": "N", "torque": "N m", "time": "s", "gravity": "m/s^2", "speed": "m/s",
}  # fmt: skip
SMALL = {
    "length": "mm", "mass": "g", "inertia": "kg mm^2", "stiffness": "N/mm", "torsion": "N mm/rad",
    "damping": "N mm s/rad", "force": "kN", "torque": "kN mm", "time": "ms", "gravity": "cm/s^2", "speed": "mm/s",
}  # fmt: skip


def bare(name: str) -> Callable[..., Any]:
    if name == "angle":
        return lambda x: math.radians(x)
    if name == "rate":
        return lambda x: x * units.rpm
    return lambda x, per="": x


def as_text(name: str, table: dict[str, str]) -> Callable[..., Any]:
    """The number intended in SI, in another unit: its decimal moved exactly."""
    if name in ("angle", "rate"):
        return lambda x: f"{x!r} {'deg' if name == 'angle' else 'rpm'}"

    def with_unit(x: float, per: str = "") -> str:
        scale = Fraction(repr(x)) / unit_of(table[name]).size
        assert scale.denominator == 1 or Fraction(str(float(scale))) == scale
        return f"{float(scale)!r} {table[name]}{per}"

    return with_unit


WORDS = [*SI, "angle", "rate"]


def test_texts_give_the_same_bits() -> None:
    plain = spec(machine(**{name: bare(name) for name in WORDS}))
    assert spec(machine(**{name: as_text(name, SI) for name in WORDS})) == plain
    assert spec(machine(**{name: as_text(name, SMALL) for name in WORDS})) == plain


def test_quantities_of_pint_give_the_same_bits() -> None:
    registry = pytest.importorskip("pint").UnitRegistry()

    def quantities(name: str) -> Callable[..., Any]:
        text = as_text(name, SMALL)

        def quantity(*x: Any) -> Any:
            number, unit = text(*x).split(" ", 1)
            return registry.Quantity(float(number), unit)

        return quantity

    assert spec(machine(**{name: quantities(name) for name in WORDS})) == spec(
        machine(**{name: bare(name) for name in WORDS})
    )
    q = registry.Quantity
    for value, unit, expected in [
        (q(250, "mm"), "m", 0.25),
        (q(np.float32(0.5), "mm"), "m", 0.0005),
        (q(np.array(3), "cm"), "m", 0.03),
        (q([1, 2, 3], "inch"), "m", [0.0254, 0.0508, 0.0762]),
        (q(np.eye(2), "ft"), "m", [[0.3048, 0.0], [0.0, 0.3048]]),
        ([q(1, "mm"), 2.0, "3 mm"], "m", [0.001, 2.0, 0.003]),
        (np.array([q(1, "mm"), 2.0], dtype=object), "m", [0.001, 2.0]),
        (q(60, "rpm"), "rad/s", 60 * units.rpm),
        (q(0.3), "", 0.3),
    ]:
        assert in_si("x", value, unit) == expected
    # not in the table: by pint's own
    assert in_si("x", q(1, "furlong"), "m") == pytest.approx(q(1, "furlong").to("m").magnitude, rel=1e-15)
    for value, unit, words in [
        (q(1, "kg"), "m", "is a length"),
        (q(1, "hertz"), "rad/s", "frequency"),
        (q(20, "degC"), "m", "whose unit is not known"),
        (q(np.nan, "m"), "kg", "is a mass"),
        (q(1j, "m"), "m", "real numbers"),
    ]:
        with pytest.raises(QuantityError, match=words):
            in_si("x", value, unit)
    m = pt.Mechanism("m")
    with pytest.raises(DescriptionError, match="finite"):
        m.add_rod("r", (0, 0, 0), (1, 0, 0), mass=q(np.nan, "kg"))
    m.add_rod("r", (0, 0, 0), q([1000, 0, 0], "mm"), mass=q(2, "kg"))
    assert m.bodies["r"].end.tolist() == [1.0, 0.0, 0.0]


def test_units_are_never_dropped_in_silence() -> None:
    """Where no unit belongs NumPy would take the bare number of a quantity."""
    q = pytest.importorskip("pint").UnitRegistry().Quantity
    m = pt.catalogue.load("four-bar")
    state = m.assemble()
    model = m.compile()
    for call in [
        lambda: model.mass_matrix(q(state.q, "deg")),
        lambda: model.forces([q(x, "deg") for x in state.q], state.v),
        lambda: pt.State(0.0, q(state.q, "deg"), state.v),
        lambda: m.simulate(0.1, rtol=q(1e-6, "m")),
        lambda: units.convert(q(1.0, "m"), "mm", "m"),
        lambda: m.add_revolute("X", "ground", "crank", (0, 0, 0), axis=q([0, 0, 1], "m")),
    ]:
        with pytest.raises(PartitaError):
            call()  # type: ignore[no-untyped-call]

    class Foreign(np.ndarray):  # as those of astropy and unyt
        unit = "mm"

    with pytest.raises(DescriptionError, match="whose unit would be lost"):
        m.add_rod("r", (0, 0, 0), np.array([250.0, 0, 0]).view(Foreign), mass=1.0)
    with pytest.raises(PartitaError):
        model.mass_matrix(state.q.view(Foreign))


# ---------------------------------------------------------------- questions, files, the command line


def test_questions_take_quantities() -> None:
    m = pt.catalogue.load("four-bar")
    angle = math.radians(40.0)
    state = m.assemble({"A": angle}, {"A": 60 * units.rpm}, t=0.5)
    other = m.assemble({"A": "40 deg"}, {"A": "60 rpm"}, t="500 ms")
    assert state.t == other.t and state.q.tolist() == other.q.tolist() and state.v.tolist() == other.v.tolist()
    poses, same = m.assemble_many({"A": [angle, 1.0]}), m.assemble_many({"A": ["40 deg", "1 rad"]})
    assert poses.q.tolist() == same.q.tolist()
    where = m.assemble_many({("crank", (0.1, 0, 0), "x"): [0.05]})
    there = m.assemble_many({("crank", ("100 mm", 0, "0 m"), "x"): ["5 cm"]})
    assert where.q.tolist() == there.q.tolist()
    options: dict[str, Any] = {"method": "rk4"}
    run = m.simulate(0.1, initial=state, step=0.01, t_eval=[0.5, 0.55], **options)
    again = m.simulate("100 ms", initial=state, step="10 ms", t_eval=["0.5 s", "550 ms"], **options)
    assert run.q.tolist() == again.q.tolist()
    changed = m.compile().with_parameters({"crank.mass": "300 g", "gravity": (0, "-981 cm/s^2", 0)})
    assert changed.parameters["crank.mass"] == 0.3 and changed.parameters["gravity"] == [0.0, -9.81, 0.0]
    for call, words in [
        (lambda: m.assemble({"A": "3 mm"}), r"targets\['A'\] is an angle \[rad\]; '3 mm' is a length"),
        (lambda: m.assemble(rates={"A": "3 deg"}), "an angular velocity .* is an angle"),
        (lambda: m.assemble_many({"A": ["3 mm", 1.0]}), "is an angle"),
        (lambda: m.simulate("3 m"), "duration is a time"),
        (lambda: m.simulate(1.0, atol="1 mm"), "atol is a number without unit"),
        (lambda: m.compile().with_parameters({"crank.mass": "3 m"}), "crank.mass is a mass"),
    ]:
        with pytest.raises(ArgumentError, match=words):
            call()  # type: ignore[no-untyped-call]


FILE = """
[mechanism]
partita = 1
name = "pendulum"
gravity = [0, {gravity}, 0]

[[rod]]
name = "rod"
start = [0, 0, 0]
end = [{length}, 0, 0]
mass = {mass}

[[joint]]
name = "A"
type = "revolute"
parent = "ground"
child = "rod"
point = [0, 0, 0]

[[torsion_spring]]
joint = "A"
stiffness = {stiffness}
angle = {angle}
"""


def test_model_files_hold_quantities(tmp_path: Path) -> None:
    quantities = {"gravity": '"-981 cm/s^2"', "length": '"250 mm"', "mass": '"2 kg"', "angle": '"30 deg"'}
    plain = {"gravity": "-9.81", "length": "0.25", "mass": "2", "angle": repr(math.radians(30.0))}
    path, other = tmp_path / "said.toml", tmp_path / "plain.toml"
    path.write_text(FILE.format(**quantities, stiffness='"1 N mm/rad"'), encoding="utf-8")
    other.write_text(FILE.format(**plain, stiffness="0.001"), encoding="utf-8")
    assert spec(pt.load(path)) == spec(pt.load(other))
    for words, changed in [
        ("line 11: mass must be a number or text that begins with one and ends with its unit", {"mass": '"heavy"'}),
        ("line 7: body \"rod\": mass is a mass .kg.; '2 m' is a length", {"mass": '"2 m"'}),
        ("no unit 'kgg'", {"mass": '"2 kgg"'}),
    ]:
        path.write_text(FILE.format(**{**quantities, **changed}, stiffness="1"), encoding="utf-8")
        with pytest.raises(FileFormatError, match=words):
            pt.load(path)


def test_the_command_line_takes_quantities(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from partita.cli import main
    from partita.results import load_result

    run = tmp_path / "run.json"
    start = ["--target", "A=40 deg", "--rate", "A=60rpm", "--outputs", "3", "--quiet"]
    assert main(["simulate", "four-bar", "--time", "100 ms", *start, "--save", str(run)]) == 0
    m = pt.catalogue.load("four-bar")
    options = pt.catalogue.entry("four-bar").options
    near = pt.catalogue.entry("four-bar").initial(m)
    state = m.assemble({"A": math.radians(40.0)}, {"A": 60 * units.rpm}, near)
    here = m.simulate(0.1, initial=state, t_eval=[0.0, 0.05, 0.1], **options)
    assert load_result(run).q.tolist() == here.q.tolist()
    for words, reported in [
        (["--time", "3 m"], "is a length"),
        (["--time", "1 s", "--target", "A=3 mm"], "is an angle"),
        (["--time", "1 s", "--rate", "A=3 furlongs"], "no unit 'furlongs'"),
    ]:
        try:
            code: Any = main(["simulate", "four-bar", *words])
        except SystemExit as end:  # the parser reports a misuse
            code = end.code
        assert code != 0 and reported in capsys.readouterr().err


def test_numbers_and_quantities_of_one_text() -> None:
    found = quantity_of("2.5e3 N/mm")
    assert (found.number, found.named) == (2500, True) and found.unit.size == 1000
