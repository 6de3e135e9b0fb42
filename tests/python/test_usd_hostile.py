"""Files of USD that are broken, or ask for more than they may: a typed error with the file and the prim, no crash."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest
from usd_files import SCENE, at, body, drive, four_bar, joint, points, prim, put, usd

import partita as pt
from partita import limits
from partita.io import usd_scan, usd_stage

pytest.importorskip("pxr", reason="usd-core is an extra")


def refused(path: Path, words: str, line: int | None = None, **asked: object) -> str:
    with pytest.raises(pt.errors.FileFormatError) as reported:
        pt.load(path, **asked)
    message = str(reported.value)
    assert words in message and str(path) in message and "\n" not in message, message
    assert reported.value.line == line
    return message


def test_what_is_not_usd(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    refused(put(tmp_path, ""), "it is empty")
    refused(put(tmp_path, "<robot/>"), "neither text nor binary USD: it begins with b'<robot/>'")
    refused(put(tmp_path, "PK\x03\x04"), "zip archive")
    refused(put(tmp_path, "version https://git-lfs"), "Git LFS pointer")
    refused(put(tmp_path, "#usda 1.0\n(\n  oops oops\n)\n"), "USD cannot read it", 3)
    refused(put(tmp_path, "#usda 9.0\n"), "USD cannot read it", 1)
    refused(put(tmp_path, "PXR-USDC and no more", "a.usdc"), "USD cannot read it")
    (tmp_path / "noise.usd").write_bytes(b"PXR-USDC" + random.Random(1).randbytes(5000))
    refused(tmp_path / "noise.usd", "USD cannot open noise.usd")
    with (tmp_path / "large.usda").open("wb") as file:
        file.write(b"#usda 1.0\n")
        file.truncate(2**33)
    refused(tmp_path / "large.usda", "8589934592 bytes, more than the limit of 67108864")
    with pytest.raises(pt.errors.MissingFileError):
        pt.load(tmp_path / "nowhere.usda")
    assert capfd.readouterr() == ("", "")


NESTED = {
    "prims": ('def "a"\n{\n', "}\n"),
    "dictionaries": ("dictionary d = {", "}"),
    "tuples": ("(", ")"),
    "lists": ("[", "]"),
}


@pytest.mark.parametrize("what", NESTED)
def test_depth_is_bounded(what: str, tmp_path: Path) -> None:
    opens, closes = NESTED[what]
    inside = f"{opens * 30_000}{closes * 30_000}"
    text = inside if what == "prims" else f'def "a" (customData = {{ int x = {inside} }})\n{{}}\n'
    refused(put(tmp_path, f"#usda 1.0\n{text}"), "levels, more than the limit of 512")
    # brackets in a comment, in a text or in the name of a file are none
    hidden = "(" * 3000
    text = four_bar().replace("def ", f"# {hidden}\ndef ", 1)
    assert f"# {hidden}" in text
    assert pt.load(put(tmp_path, text)).bodies
    apart = f"\"{hidden}\" '''{hidden}''' @{hidden}@ ((".encode()
    assert usd_scan.check_text(apart) is None
    with limits.raised(depth=1):
        assert (usd_scan.check_text(apart) or "").startswith("nests 2 levels")
    with limits.raised(texts=2):
        assert (usd_scan.check_text(apart) or "").startswith("has 3 texts and comments")


def test_count_is_bounded(tmp_path: Path) -> None:
    path = put(tmp_path, four_bar())
    with limits.raised(prims=3):
        refused(path, "4 prims, more than the limit of 3; partita.limits.raised(prims=4) allows as many")


def doubled(arc: str, levels: int) -> str:
    """Each prim has two children that are the one before it."""
    one = 'def Xform "p{}"\n{{\n  def "a" ({})\n  {{}}\n  def "b" ({})\n  {{}}\n}}\n'
    of = [f"prepend {arc} = </p{i - 1}>" if i else "" for i in range(levels)]
    return "#usda 1.0\n" + "".join(one.format(i, x, x) for i, x in enumerate(of))


@pytest.mark.parametrize("arc", ["references", "payload", "inherits", "specializes"])
def test_doubled_arcs_are_counted_before_usd_composes(arc: str, tmp_path: Path) -> None:
    path = put(tmp_path, doubled(arc, 17))
    assert path.stat().st_size < 3000
    refused(path, "more than the limit of")
    small = put(tmp_path, doubled(arc, 5), "small.usda")
    with limits.raised(composed=10):
        refused(small, "more than the limit of 10; partita.limits.raised(composed=")
    loaded = pt.load(small, base="fixed")
    assert loaded is not None


def test_a_binary_file_that_breaks_usd_breaks_another_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pxr import Sdf

    path = tmp_path / "a.usdc"
    Sdf.Layer.FindOrOpen(str(put(tmp_path, four_bar()))).Export(str(path))
    monkeypatch.setattr(usd_stage, "_ALONE", "import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)")
    if os.name == "posix":
        refused(path, "USD breaks down reading a.usdc: the file is damaged, or too large")
    monkeypatch.setattr(usd_stage, "_ALONE", "import time\ntime.sleep(60)")
    monkeypatch.setattr(usd_stage, "_PATIENCE", 0.2)
    refused(path, "does not end reading a.usdc, within 0.2 s")


def test_layers_that_are_missing_circular_or_outside(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    inside = tmp_path / "model"
    inside.mkdir()
    outside = put(tmp_path, '#usda 1.0\n(defaultPrim = "A")\n' + body("A"), "outside.usda")

    def asking(name: str, arc: str = "references") -> Path:
        return put(inside, usd(prim("Xform", "x", more=f"prepend {arc} = @{name}@")))

    refused(asking("none.usda"), 'the layer "none.usda", which stage.usda names, is not read: there is no such file')
    for name in ("../outside.usda", str(outside)):
        refused(asking(name), "lies outside")
    assert [*pt.load(asking("../outside.usda"), root=tmp_path).bodies] == ["x"]
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "stage.usda").symlink_to(asking("part.usda"))
    put(tmp_path / "other", '#usda 1.0\n(defaultPrim = "A")\n' + body("A", mass=9.0), "part.usda")
    assert pt.load(tmp_path / "other" / "stage.usda").bodies["x"].mass == 9.0
    (inside / "link.usda").symlink_to(outside)
    refused(asking("link.usda"), "lies outside")
    refused(asking("https://example.org/a.usda", "payload"), "nothing is downloaded")
    refused(asking("a.usdz"), "is not read: read are .usda, .usd, .usdc")
    refused(asking("`${NAME}.usda`"), "is not read")
    refused(asking("./stage.usda"), "do not fit together")
    refused(put(inside, usd(prim("Xform", "x", more="prepend references = </World/y>"))), "do not fit together")
    one = "#usda 1.0\n(subLayers = [@./{}@])\n"
    put(inside, one.format("one.usda"), "two.usda")
    refused(put(inside, one.format("two.usda"), "one.usda"), "do not fit together")
    put(inside, "garbage", "none.usda")
    refused(asking("none.usda"), "its layer none.usda is neither text nor binary")
    assert capfd.readouterr() == ("", "")


def locked(low: float, high: float, *axes: str) -> str:
    """A joint with these limits."""
    lines = [f"float limit:{x}:physics:low = {low}\nfloat limit:{x}:physics:high = {high}" for x in axes]
    return joint("Joint", "J", ("", "a"), *lines, schemas=" ".join(f"PhysicsLimitAPI:{x}" for x in axes))


def mesh(line: str, corners: str, counts: str, faces: str) -> str:
    """A body with a mesh."""
    lines = (
        line,
        f"point3f[] points = {corners}",
        f"int[] faceVertexCounts = {counts}",
        f"int[] faceVertexIndices = {faces}",
    )
    shape = prim("Mesh", "s", *lines, schemas="PhysicsCollisionAPI PhysicsMeshCollisionAPI")
    return prim("Xform", "a", shape, schemas="PhysicsRigidBodyAPI")


HOSTILE = {
    "a mass that is no number": (body("a", mass=float("nan")), "physics:mass nan; it takes a number"),
    "an infinite mass": (body("a", mass=float("inf")), "takes finite numbers"),
    "a negative mass": (body("a", mass=-1.0), "has the mass -1"),
    "no mass": (prim("Xform", "a", schemas="PhysicsRigidBodyAPI"), 'Xform "/World/a" has no mass'),
    "no inertia": (
        prim("Xform", "a", "float physics:mass = 1", schemas="PhysicsRigidBodyAPI PhysicsMassAPI"),
        "has no inertia, and no shape that collides",
    ),
    "a shape that is approximated": (
        mesh('uniform token physics:approximation = "boundingSphere"', "[(0,0,0)]", "[1]", "[0]"),
        'approximation "boundingSphere", whose size each program chooses',
    ),
    "a mesh that is open": (mesh("", "[(0,0,0), (1,0,0), (0,1,0)]", "[3]", "[0, 1, 2]"), "is open, or its faces"),
    "a flat mesh": (
        mesh("", "[(0,0,0), (1,0,0), (0,1,0)]", "[3, 3]", "[0, 1, 2, 0, 2, 1]"),
        "has no mass, and no shape that collides",
    ),
    "a mesh that is none": (mesh("", "[(0,0,0)]", "[3]", "[0, 1, 2]"), "is not a mesh"),
    "a place that is no number": (body("a", at(float("inf"), 0, 0)), "a transform that is not finite"),
    "an odd transform": (
        body("a", 'uniform token[] xformOpOrder = ["xformOp:nothing"]'),
        '"/World/a" has transforms that USD cannot read: Invalid xform opType',
    ),
    "no size": (body("a", at(0, 0, 0, "float3 xformOp:scale = (0, 1, 1)")), "has no size"),
    "a reflection": (body("a", at(0, 0, 0, "float3 xformOp:scale = (-1, 1, 1)")), "sheared or reflected"),
    "a joint of nothing": (body("a") + joint("FixedJoint", "J", ("a", "b")), "joins /World/b (physics:body1)"),
    "two bodies on a side": (
        body("a") + joint("FixedJoint", "J", ("a", ""), "rel physics:body1 = [</World/a>, </World/b>]"),
        "has 2 targets of physics:body1",
    ),
    "an axis": (
        body("a") + joint("RevoluteJoint", "J", ("", "a"), 'uniform token physics:axis = "W"'),
        'PhysicsRevoluteJoint "/World/J" has the physics:axis "W"; it is X, Y or Z',
    ),
    "no rotation": (
        body("a") + joint("FixedJoint", "J", ("", "a"), "quatf physics:localRot0 = (0, 0, 0, 0)"),
        "physics:localRot0 0 0 0 0, which is no rotation",
    ),
    "a point": (
        body("a") + joint("FixedJoint", "J", ("", "a"), points("(nan, 0, 0)", "(0, 0, 0)")),
        "has physics:localPos0 nan 0 0; it takes 3 numbers",
    ),
    "a drive": (
        body("a") + joint("RevoluteJoint", "J", ("", "a"), drive("angular", stiffness="inf"),
                          schemas="PhysicsDriveAPI:angular"),
        "drive:angular:physics:stiffness inf; it takes finite numbers",
    ),
    "a rotor": (
        body("a") + joint("RevoluteJoint", "J", ("", "a"), "float physxJoint:armature = -1", schemas="PhysxJointAPI"),
        'PhysicsRevoluteJoint "/World/J" cannot act so',
    ),
    "no distance": (
        body("a") + joint("DistanceJoint", "J", ("", "a"), "float physics:minDistance = 0",
                          "float physics:maxDistance = 0"),
        "use PhysicsSphericalJoint",
    ),
    "two swings": (
        body("a") + locked(1, -1, "transX", "transY", "transZ", "rotX"),
        "leaves ry and rz free and locks rx",
    ),
    "two turns beside slides": (
        body("a") + locked(0, 0, "rotX"),
        "two rotations beside slides have no order",
    ),
    "locked away from zero": (
        body("a") + locked(9, 9, "rotX"),
        "locks rotX at 9",
    ),
    "gravity": (prim("PhysicsScene", "g", "float physics:gravityMagnitude = inf"), "an infinite physics:gravity"),
    "value clips": (
        'def Xform "a" (clips = { dictionary default = { string primPath = "/a" } })\n{\n}\n',
        "has value clips",
    ),
    "repeated bodies": (
        prim("PointInstancer", "p", "int[] protoIndices = [0, 0]", "point3f[] positions = [(0, 0, 0), (1, 0, 0)]",
             "rel prototypes = </World/p/a>", body("a")),
        "a body that a PointInstancer repeats",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_a_prim_that_is_wrong_is_named(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    part, words = HOSTILE[name]
    message = refused(put(tmp_path, usd(part)), words)
    assert "/World/" in message
    assert capfd.readouterr() == ("", "")


def test_units_that_are_none(tmp_path: Path) -> None:
    refused(put(tmp_path, usd(body("a"), metersPerUnit="0")), "the stage has metersPerUnit 0; it is positive")
    refused(put(tmp_path, usd(body("a"), kilogramsPerUnit="nan")), "the stage has kilogramsPerUnit nan")
    refused(put(tmp_path, usd(body("a"), upAxis='"W"')), 'has the upAxis "W"')


def test_what_usd_warns_of_is_a_remark(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    shape = prim("Cube", "s", "rel material:binding = </World/none>", schemas="PhysicsCollisionAPI")
    m = pt.load(put(tmp_path, usd(SCENE, prim("Xform", "a", shape, schemas="PhysicsRigidBodyAPI"))))
    assert "USD says: Found material bindings" in str(m.reading) and capfd.readouterr() == ("", "")


def test_a_file_is_read_as_it_is_on_disk(tmp_path: Path) -> None:
    """USD keeps layers as long as something uses them; a change that is not stored is the user's."""
    from pxr import Sdf

    path = put(tmp_path, usd(SCENE, body("a", mass=1.0)))
    held = Sdf.Layer.FindOrOpen(str(path))
    put(tmp_path, usd(SCENE, body("a", mass=2.0)))
    assert pt.load(path).bodies["a"].mass == 2.0
    held.GetAttributeAtPath("/World/a.physics:mass").default = 3.0
    m = pt.load(path)
    assert m.bodies["a"].mass == 3.0 and "changes that are not stored" in str(m.reading)


def test_values_of_another_type(tmp_path: Path) -> None:
    text = usd(SCENE, body("a")).replace("float physics:mass = 1.0", 'string physics:mass = "much"')
    refused(put(tmp_path, text), "physics:mass much; it takes a number")


def test_loops_belong_to_urdf(tmp_path: Path) -> None:
    with pytest.raises(pt.errors.ArgumentError, match="USD states its own"):
        pt.load(put(tmp_path, four_bar()), loops="loops.yaml")


def test_without_the_extra_the_reader_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "pxr.Usd", None)
    with pytest.raises(pt.errors.MissingDependencyError, match=r"needs pxr, .* pip install 'partita\[usd\]'"):
        pt.load(put(tmp_path, four_bar()))
