"""Model files in four formats, closed in every way they know: read, reported, run, written again and read back."""

import math
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest
import test_sdf as sdf
import test_urdf as urdf
from test_small_bodies import off

import partita as pt

END = urdf.LENGTHS["coupler"]
GEAR = '<coupling name="gear"><predecessor link="crank"/><successor link="second"/><ratio value="-3"/></coupling>'
MIMIC = '<mimic joint="A" multiplier="2" offset="0.1"/>'


def second(more: str = "") -> str:
    """Another crank beside the loop."""
    text = urdf.link("crank").replace('"crank"', '"second"')
    return text + urdf.hinge("E", "base", "second", -1.0, 0.3, more)


def on_a_piece() -> str:
    """Frames named as such on a light end piece that a hinge carries."""
    _, coupler, rocker = urdf.angles()
    piece = (
        '<link name="piece"><inertial><mass value="1e-3"/><inertia ixx="1e-9" iyy="1e-9" izz="1e-9"/></inertial></link>'
    )
    turn = urdf.hinge("C", "coupler", "piece", END, rocker - coupler)
    marks = urdf.mark("closing_top_1_6D", "piece", 0.0)
    return urdf.tree(piece + turn + marks + urdf.mark("closing_top_2_6D", "rocker", urdf.LENGTHS["rocker"]))


def gimbal() -> str:
    """A ball made of three hinges closes the loop."""
    chain, before = "", "coupler"
    for i, axis in enumerate(("1 0 0", "0 1 0", "0 0 1")):
        origin = f'<origin xyz="{END if i == 0 else 0} 0 0"/>'
        chain += f"""<link name="g{i}"/><joint name="G{i}" type="continuous">
          <parent link="{before}"/><child link="g{i}"/>{origin}<axis xyz="{axis}"/></joint>"""
        before = f"g{i}"
    return urdf.tree(chain + urdf.mark("there", "rocker", urdf.LENGTHS["rocker"]))


def mjcf(equality: str, more: str = "") -> Callable[[], str]:
    def text() -> str:
        pytest.importorskip("mujoco")
        import test_mjcf

        return test_mjcf.model(equality, more)

    return text


CONNECT = f'<connect name="C" body1="coupler" body2="rocker" anchor="{END} 0 0"/>'
BESIDE = f'<connect name="C2" body1="coupler" body2="rocker" anchor="{END} 0.2 0"/>'
PIECE = (
    '<body name="piece" pos="{} 0 0"><inertial pos="0 0 0" mass="1e-3" diaginertia="1e-6 1e-6 1e-6"/>'
    '<joint name="C" axis="0 1 0"/></body>'
)
WHEEL = """<body name="wheel" pos="0 2 0"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
  <joint name="W" axis="0 1 0"/></body>"""
FOLLOWS = '<joint name="gear" joint1="W" joint2="A" polycoef="0.1 -3 0 0 0"/>'


def welded() -> str:
    """A hinged piece of the coupler is welded to the rocker."""
    _, coupler, rocker = urdf.angles()
    turn = float(rocker - coupler) / 2
    body = PIECE.format(END).replace('name="piece"', f'name="piece" quat="{math.cos(turn)!r} 0 {-math.sin(turn)!r} 0"')
    weld = f'<weld name="top" body1="rocker" body2="piece" relpose="{urdf.LENGTHS["rocker"]} 0 0 1 0 0 0"/>'
    text = mjcf(weld)()
    at = text.index("</body>")
    return text[:at] + body + text[at:]


TOML = """
[mechanism]
partita = 1
name = "crank slider"

[[rod]]
name = "crank"
start = [0.0, 0.0, 0.0]
end = ["60 mm", "80 mm", 0.0]
mass = "300 g"

[[rod]]
name = "rod"
start = [0.06, 0.08, 0.0]
end = [0.36, 0.0, 0.0]
mass = 0.5

[[body]]
name = "piston"
mass = 0.2
inertia = [1e-4, 1e-4, 1e-4]
position = [0.36, 0.0, 0.0]

[[joint]]
name = "A"
type = "revolute"
parent = "ground"
child = "crank"
point = [0.0, 0.0, 0.0]

[[joint]]
name = "B"
type = "revolute"
parent = "crank"
child = "rod"
point = [0.06, 0.08, 0.0]

[[joint]]
name = "P"
type = "prismatic"
parent = "ground"
child = "piston"
point = [0.36, 0.0, 0.0]
axis = [1.0, 0.0, 0.0]

[[joint]]
name = "C"
type = "revolute"
parent = "rod"
child = "piston"
point = [0.36, 0.0, 0.0]
"""

# text, suffix, the file beside it, and what closes the loop
FILES: dict[str, tuple[str | Callable[[], str], str, str | None, str]] = {
    "urdf: loop": (urdf.tree(urdf.LOOP), ".urdf", None, "revolute"),
    "urdf: loop_joint": (urdf.tree(urdf.LOOP_JOINT), ".urdf", None, "spherical"),
    "urdf: sidecar": (urdf.tree(urdf.ends("here", "there")), ".urdf", urdf.PAIR, "spherical"),
    "urdf: frames of that name": (on_a_piece, ".urdf", None, "revolute"),
    "urdf: a gimbal welded": (gimbal, ".urdf", "closed_loop: [[g2, there]]\n", "spherical"),
    "urdf: loop and coupling": (urdf.tree(urdf.LOOP + second() + GEAR), ".urdf", None, "revolute"),
    "urdf: loop and mimic": (urdf.tree(urdf.LOOP + second(MIMIC)), ".xml", None, "revolute"),
    "mjcf: connect": (mjcf(CONNECT), ".mjcf", None, "spherical"),
    "mjcf: two of them": (mjcf(CONNECT + BESIDE), ".xml", None, "revolute"),
    "mjcf: weld": (welded, ".mjcf", None, "revolute"),
    "mjcf: joint": (mjcf(CONNECT + FOLLOWS, WHEEL), ".mjcf", None, "spherical"),
    "sdf: loop, relative_to": (sdf.model, ".sdf", None, "revolute"),
    "sdf: ball": (lambda: sdf.model(closing='<joint name="C" type="ball"><parent>coupler</parent><child>rocker</child>'
                  '<pose relative_to="tip"/></joint>'), ".sdf", None, "spherical"),
    "toml: crank slider": (TOML, ".toml", None, "revolute"),
}  # fmt: skip


def read(case: str, folder: Path) -> pt.Mechanism:
    text, suffix, beside, _ = FILES[case]
    (folder / f"model{suffix}").write_text(text if isinstance(text, str) else text(), "utf-8")
    if beside is not None:
        (folder / "model.yaml").write_text(beside, "utf-8")
    return pt.load(folder / f"model{suffix}")


@pytest.mark.parametrize("case", FILES)
def test_it_is_read_reported_run_written_and_read_back(case: str, tmp_path: Path) -> None:
    m = read(case, tmp_path)
    kinds = [joint["kind"] for joint in m.compile().summary["joints"] if not joint["tree"]]
    assert m.compile().mobility == 1 and (FILES[case][3] in kinds or FILES[case][1] == ".toml")
    report = m.report()
    assert "1 degree of freedom" in report.replace("degrees", "degree")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = m.simulate(0.1)
    assert run.success and run.certificate.verdict == "valid"
    for suffix in (".toml", ".urdf", ".mjcf"):
        if suffix == ".mjcf":
            pytest.importorskip("mujoco")
        assert not m.save(tmp_path / f"back{suffix}", strict=True).dropped
        back = pt.load(tmp_path / f"back{suffix}")
        assert off(m, back) < 1e-12, suffix
        assert back.simulate(0.01).success
