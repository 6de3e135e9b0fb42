"""The tools that read robots and tables from a folder, on files written here."""

from __future__ import annotations

from importlib import util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

TOOLS = Path(__file__).parents[2] / "tools"


def tool(name: str, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """A script of tools/ as a module."""
    spec = util.spec_from_file_location(name, TOOLS / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = util.module_from_spec(spec)
    monkeypatch.setitem(__import__("sys").modules, name, module)
    spec.loader.exec_module(module)
    return module


def link(name: str, mass: float, com: str = "0 0 0", moment: float = 0.01) -> str:
    moments = f'ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"'
    inertial = f'<origin xyz="{com}" rpy="0 0 0"/><mass value="{mass}"/><inertia {moments}/>'
    return f'<link name="{name}"><inertial>{inertial}</inertial></link>'


def joint(name: str, kind: str, parent: str, child: str, xyz: str, axis: str = "0 1 0", rpy: str = "0 0 0") -> str:
    where = f'<origin xyz="{xyz}" rpy="{rpy}"/><parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{where}<axis xyz="{axis}"/></joint>'


def four_bar(folder: Path, ball: bool, turned: float = 0.1) -> None:
    """A four-bar whose coupler is cut in two and drawn open; on a ball (three hinges) at one end, or on a hinge."""
    parts = [link("base", 1.0), link("crank", 0.3, "0.15 0 0"), link("front", 0.4, "0.2 0 0"),
             link("rocker", 0.6, "0 0 0.3"), link("rear", 0.4, "-0.2 0 0"),
             link("mark A", 1e-9, moment=0.0), link("mark B", 1e-9, moment=0.0)]  # fmt: skip
    parts += [joint("O", "revolute", "base", "crank", "0 0 0", rpy=f"0 {turned} 0"),
              joint("Q", "revolute", "base", "rocker", "1 0 0"),
              joint("P", "revolute", "crank", "front", "0.3 0 0"),
              joint("A frame", "fixed", "front", "mark A", "0.45 0 0"),
              joint("B frame", "fixed", "rear", "mark B", "-0.45 0 0")]  # fmt: skip
    if ball:
        parts += [link("one", 0.0, moment=0.0), link("two", 0.0, moment=0.0),
                  joint("R1", "revolute", "rocker", "one", "0 0 0.6", "1 0 0"),
                  joint("R2", "revolute", "one", "two", "0 0 0", "0 1 0"),
                  joint("R3", "revolute", "two", "rear", "0 0 0", "0 0 1")]  # fmt: skip
    else:
        parts.append(joint("R", "revolute", "rocker", "rear", "0 0 0.6"))
    folder.mkdir()
    (folder / "robot.urdf").write_text(f"<robot>{''.join(parts)}</robot>", "utf-8")
    pairs = "closed_loop: [['mark A', 'mark B']]\ntype: ['6d']\nname_mot: ['O']\n"
    (folder / "robot.yaml").write_text(pairs, "utf-8")


@pytest.mark.parametrize(("ball", "redundant"), [(False, 3), (True, 1)])
def test_a_robot_is_read_closed_and_run(
    ball: bool, redundant: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four hinges in a plane say three conditions too many; with a ball for one of them only that nothing leaves it."""
    robots = tool("robots", monkeypatch)
    four_bar(tmp_path / "bar", ball)
    robot = robots.read(tmp_path / "bar", None)
    mechanism, gap = robots.build(robot)
    assert gap > 0.1
    assert sorted(robot.frames) == sorted({"mark A", "mark B", *(j.name for j in robot.joints)})
    state = mechanism.assemble()
    summary = mechanism.compile().summary
    assert (summary["mobility"], summary["joint_rows"] - summary["joint_rank"]) == (1, redundant)
    run = mechanism.simulate(0.1, initial=state, t_eval=[0.0, 0.1])
    assert run.success
    ends = [run.body("front").point((0.45, 0, 0)), run.body("rear").point((-0.45, 0, 0))]
    assert np.abs(ends[0] - ends[1]).max() <= 1e-12
    assert np.abs(run.body("front").rotation - run.body("rear").rotation).max() <= 1e-12
    line, remarks, fine = robots.row(tmp_path / "bar", None)
    assert fine and "success" in line and any("frames" in word for word in remarks)
    assert any("ball" in word for word in remarks) == ball


def test_a_sidecar_that_asks_for_more_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robots = tool("robots", monkeypatch)
    four_bar(tmp_path / "bar", ball=False)
    with (tmp_path / "bar" / "robot.yaml").open("a", encoding="utf-8") as sidecar:
        sidecar.write("joint_type: ['spherical']\n")
    with pytest.raises(ValueError, match="joint_type"):
        robots.read(tmp_path / "bar", None)


@pytest.mark.parametrize(("gravity", "met"), [(9.80665, True), (9.81, False)])
def test_a_table_is_met_or_not(
    gravity: float, met: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The straight slide under 45 degrees, by hand: constant acceleration, and a moment that grows as it leaves."""
    tables = tool("adams_tables", monkeypatch)
    names = [f"{group}{i}" for group, n in (("Pos", 3), ("Quat", 4), ("Vel", 3), ("Avel", 3), ("Acc", 3), ("Aacc", 3),
                                            ("Rforce", 3), ("Rtorque", 3)) for i in range(n)]  # fmt: skip
    rows = []
    for t in np.linspace(0.0, 1.0, 11):
        pull = np.array([0.0, -gravity / 2, -gravity / 2])
        position = np.array([3.0, 2.0, 3.0]) + 0.5 * pull * t**2
        force = -np.array([0.0, -gravity / 2, gravity / 2])
        moment = np.cross(position - (1.0, 2.0, 3.0), force)
        quaternion = [np.cos(np.pi / 8), -np.sin(np.pi / 8), 0.0, 0.0]
        rows.append([t, *position, *quaternion, *(pull * t), 0, 0, 0, *pull, 0, 0, 0, *force, *moment])
    lines = [",".join(["t", *names]), *(",".join(map(repr, map(float, row))) for row in rows)]
    path = tmp_path / "Prismatic_Case02.csv"
    path.write_text("\n".join(lines), "utf-8")
    assert tables.compared(path) == met
    assert ("<- more than" in capsys.readouterr().out) != met
