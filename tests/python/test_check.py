"""`partita check`: what a file is, in words and as JSON, and the exit code of a lint."""

import json
from pathlib import Path

import pytest
from test_urdf import LENGTHS, LOOP, PAIR, ends, tree, written

import partita as pt
from partita.cli import main


def test_a_good_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(written(tmp_path, tree(LOOP)))
    assert main(["check", path]) == 0
    printed = capsys.readouterr().out
    assert (
        "degrees of freedom: 1" in printed
        and "redundant constraints: 3 of 20" in printed
        and "3 shapes to draw" in printed
    )
    assert main(["check", path, "--json", "--base", "free"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["closes"] and found["report"]["mobility"] == 7 and found["reading"]["kind"] == "URDF"


def test_a_file_whose_loop_does_not_close(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    far = LOOP.replace(f'"{LENGTHS["rocker"]} 0 0"', '"9 0 0"')
    assert main(["check", str(written(tmp_path, tree(far)))]) == 1
    assert "does not close" in capsys.readouterr().out


def test_a_catalogue_entry_and_a_bad_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "four-bar"]) == 0
    assert "degrees of freedom: 1" in capsys.readouterr().out
    assert main(["check", str(written(tmp_path, "<robot>"))]) == 2
    assert "line 1" in capsys.readouterr().err


def test_how_a_file_is_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The arguments of `partita.load` on the command line."""
    (tmp_path / "urdf").mkdir()
    path = written(tmp_path / "urdf", tree(ends("here", "there")))
    loops = tmp_path / "loops.yml"
    loops.write_text(PAIR, "utf-8")
    for more, dof in (((), 3), (("--base", "free"), 9), (("--loops", str(loops)), 1), (("--root", str(tmp_path)), 3)):
        assert main(["check", str(path), *more]) == 0
        assert f"degrees of freedom: {dof}" in capsys.readouterr().out
    heavy = written(tmp_path / "urdf", tree().replace('iyy="1e-4"', 'iyy="1e3"'))
    assert main(["check", str(heavy)]) == 0 and "principal values" in capsys.readouterr().out
    assert main(["check", str(heavy), "--inertia", "strict"]) != 0


def test_the_remedy_is_that_of_the_report_in_words() -> None:
    words = " ".join(str(pt.catalogue.load("four-bar").check()).split())
    remedy = "replace hinge C by a cylindrical joint and hinge D by a ball joint; then nothing is redundant, and"
    remedy += " nothing else moves"
    assert f"remedy: {remedy}" in words
    assert remedy in " ".join(str(pt.catalogue.load("four-bar").report()).split())
