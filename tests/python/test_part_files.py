"""Bodies whose form is a file: closed meshes against closed forms, what is refused, files and stored runs of them."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita import shapes
from partita.errors import ArgumentError, ChangedFileWarning, DescriptionError, FileFormatError, MissingFileError
from partita.shapes import Box, Cylinder, Disc, Mesh, Sphere
from partita.shapes.triangles import MOST_TRIANGLES, load
from partita.viewer.scene import describe

pytest.importorskip("trimesh")

Array = Any
EXACT = 1e-12
CORNERS = [(x, y, z) for x in (-15.0, 15.0) for y in (-10.0, 10.0) for z in (-5.0, 5.0)]
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
"""Of a box of 30 x 20 x 10, in order around the outward normal."""


def obj(path: Path, corners: Array, faces: Array) -> Path:
    """A mesh in Wavefront's format, with all digits."""
    lines = ["v " + " ".join(repr(float(x)) for x in corner) for corner in corners]
    lines += ["f " + " ".join(str(int(i) + 1) for i in face) for face in faces]
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path


def triangles(sides: Array) -> list[tuple[int, int, int]]:
    return [three for a, b, c, d in sides for three in ((a, b, c), (a, c, d))]


def box(path: Path, faces: Array = None, corners: Array = None) -> Path:
    return obj(path, CORNERS if corners is None else corners, triangles(SIDES) if faces is None else faces)


def ball(path: Path, rows: int) -> Path:
    """Rings of latitude on the unit sphere."""
    polar = np.pi * np.arange(1, rows) / rows
    around = 2.0 * np.pi * np.arange(2 * rows) / (2 * rows)
    n = len(around)
    points = [(0, 0, 1)] + [(np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)) for p in polar for a in around]
    faces = [(0, 1 + k, 1 + (k + 1) % n) for k in range(n)]
    for row in range(rows - 2):
        for k in range(n):
            a, b = 1 + row * n + k, 1 + row * n + (k + 1) % n
            faces += [(a, a + n, b + n), (a, b + n, b)]
    last, start = len(points), 1 + (rows - 2) * n
    faces += [(last, start + (k + 1) % n, start + k) for k in range(n)]
    return obj(path, [*points, (0, 0, -1)], faces)


def test_a_box_out_of_a_file_is_the_box(tmp_path: Path) -> None:
    """Scaled, and with a bore; a mesh inside out as a whole is turned."""
    part, form = Mesh(box(tmp_path / "a.obj"), "1 mm"), Box((0.03, 0.02, 0.01))
    turned = Mesh(box(tmp_path / "b.obj", [face[::-1] for face in triangles(SIDES)]), 0.001)
    far = Mesh(box(tmp_path / "c.obj", corners=np.array(CORNERS) + 512.0), 0.001)
    bore = Cylinder(0.004, 0.01).at((0.005, 0, 0))
    for one, other in ((part, form), (turned, form), (part - bore, form - bore), (far, form.at([0.512] * 3))):
        assert one.volume == pytest.approx(other.volume, rel=EXACT)
        assert np.abs(one.centroid - other.centroid).max() < EXACT
        assert np.abs(one.inertia - other.inertia).max() < EXACT * other.inertia.max()
    points = np.array([(0, 0, 0), (0.0149, 0.0099, 0.0049), (0.0151, 0, 0), (0, 0, -0.02), (0.016, 0.011, 0)])
    for margin in (0.0, 2e-4, -2e-4):
        assert (part.contains(points, margin) == form.contains(points, margin)).all()
    assert part == Mesh(tmp_path / "a.obj", 0.001) and hash(part) == hash(pickle.loads(pickle.dumps(part)))
    assert part != Mesh(tmp_path / "a.obj") and part != turned


def test_a_ball_of_triangles_approaches_the_ball(tmp_path: Path) -> None:
    """By the second order; extrapolated from two meshes it is there to 1e-6."""
    form = Sphere(1.0)
    found = [Mesh(ball(tmp_path / f"{rows}.obj", rows)) for rows in (30, 60, 120)]
    for exact, values in (
        (form.volume, [x.volume for x in found]),
        (form.inertia[0, 0], [x.inertia[0, 0] for x in found]),
        (form.inertia[2, 2], [x.inertia[2, 2] for x in found]),
    ):
        error = [value / exact - 1.0 for value in values]
        assert [error[0] / error[1], error[1] / error[2]] == pytest.approx([4.0, 4.0], rel=0.01)
        assert (4.0 * values[2] - values[1]) / 3.0 == pytest.approx(exact, rel=1e-6)


TWO = [*CORNERS, *(np.array(CORNERS) / 2 + [100.0, 0.0, 0.0]).tolist()]
SECOND = [(a + 8, b + 8, c + 8) for a, b, c in triangles(SIDES)]


@pytest.mark.parametrize(
    ("corners", "faces", "words"),
    [
        (CORNERS, triangles(SIDES)[1:], "is not closed: 3 of its edges .* as a solid body"),
        (CORNERS, [triangles(SIDES)[0][::-1], *triangles(SIDES)[1:]], "face both ways: at 3 of its edges"),
        (TWO, triangles(SIDES) + [face[::-1] for face in SECOND], "1 of its 2 parts inside out"),
        (CORNERS, [(0, 1, 3), (3, 1, 0)], "encloses no volume"),
        ([(1, 1, 1)] * 3, [(0, 1, 2)], "encloses nothing"),
        (CORNERS, [], "no triangle"),
    ],
    ids=["open", "both ways", "one inside out", "plane", "point", "nothing"],
)
def test_meshes_that_enclose_nothing_certain_are_refused(corners: Any, faces: Any, words: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=rf"part\.obj.*{words}") as error:
        Mesh(obj(tmp_path / "part.obj", corners, faces))
    assert error.value.path == str(tmp_path / "part.obj")


def test_hollows_and_several_parts_are_read(tmp_path: Path) -> None:
    small = [(0.5 * x, 0.5 * y, 0.5 * z) for x, y, z in CORNERS]
    hollow = obj(tmp_path / "hollow.obj", CORNERS + small, triangles(SIDES) + [face[::-1] for face in SECOND])
    assert Mesh(hollow).volume == pytest.approx(6000.0 * 7 / 8, rel=EXACT)
    points = np.random.default_rng(3).uniform(-1.2, 1.2, (2000, 3)) * [15.0, 10.0, 5.0]
    outer, inner = ((np.abs(points) < half * np.array([15.0, 10.0, 5.0])).all(axis=1) for half in (1.0, 0.5))
    assert (Mesh(hollow).contains(points) == (outer & ~inner)).all()
    # distances from boxes: from outside to the nearest point, from inside to the nearest face
    size = np.array([15.0, 10.0, 5.0])
    beyond = [np.abs(points) - half * size for half in (1.0, 0.5)]
    off_outer, off_inner = (np.linalg.norm(np.maximum(x, 0.0), axis=1) for x in beyond)
    deep_outer, deep_inner = (-x.max(axis=1) for x in beyond)
    wall = outer & ~inner
    assert (Mesh(hollow).contains(points, -0.5) == (wall & (deep_outer > 0.5) & (off_inner > 0.5))).all()
    near = (~outer & (off_outer < 0.5)) | (inner & (deep_inner < 0.5))
    assert (Mesh(hollow).contains(points, 0.5) == (wall | near)).all()


def test_single_precision_that_parts_corners_is_closed(tmp_path: Path) -> None:
    """Each triangle with corners of its own, rounded on the way, as in STL."""
    rng, noise = np.random.default_rng(1), 1e-7
    corners = np.array([CORNERS[i] for face in triangles(SIDES) for i in face])
    corners = corners + noise * rng.uniform(-1, 1, corners.shape)
    assert Mesh(obj(tmp_path / "a.obj", corners, np.arange(36).reshape(-1, 3))).volume == pytest.approx(
        6000.0, rel=1e-7
    )


def test_files_that_are_no_meshes_and_bad_scales(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=r"gone\.stl"):
        Mesh(tmp_path / "gone.stl")
    with pytest.raises(ArgumentError, match=r"\.iges has surfaces of a CAD program: export the part as STEP or STL"):
        Mesh(tmp_path / "part.iges")
    for scale, words in ((0, "scale is 0 m"), (-1, "scale is -1 m"), ("1 kg", "scale is a length")):
        with pytest.raises(DescriptionError, match=words):
            Mesh(box(tmp_path / "a.obj"), scale)  # type: ignore[arg-type]


def machine(folder: Path) -> pt.Mechanism:
    """A body of a mesh with a bore, and one of a mesh that is too large to draw."""
    (folder / "parts").mkdir()
    m = pt.Mechanism("machine")
    block = Mesh(box(folder / "parts" / "block.obj"), "1 mm") - Disc("3 mm", "10 mm")
    m.add_solid("block", block, material="steel", orientation=(1, 0.2, 0.3, 0.4))
    m.add_solid("ball", Mesh(ball(folder / "ball.obj", 60)), density=1000.0, position=(0.5, 0, 0))
    for name in ("block", "ball"):
        m.add_revolute(name, m.ground, name, point=(0.1, 0, 0))
    return m


def test_model_files_name_the_mesh_beside_them(tmp_path: Path) -> None:
    m = machine(tmp_path)
    m.save(tmp_path / "machine.toml")
    text = (tmp_path / "machine.toml").read_text("utf-8")
    assert 'file = "parts/block.obj"' in text and str(tmp_path) not in text
    again = pt.load(tmp_path / "machine.toml")
    assert again.to_spec() == m.to_spec() and again.bodies["block"].shape == m.bodies["block"].shape
    # a file elsewhere may not name it, unless its reader says so
    (tmp_path / "models").mkdir()
    m.save(tmp_path / "models" / "machine.toml")
    with pytest.raises(
        FileFormatError, match=r'line 6: the mesh "\.\./parts/block\.obj" is not opened: it lies outside'
    ):
        pt.load(tmp_path / "models" / "machine.toml")
    assert pt.load(tmp_path / "models" / "machine.toml", root=tmp_path).to_spec() == m.to_spec()
    absolute = text.replace("parts/block.obj", (tmp_path / "parts" / "block.obj").as_posix())
    (tmp_path / "models" / "b.toml").write_text(absolute.rsplit("\n", 2)[0], "utf-8")
    with pytest.raises(FileFormatError, match="it lies outside"):
        pt.load(tmp_path / "models" / "b.toml")
    # another mesh of that name is used, and said
    box(tmp_path / "parts" / "block.obj", corners=2.0 * np.array(CORNERS))
    with pytest.warns(ChangedFileWarning, match=r"block\.obj.*has changed since the model was saved"):
        other = pt.load(tmp_path / "machine.toml")
    assert other.bodies["block"].mass > 7 * m.bodies["block"].mass
    (tmp_path / "parts" / "block.obj").unlink()
    with pytest.raises(FileFormatError, match=r"line 6: .*block\.obj"):
        pt.load(tmp_path / "machine.toml")


def test_a_stored_run_has_its_picture_and_opens_nothing(tmp_path: Path) -> None:
    m = machine(tmp_path)
    run = m.simulate(0.01)
    drawn = describe(run, None)["solids"]
    names = list(m.bodies)
    counts = {names[x["body"]]: (len(x["parts"][0]["faces"]) // 3, x["parts"][0]["of"]) for x in drawn}
    assert counts["block"][0] >= 12 and 1000 < counts["ball"][0] < counts["ball"][1] == 2 * 120 * 59
    assert sum(count for count, _ in counts.values()) <= MOST_TRIANGLES
    run.save(tmp_path / "run.json")
    for file in (tmp_path / "ball.obj", tmp_path / "parts" / "block.obj"):
        file.unlink()
    again = pt.load_result(tmp_path / "run.json")
    assert describe(again, None)["solids"] == drawn
    good = json.loads(json.dumps(again.spec["bodies"][0]["shape"]["drawn"]))
    for bad in (3, [3], [{"kind": "mesh", "file": "/etc/passwd"}], [{**good[0], "faces": [0, 1, 99999]}],
                [{**good[0], "points": [0.0, float("nan"), 0.0]}], [{**good[0], "kind": "cube"}]):  # fmt: skip
        again.spec["bodies"][0]["shape"]["drawn"] = bad
        with pytest.raises(FileFormatError):
            describe(again, None)


def test_contacts_take_radii_from_shapes() -> None:
    m = pt.Mechanism("balls")
    one = m.add_solid("one", Sphere("3 cm"), mass=1.0, position=(0, 0.1, 0))
    two = m.add_solid("two", shapes.Shell(Disc("4 cm", "2 cm"), "1 mm"), mass=1.0)
    between = m.add_contact("C", one, (0, 0, 0), two, (0, 0, 0), radius1=one.shape, radius2=two.shape, stiffness=1e5)
    assert (between.radius1, between.radius2) == (0.03, 0.04)
    tyre = m.add_tyre("T", one, center=(0, 0, 0), axis=(0, 0, 1), radius=one.shape, normal=(0, 1, 0), stiffness=1e5)
    assert tyre.radius == 0.03
    with pytest.raises(DescriptionError, match="radius1 is a Box, which has no radius; give a Sphere"):
        m.add_contact("D", one, (0, 0, 0), m.ground, (0, 0, 0), radius1=Box((1, 1, 1)), normal="y", stiffness=1.0)


COLLADA = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2026-01-01T00:00:00Z</created><modified>2026-01-01T00:00:00Z</modified>
<unit meter="0.001" name="millimetre"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="box"><mesh>
<source id="p"><float_array id="f" count="24">{corners}</float_array><technique_common>
<accessor source="#f" count="8" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count="6"><input semantic="VERTEX" source="#v" offset="0"/><vcount>4 4 4 4 4 4</vcount><p>{sides}</p>
</polylist>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s">
<node id="a"><translate>100 0 0</translate><node id="b"><rotate>0 0 1 90</rotate><scale>2 1 1</scale>
<instance_geometry url="#box"/></node></node><node id="c"><instance_geometry url="#box"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def test_collada_with_its_unit_its_nodes_and_its_polygons(tmp_path: Path) -> None:
    pytest.importorskip("collada")
    text = COLLADA.format(
        corners=" ".join(f"{x:g}" for corner in CORNERS for x in corner),
        sides=" ".join(f"{i}" for s in SIDES for i in s),
    )
    (tmp_path / "a.dae").write_text(text, "utf-8")
    part = Mesh(tmp_path / "a.dae")
    assert part.volume == pytest.approx(3 * 6e-6, rel=1e-6)  # pycollada keeps single precision
    low, high = part.bounds
    assert np.allclose(low, [-0.015, -0.03, -0.005], atol=1e-7) and np.allclose(high, [0.11, 0.03, 0.005], atol=1e-7)
    for name, content, words in (
        ("b.dae", text.replace("<COLLADA", '<!DOCTYPE a [<!ENTITY b "c">]><COLLADA', 1), "document type"),
        ("c.dae", "<a>" * 600 + "</a>" * 600, "levels, more than the limit"),
        ("d.dae", text[:-9], "not well-formed XML"),
        ("e.dae", "PK\x03\x04", "not well-formed XML"),
        ("f.dae", "<a/>", "cannot be read|no scene|no triangle"),
    ):
        (tmp_path / name).write_text(content, "utf-8")
        with pytest.raises(FileFormatError, match=words):
            load(tmp_path / name)


def step(radius: float, height: float) -> str:
    """A cylinder in millimetres from z = 0, as ISO 10303-214 has it."""
    lines: list[str] = []

    def put(text: str) -> str:
        lines.append(text)
        return f"#{len(lines)}"

    def triple(kind: str, *x: float) -> str:
        return put(f"{kind}('',({','.join(repr(float(v)) for v in x)}))")

    def frame(z: float, up: float = 1.0) -> str:
        point, along, across = (
            triple("CARTESIAN_POINT", 0, 0, z),
            triple("DIRECTION", 0, 0, up),
            triple("DIRECTION", 1, 0, 0),
        )
        return put(f"AXIS2_PLACEMENT_3D('',{point},{along},{across})")

    def face(surface: str, *edges: tuple[str, str]) -> str:
        around = ",".join(put(f"ORIENTED_EDGE('',*,*,{edge},{sense})") for edge, sense in edges)
        loop = put(f"EDGE_LOOP('',({around}))")
        bound = put(f"FACE_OUTER_BOUND('',{loop},.T.)")
        return put(f"ADVANCED_FACE('',({bound}),{surface},.T.)")

    application = put("APPLICATION_CONTEXT('automotive design')")
    context = put(f"PRODUCT_CONTEXT('',{application},'mechanical')")
    product = put(f"PRODUCT('part','part','',({context}))")
    formation = put(f"PRODUCT_DEFINITION_FORMATION('','',{product})")
    design = put(f"PRODUCT_DEFINITION_CONTEXT('part definition',{application},'design')")
    definition = put(f"PRODUCT_DEFINITION('design','',{formation},{design})")
    shape = put(f"PRODUCT_DEFINITION_SHAPE('','',{definition})")
    length = put("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))")
    angle = put("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
    solid_angle = put("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
    sure = put(f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-7),{length},'distance_accuracy_value','')")
    space = put(
        f"(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({sure}))"
        f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{solid_angle}))REPRESENTATION_CONTEXT('',''))"
    )
    ends = [put(f"VERTEX_POINT('',{triple('CARTESIAN_POINT', radius, 0, z)})") for z in (0.0, height)]
    circles = [put(f"CIRCLE('',{frame(z)},{radius})") for z in (0.0, height)]
    rims = [put(f"EDGE_CURVE('',{end},{end},{circle},.T.)") for end, circle in zip(ends, circles, strict=True)]
    along = put(f"VECTOR('',{triple('DIRECTION', 0, 0, 1)},1.)")
    line = put(f"LINE('',{triple('CARTESIAN_POINT', radius, 0, 0)},{along})")
    straight = put(f"EDGE_CURVE('',{ends[0]},{ends[1]},{line},.T.)")
    faces = [
        face(
            put(f"CYLINDRICAL_SURFACE('',{frame(0)},{radius})"),
            (rims[0], ".T."),
            (straight, ".T."),
            (rims[1], ".F."),
            (straight, ".F."),
        ),
        face(put(f"PLANE('',{frame(0, -1)})"), (rims[0], ".F.")),
        face(put(f"PLANE('',{frame(height)})"), (rims[1], ".T.")),
    ]
    shell = put(f"CLOSED_SHELL('',({','.join(faces)}))")
    brep = put(f"MANIFOLD_SOLID_BREP('',{shell})")
    found = put(f"ADVANCED_BREP_SHAPE_REPRESENTATION('',({frame(0)},{brep}),{space})")
    put(f"SHAPE_DEFINITION_REPRESENTATION({shape},{found})")
    body = "".join(f"#{i}={text};\n" for i, text in enumerate(lines, 1))
    head = "FILE_DESCRIPTION((''),'2;1');\nFILE_NAME('part','2026-01-01T00:00:00',(''),(''),'','','');\n"
    kind = "FILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));\n"
    return f"ISO-10303-21;\nHEADER;\n{head}{kind}ENDSEC;\nDATA;\n{body}ENDSEC;\nEND-ISO-10303-21;\n"


def test_step_in_metres(tmp_path: Path) -> None:
    pytest.importorskip("cascadio")
    (tmp_path / "shaft.step").write_text(step(20.0, 50.0), "utf-8")
    shaft, form = Mesh(tmp_path / "shaft.step"), Cylinder(0.02, 0.05).at((0, 0, 0.025))
    assert shaft.volume == pytest.approx(form.volume, rel=1e-4)
    assert np.abs(shaft.inertia - form.inertia).max() < 1e-4 * form.inertia.max()
    assert shaft.centroid == pytest.approx(form.centroid, abs=1e-8)
    (tmp_path / "no.step").write_text("garbage", "utf-8")
    with pytest.raises(FileFormatError, match="is not STEP, or contains no solid"):
        Mesh(tmp_path / "no.step")
