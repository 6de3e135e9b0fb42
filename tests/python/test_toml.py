"""Model files: what is written is read back to the last bit, what is wrong is reported with its line."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from thorough import either

import partita as pt
from partita import _core
from partita.errors import DescriptionError, FileFormatError, MissingFileError
from partita.io import schema, toml
from partita.io.toml_writer import document

HEAD = '[mechanism]\npartita = 1\nname = "m"\n'
ROD = '[[rod]]\nname = "rod"\nstart = [0, 0, 0]\nend = [1, 0, 0]\nmass = 1\n'
HINGE = '[[joint]]\nname = "A"\ntype = "revolute"\nparent = "ground"\nchild = "rod"\npoint = [0, 0, 0]\n'


def everything() -> pt.Mechanism:
    """Every kind of element with every option that a file can hold."""
    m = pt.Mechanism('all "kinds" \\ é', gravity=(0.1, -9.81, 1e-17))
    plate = m.add_body(
        "plate",
        mass=2.5,
        inertia=[[1.0, 0.1, 0], [0.1, 1.2, 0], [0, 0, 1.3]],
        com=(0.1, 0, 0),
        position=(1 / 3, 2, 3),
        orientation=Rotation.from_rotvec([0.1, 0.2, 0.3]),
    )
    rod = m.add_rod("rod", start=(0, 0, 0), end=(0.1, 0.7, 0.3), mass=0.3)
    point = m.add_body("point", mass=1.0, inertia=(0, 0, 0), position=(0, 1, 0))
    m.add_revolute("A", m.ground, rod, (0, 0, 0), axis=(0, 1, 3), child_point=(0, 0, 0.01), child_axis=(0, 1, 3.1))
    m.add_prismatic("B", rod, plate, axis=(1, 1, 0), cut="always")
    m.add_cylindrical("C", plate, m.ground, (1, 2, 3), cut="never")
    m.add_spherical("D", rod, plate, (0, 0, 1), child_point=(0, 0.1, 1))
    m.add_universal("E", rod, plate, (0, 0, 1), axis1=(0, 0, 2), axis2=(3, 4, 0))
    m.add_planar("F", m.ground, point, normal=(0, 0, -1))
    m.add_fixed("G", m.ground, plate, (1, 1, 1))
    m.add_free("H", m.ground, point)
    m.add_joint("I", m.ground, point, free=("rz", "x"), frame=Rotation.from_rotvec([0, 0, 0.5]), point=(0, 1, 0))
    m.add_joint("J", m.ground, point, free=())
    m.add_drive("B", 0.25)
    times = np.linspace(0.0, 3.0, 40)
    m.add_drive("C", (times, np.sin(times) / 3), coordinate=1, name="turn")
    m.add_torque("A", ([0.0, 0.1, 2.0], [0.0, 1 / 3, 1.0]))
    m.add_spring("S", m.ground, (5, 0, 0), rod, (0.1, 0, 0), stiffness=100.0)
    m.add_spring("T", plate, (0, 0, 0.1), rod, (0.1, 0, 0), stiffness=1e-300, damping=2.0, length=1e9)
    m.add_torsion_spring("C", stiffness=3.0, damping=0.1, angle=0.2, coordinate=1)
    m.add_torque("C", -2.0, coordinate=1, name="motor")
    m.add_force(plate, (0.0, ([0.0, 1.0], [1.0, 2.0]), 3.0), point=(0, 0, 1), axes="body")
    m.add_force(rod, (0.0, -1.5, 0.0))
    return m


def test_round_trip_to_the_last_bit(tmp_path: Path) -> None:
    m = everything()
    path = tmp_path / "all.toml"
    m.save(path)
    again = pt.load(path)
    assert again.to_spec() == m.to_spec()
    assert document(again) == document(m)


def test_order_of_the_file_is_the_order_of_the_mechanism() -> None:
    names = toml.parse(document(everything()), pt.Mechanism)
    assert tuple(names.bodies) == ("plate", "rod", "point")
    assert list(names.forces) == list(everything().forces)


def test_saved_files_satisfy_the_published_schema() -> None:
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft202012Validator.check_schema(schema.load())
    content = json.loads(_core.parse_toml(document(everything()), "all.toml")[0])
    jsonschema.Draft202012Validator(schema.load()).validate(content)


def test_every_key_of_the_schema_is_described() -> None:
    def visit(rule: Any, where: str) -> None:
        if isinstance(rule, dict):
            for key, value in rule.get("properties", {}).items():
                assert value.get("description"), f"{where}/{key} has no description"
            for key, value in rule.items():
                visit(value, f"{where}/{key}")
        elif isinstance(rule, list):
            for item in rule:
                visit(item, where)

    visit(schema.load(), "")


def test_every_key_of_the_schema_is_an_argument_of_its_method() -> None:
    """The schema is the only list of keys; a key that the builder does not know would be found here."""
    import inspect

    rules = schema.load()
    for kind, rule in rules["properties"].items():
        if kind in ("mechanism", "joint"):
            continue
        parameters = inspect.signature(getattr(pt.Mechanism, f"add_{kind}")).parameters
        assert set(rule["items"]["properties"]) <= set(parameters), kind
        needed = {name for name, p in parameters.items() if p.default is p.empty and name != "self"}
        assert needed <= set(rule["items"]["required"]), kind
    for form in rules["properties"]["joint"]["items"]["oneOf"]:
        kind = form["$ref"].rpartition("/")[2]
        method = "add_joint" if kind == "generic" else f"add_{kind}"
        parameters = inspect.signature(getattr(pt.Mechanism, method)).parameters
        assert set(rules["$defs"][kind]["properties"]) - {"type"} == set(parameters) - {"self"}, kind


def test_our_check_agrees_with_jsonschema() -> None:
    """On single changes of a good file: both accept or both refuse."""
    jsonschema = pytest.importorskip("jsonschema")
    validator = jsonschema.Draft202012Validator(schema.load())
    good = json.loads(_core.parse_toml(document(everything()), "all.toml")[0])

    def changed(value: Any) -> list[Any]:
        """Copies of `value` with one thing replaced or left out."""
        found: list[Any] = [None, True, -3, 1.5, "text", [], [1.0, 2.0, 3.0], {}, {"times": [0, 1], "values": [0, 1]}]
        if isinstance(value, dict):
            for key in value:
                rest = {k: v for k, v in value.items() if k != key}
                found += [rest, *({**rest, key: item} for item in changed(value[key]))]
            found.append({**value, "surprise": 1})
        elif isinstance(value, list) and value:
            found += [[*value, value[0]], value[1:], *([item, *value[1:]] for item in changed(value[0]))]
        return found

    count = 0
    for key, value in good.items():
        items = value if isinstance(value, list) else [value]
        for item in items:
            for other in changed(item)[:: either(3, 1)]:
                content = {"mechanism": good["mechanism"], key: [other] if isinstance(value, list) else other}
                try:
                    schema.check(content)
                    ours = True
                except schema.Mismatch:
                    ours = False
                assert ours == validator.is_valid(content), (key, other)
                count += 1
    assert count > either(400, 1000)


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("[mechanism]\npartita = 1\nname = ", 3, ""),
        ("", None, 'no "mechanism"'),
        ('[mechanism]\nname = "m"\n', 1, 'no "partita"'),
        ('[mechanism]\npartita = 2\nname = "m"\n', 2, "1, the version of this format"),
        (
            HEAD + "gravity = [0, -9.81]\n",
            4,
            "gravity must be three components, each a number or a table, not [0, -9.81]",
        ),
        (
            HEAD + 'gravity = [0, "g", 0]\n',
            4,
            'gravity[1] must be a number or a table { times = [...], values = [...] }, not "g"',
        ),
        (HEAD + "[[bodi]]\n", 4, 'did you mean "body"?'),
        (HEAD + ROD + "lenght = 1\n", 9, '"lenght" is not a key of rod "rod"'),
        (HEAD + ROD.replace("mass = 1", "mas = 1"), 8, 'did you mean "mass"?'),
        (HEAD + ROD.replace("mass = 1\n", ""), 4, 'rod "rod" has no "mass"'),
        (HEAD + ROD.replace("mass = 1", 'mass = "1"'), 8, "mass must be a number"),
        (HEAD + ROD.replace("mass = 1", "mass = true"), 8, "mass must be a number"),
        (HEAD + ROD.replace("mass = 1", "mass = -1"), 8, "at least 0"),
        (HEAD + ROD.replace("end = [1, 0, 0]", "end = [0, 0, 0]"), 4, "same point"),
        (HEAD + ROD + ROD, 9, "already a body"),
        (HEAD + ROD + HINGE.replace('"revolute"', '"revolut"'), 11, 'did you mean "revolute"?'),
        (HEAD + ROD + HINGE.replace('type = "revolute"\n', ""), 9, 'has no "type"'),
        (
            HEAD + ROD + HINGE + "axis1 = [1, 0, 0]\n",
            15,
            '"axis1" is not a key of revolute joint "A"; did you mean "axis"?',
        ),
        (HEAD + ROD + HINGE + "axis = [0, 0, 0]\n", 9, "no direction"),
        (HEAD + ROD + HINGE + 'cut = "no"\n', 15, 'must be one of "auto", "always", "never"'),
        (HEAD + ROD + HINGE.replace('"rod"', '"rood"'), 9, 'did you mean "rod"?'),
        (HEAD + ROD + HINGE + '[[torque]]\njoint = "B"\nvalue = 1\n', 15, 'no joint "B"'),
        (HEAD + ROD + HINGE + '[[torque]]\njoint = "A"\nvalue = [1]\n', 17, "a number or a table"),
        (HEAD + ROD + HINGE + '[[torque]]\njoint = "A"\nvalue = { times = [1, 0], values = [0, 0] }\n', 15, "increase"),
        (HEAD + ROD + HINGE + '[[drive]]\njoint = "A"\nposition = 0\ncoordinate = -1\n', 18, "at least 0"),
        (HEAD + "rod = 3\n", 4, '"rod" is not a key of mechanism'),
    ],
)
def test_what_is_wrong_is_reported_with_its_line(text: str, line: int | None, words: str, tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileFormatError) as caught:
        pt.load(path)
    assert words in str(caught.value)
    assert caught.value.line == line and caught.value.path == str(path)
    assert str(path) in str(caught.value)


def test_what_the_builder_refuses_is_chained() -> None:
    with pytest.raises(FileFormatError) as caught:
        toml.parse(HEAD + ROD + ROD, pt.Mechanism)
    assert isinstance(caught.value.__cause__, DescriptionError)


def test_functions_cannot_be_saved(tmp_path: Path) -> None:
    m = pt.Mechanism("m")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    m.add_torque("A", lambda t, state: 1.0, name="motor")
    with pytest.raises(DescriptionError, match='force "motor": it is a Python function') as caught:
        m.save(tmp_path / "m.toml")
    assert caught.value.name == "motor"
    assert not (tmp_path / "m.toml").exists()


def test_suffixes(tmp_path: Path) -> None:
    m = everything()
    for name in ("m.tom", "m"):
        with pytest.raises(FileFormatError, match=r"written: \.toml"):
            m.save(tmp_path / name)
        with pytest.raises(FileFormatError, match=r"read: \.toml"):
            pt.load(tmp_path / name)
    m.save(tmp_path / "m.TOML")
    assert pt.load(tmp_path / "m.TOML").name == m.name


def test_missing_files_and_folders(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError) as caught:
        pt.load(tmp_path / "none.toml")
    assert caught.value.path == str(tmp_path / "none.toml")
    with pytest.raises(FileNotFoundError, match="make it first"):
        everything().save(tmp_path / "none" / "m.toml")
    (tmp_path / "folder.toml").mkdir()
    with pytest.raises(MissingFileError, match="folder"):
        pt.load(tmp_path / "folder.toml")


def test_bytes_that_are_no_text(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_bytes(b"\xff\xfe[mechanism]")
    with pytest.raises(FileFormatError, match="UTF-8"):
        pt.load(path)
