"""Limits of readers: one table, named in each refusal, compared before anything of that size is read or made."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from test_hostile_files import MJCF, SDF, TOML, URDF, put

import partita as pt
from partita import limits
from partita.errors import ArgumentError, FileFormatError
from partita.files import _MARK, BLANK, sealed

DOCS = Path(__file__).parents[2] / "docs" / "limits.md"
POSIX = sys.platform.startswith("linux")
ROOM = 1_500_000_000
"""Bytes of memory of a process that reads a small file, with all that Python and the libraries take."""


def refused(path: Path, *words: str) -> str:
    with pytest.raises(FileFormatError) as caught:
        pt.load(path)
    message = caught.value.message
    assert all(word in message for word in words) and len(message) < 700, message
    return message


def alone(program: str) -> str:
    """What a program prints that reads a file in little memory, in a process that may not take more."""
    bound = f"import resource\nresource.setrlimit(resource.RLIMIT_AS, ({ROOM}, {ROOM}))\n" if POSIX else ""
    done = subprocess.run(
        [sys.executable, "-c", f"import partita as pt\n{bound}{program}"], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


LOAD = """
try:
    {call}
    print("read")
except pt.errors.FileFormatError as error:
    print(error.message)
"""


def test_the_page_lists_the_table() -> None:
    listed = re.findall(r"^\| `(\w+)` \| ([\d ]+) (\D[^|]*) \| ([^|]+) \|$", DOCS.read_text("utf-8"), re.MULTILINE)
    assert {name: (int(value.replace(" ", "")), unit, of) for name, value, unit, of in listed} == {
        x.name: (x.value, x.unit, x.of) for x in limits.TABLE.values()
    }


def test_limits_are_raised_for_some_calls_or_for_a_process(monkeypatch: pytest.MonkeyPatch) -> None:
    with limits.raised(depth=7), limits.raised(elements=3):
        assert (limits.limit("depth"), limits.limit("elements")) == (7, 3)
    assert limits.limit("depth") == limits.TABLE["depth"].value
    monkeypatch.setattr(limits, "_PROCESS", "depth=9, model_bytes = 1_000")
    assert (limits.limit("depth"), limits.limit("model_bytes")) == (9, 1000)
    with limits.raised(depth=8):
        assert limits.limit("depth") == 8
    for text, words in (("deep=3", "no limit 'deep'"), ("depth=x", "positive integer"), ("depth", "positive integer")):
        monkeypatch.setattr(limits, "_PROCESS", text)
        with pytest.raises(ArgumentError, match=words):
            limits.limit("depth")
    for wrong in (0, -1, True, 1.5, "9", None):
        with pytest.raises(ArgumentError, match="depth"), limits.raised(depth=wrong):  # type: ignore[arg-type]
            pass


def test_the_environment_raises_limits_of_a_process() -> None:
    asked = "import partita as pt; print(pt.limits.limit('depth'), pt.limits.limit('files'))"
    environment = {**os.environ, limits.VARIABLE: "depth=9"}
    found = subprocess.run([sys.executable, "-c", asked], env=environment, capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["9", str(limits.TABLE["files"].value)]


@pytest.mark.parametrize("suffix", [".urdf", ".sdf", ".mjcf", ".toml", ".usda", ".json", ".csv", ".mat", ".nc"])
def test_the_size_of_a_file_is_looked_at_before_it_is_read(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"sparse{suffix}"
    with path.open("wb") as file:
        file.truncate(2**33)
    call = f"pt.load_result({str(path)!r})" if suffix in (".json", ".csv", ".mat", ".nc") else f"pt.load({str(path)!r})"
    assert "8589934592 bytes, more than the limit of" in alone(LOAD.format(call=call))


def test_xml_takes_time_and_memory_in_proportion(tmp_path: Path) -> None:
    """Beginnings of comments without ends, and text in many short lines."""
    refused(put(tmp_path, "a.urdf", '<robot name="r">' + 100_000 * "<!--"), "not well-formed")
    path = put(tmp_path, "b.urdf", URDF.replace("</robot>", "a\n" * 4_000_000 + "</robot>"))
    assert alone(LOAD.format(call=f"pt.load({str(path)!r})")) == "read\n"


def test_messages_do_not_repeat_what_is_long(tmp_path: Path) -> None:
    long = 3_000_000 * "1"
    for name, text in (
        ("a.urdf", URDF.replace('mass value="1"', f'mass value="{long}x"')),
        ("b.urdf", URDF.replace('link name="a"', f'link name="{long}"')),
        ("c.sdf", SDF.replace("<mass>1<", f"<mass>{long}x<")),
        ("d.toml", TOML.replace('"revolute"', f'"{long}"')),
        ("e.toml", TOML.replace("mass =", f"{long} =")),
        ("f.toml", TOML.replace('"ground"', f'"{long}"')),
        ("g.urdf", URDF.replace("<robot", f"<{long}x")),
    ):
        refused(put(tmp_path, name, text.replace("<1", "<x").replace("</robot>", "</robot>")))
    error = ArgumentError(f"a {'b' * 9000} {'c ' * 9000}", argument="x")
    assert len(error.message) < 5000 and error.message.startswith("a bbb") and " ... " in error.message


def test_toml_is_counted_before_it_is_parsed(tmp_path: Path) -> None:
    for text in (
        "a=1\n" * 250_000,
        "x=[" + "1," * 450_000,
        "a" + ".a" * 450_000 + "=1",
        "#\n" * 450_000,
        "[" * 450_000,
    ):
        refused(put(tmp_path, "a.toml", text), "marks, more than the limit of 400000", "partita.limits.raised(marks=")
    numbers = ", ".join(f"{i}.5" for i in range(100_000))  # points of numbers do not count
    text = TOML + f'[[drive]]\njoint = "A"\nposition = {{times = [{numbers}], values = [{numbers}]}}\n'
    m = pt.load(put(tmp_path, "b.toml", text))
    assert len(m.drives) == 1
    with limits.raised(marks=100):
        refused(put(tmp_path, "c.toml", text), "more than the limit of 100")


BALL = '<body><joint/><geom size="1"/></body>'
GROWING = {
    "replicate": f'<replicate count="100000" offset="0 0 1">{BALL}</replicate>',
    "nested replicate": f'<replicate count="400"><replicate count="400">{BALL}</replicate></replicate>',
    "composite": '<body><composite type="cable" count="900000 1 1" size="1"><geom size=".1"/></composite></body>',
}
ASKING = {
    "height field": '<asset><hfield name="h" nrow="200000" ncol="200000" size="1 1 1 1"/></asset>',
    "keys": '<size nkey="2000000000"/>',
    "user data": '<size nuserdata="2000000000"/>',
    "numbers of each body": '<size nuser_body="2000000000"/>',
    "number": '<custom><numeric name="n" size="2000000000"/></custom>',
}


@pytest.mark.parametrize("what", [*GROWING, *ASKING])
def test_mjcf_is_counted_as_expanded_before_mujoco_makes_it(what: str, tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    text = MJCF.replace("</worldbody>", GROWING.get(what, "") + "</worldbody>")
    text = text.replace("<worldbody>", ASKING.get(what, "") + "<worldbody>")
    refused(put(tmp_path, "a.mjcf", text), "more than the limit of", "partita.limits.raised(")


def test_textures_of_mjcf_take_no_memory(tmp_path: Path) -> None:
    """Skies of files in use ask for some ten million numbers; none is made, however large."""
    pytest.importorskip("mujoco")
    sky = '<asset><texture type="skybox" builtin="gradient" width="500000" height="500000"/></asset><worldbody>'
    assert len(pt.load(put(tmp_path, "a.mjcf", MJCF.replace("<worldbody>", sky))).bodies) == 1


def test_repetitions_within_the_limits_are_read(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    more = '<replicate count="3" offset="0 0 1"><body><joint/><geom size="1"/></body></replicate>'
    path = put(tmp_path, "a.mjcf", MJCF.replace("</worldbody>", f"{more}</worldbody>"))
    assert len(pt.load(path).bodies) == 4
    with limits.raised(bodies=3):
        refused(path, "4 bodies after repetitions, more than the limit of 3")


@pytest.mark.parametrize("number", ["inf", "-inf", "nan", "1e308", "-1e200", "1e400"])
@pytest.mark.parametrize(
    "attribute",
    [
        "pos",
        "quat",
        "axisangle",
        "euler",
        "xyaxes",
        "zaxis",
        "mass",
        "diaginertia",
        "size",
        "axis",
        "stiffness",
        "gear",
    ],
)
def test_every_vector_of_mjcf_is_finite_and_of_a_size(attribute: str, number: str, tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    counts = {"pos": 3, "quat": 4, "axisangle": 4, "euler": 3, "xyaxes": 6, "zaxis": 3, "diaginertia": 3, "axis": 3}
    value = " ".join([number, *["1"] * (counts.get(attribute, 1) - 1)])
    body, joint, inertia, geom, motor = "", "", 'mass="1" diaginertia="1 1 1"', 'size="1"', 'gear="1"'
    if attribute in ("pos", "quat", "axisangle", "euler", "xyaxes", "zaxis"):
        body = f'{attribute}="{value}"'
    elif attribute in ("axis", "stiffness"):
        joint = f'{attribute}="{value}"'
    elif attribute in ("mass", "diaginertia"):
        inertia = inertia.replace(f'{attribute}="1', f'{attribute}="{number}')
    elif attribute == "size":
        geom = f'size="{value}"'
    else:
        motor = f'gear="{value}"'
    text = f"""<mujoco><worldbody><body name="a" {body}><joint name="j" {joint}/><geom {geom}/>
<inertial pos="0 0 0" {inertia}/></body></worldbody><actuator><motor joint="j" {motor}/></actuator></mujoco>"""
    refused(put(tmp_path, "a.mjcf", text), attribute)


def test_products_of_mjcf_that_leave_the_range_and_directions_without_length(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    begin = '<mujoco><worldbody><body name="a"><joint/>'
    refused(put(tmp_path, "a.mjcf", f'{begin}<geom size="1e59" mass="1e59"/></body></worldbody></mujoco>'), "too large")
    text = f'{begin}<geom size="1"/></body></worldbody></mujoco>'.replace('name="a"', 'name="a" quat="3e-320 0 0 0"')
    refused(put(tmp_path, "b.mjcf", text), 'body "a": body_quat as MuJoCo compiled it', "no direction")


def test_bounds_of_mjcf_may_be_infinite(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    text = MJCF.replace('type="hinge"', 'type="hinge" limited="true" range="-inf 1e300"')
    assert [*pt.load(put(tmp_path, "a.mjcf", text)).joints] == ["j"]


@pytest.mark.parametrize(
    ("actuators", "rotors"),
    [
        ('<orientation joint="b" kp="5"/><motor joint="k" gear="3" armature="0.2"/>', {"k": 0.01 + 9 * 0.2}),
        (
            '<dcmotor joint="h" input="pos vel" controller="0 0 5" motorconst=".4" resistance="1.3"/>'
            '<motor joint="k" gear="3" armature="0.2"/>',
            {"k": 0.01 + 9 * 0.2},
        ),
        (
            '<motor joint="h" gear="2" armature="0.5"/><orientation joint="b" kp="5"/>'
            '<motor joint="k" armature="0.2"/>',
            {"h": 4 * 0.5, "k": 0.01 + 0.2},
        ),
    ],
)
def test_actuators_with_several_controls(actuators: str, rotors: dict[str, float], tmp_path: Path) -> None:
    """Arrays have a row for each actuator, or for each of its outputs; armature stays on its own joint."""
    mujoco = pytest.importorskip("mujoco")
    if not hasattr(mujoco.MjModel, "nactuator"):
        pytest.skip("every actuator of this version has one control")
    geom = '<geom size="0.1" mass="1"/>'
    text = f"""<mujoco><worldbody><body name="x"><joint name="h" axis="0 1 0"/>{geom}
<body name="y" pos="1 0 0"><joint name="b" type="ball"/>{geom}
<body name="z" pos="1 0 0"><joint name="k" axis="0 1 0" armature="0.01"/>{geom}</body></body></body></worldbody>
<actuator>{actuators}</actuator></mujoco>"""
    m = pt.load(put(tmp_path, "a.mjcf", text))
    found = {rotor.name.removeprefix("rotor of "): rotor.inertia for rotor in m._description.rotors.values()}
    assert found == pytest.approx(rotors)


def a_run() -> pt.Result:
    return pt.catalogue.load("four-bar").simulate(0.1, t_eval=[0.0, 0.1])


def resealed(path: Path, change: Callable[[bytes], bytes]) -> None:
    content = change(path.read_bytes())
    mark = _MARK.search(content)
    assert mark is not None
    path.write_bytes(sealed(content[: mark.start()] + BLANK.encode() + content[mark.end() :]))


def test_a_stored_result_takes_no_more_memory_than_its_size_allows(tmp_path: Path) -> None:
    """Text of empty lists, an array that a header claims, a compressed array of zeros."""
    (tmp_path / "a.json").write_text("[" + "[]," * 3_000_000, "utf-8")
    (tmp_path / "a.csv").write_text(f"{'x,' * 6_000_000}\n", "utf-8")
    for name, words in (("a.json", "its entries take"), ("a.csv", "longest line")):
        path = str(tmp_path / name)
        seal = "" if name == "a.json" else "pt.results.load._check_seal = lambda *_: None\n"
        found = alone("import partita.results.load\n" + seal + LOAD.format(call=f"pt.load_result({path!r})"))
        assert words in found and "partita.limits.raised(unpacked_bytes=" in found, found
    path = a_run().save(tmp_path / "run.mat")

    def longer(content: bytes) -> bytes:
        body = b"\x0e\x00\x00\x00" + (2**28).to_bytes(4, "little") + bytes(2**28)
        packed = zlib.compress(body, 9)
        return content + b"\x0f\x00\x00\x00" + len(packed).to_bytes(4, "little") + packed

    resealed(path, longer)
    with pytest.raises(FileFormatError, match=r"unpacked, take .* more than"):
        pt.load_result(path)


@pytest.mark.parametrize("suffix", [".json", ".csv"])
def test_an_array_that_is_not_there_takes_no_memory(suffix: str, tmp_path: Path) -> None:
    path = a_run().save(tmp_path / f"run{suffix}")
    document: dict[str, Any] = {}
    if suffix == ".json":
        document = json.loads(path.read_text("utf-8"))
        document["arrays"]["t"]["shape"] = [10**15]
        document["checksum"] = BLANK
        path.write_bytes(sealed(json.dumps(document).encode()))
        words = "entries instead of"
    else:
        resealed(path, lambda content: content.replace(b'""shape"":[2]', b'""shape"":[999999999999]', 1))
        words = "its arrays take"
    with pytest.raises(FileFormatError, match=words):
        pt.load_result(path)


def test_gravity_of_a_rod_is_yes_or_no(tmp_path: Path) -> None:
    for value in ('"no"', "1", "[true]", "0.0"):
        text = TOML.replace("mass = 1.0", f"mass = 1.0\ngravity = {value}")
        refused(put(tmp_path, "a.toml", text), "line 9", f"gravity must be one of true, false, not {value}")
    pt.load(put(tmp_path, "a.toml", TOML.replace("mass = 1.0", "mass = 1.0\ngravity = false")))
