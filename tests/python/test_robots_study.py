"""The study of robots' files on a few written here: `python -m robots FOLDER` (with PYTHONPATH=tests/python)."""

from pathlib import Path

import pytest
from robots.loops import compare
from robots.others import difference
from robots.study import main, row
from test_sdf import model
from test_urdf import LOOP, PAIR, ends, tree, written

import partita as pt


def test_rows_and_the_summary(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, text in (("loop", tree(LOOP)), ("open", tree()), ("bad", "<robot/>")):
        (tmp_path / name).mkdir()
        written(tmp_path / name, text)
    (tmp_path / "open" / "scene.sdf").write_text(model("<plugin name='p' filename='f'/>"), "utf-8")
    assert main([str(tmp_path)]) == 0
    *rows, summary = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in rows] == [
        "bad/robot.urdf",
        "loop/robot.urdf",
        "open/robot.urdf",
        "open/scene.sdf",
    ]
    assert "refused" in rows[0] and "1 dof" in rows[1] and "3 dof" in rows[2] and "1 dof" in rows[3]
    assert summary == "4 files: 3 loaded, 3 of them move, 1 refused; 0 compared, 0 disagree"


def test_trees_accelerate_as_in_the_program_that_owns_the_format(tmp_path: Path) -> None:
    pytest.importorskip("pinocchio", reason="pin is no pinned tool; reference numbers stand in test_urdf")
    text = tree(ends("here", "there")).replace('"revolute"', '"continuous"')
    found = row(written(tmp_path, text), against="pinocchio")
    assert found.apart is not None and found.apart < 1e-13 and not found.disagrees
    # with other masses it would be seen
    m = pt.load(written(tmp_path, text.replace('mass value="1.1"', 'mass value="1.1001"')))
    assert difference(m, written(tmp_path, text), "pinocchio") > 1e-6
    coupled = text.replace("</joint>", '<mimic joint="B"/></joint>', 1)
    assert "couplings" in row(written(tmp_path, coupled), against="pinocchio").incomparable


def test_loops_accelerate_as_in_the_program_that_knows_their_lists(tmp_path: Path) -> None:
    """With joints of other types, and with redundant rows; each program's error is its own."""
    pytest.importorskip("pinocchio", reason="pin is no pinned tool")
    typed = f"{PAIR}joint_name: [D, B]\njoint_type: [UJOINT_ZY, SPHERICAL]\n"
    text = tree(ends("here", "there")).replace('"revolute"', '"continuous"')
    for sidecar in (PAIR, typed):
        path = written(tmp_path, text, sidecar)
        found = row(path, against="pinocchio")
        assert found.loops is not None and found.loops.exact < 1e-12 and found.loops.own_error < 1e-12
        assert not found.disagrees and "conditions" in str(found)
    heavier = pt.load(written(tmp_path, text.replace('mass value="1.1"', 'mass value="1.1001"'), PAIR))
    assert compare(heavier, written(tmp_path, text, PAIR)).exact > 1e-6
