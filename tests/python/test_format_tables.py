"""Readers walk files by tables: nothing is ignored in silence; `mutations.py` makes every change, this a part."""

from __future__ import annotations

import importlib.util
import json
import warnings
from pathlib import Path

import mutations
import owners
import pytest
from mutations import FILES, TABLES
from thorough import either

import partita as pt
from partita.io.reading import KINDS

EVERY = either(23, 1)
"""One of so many changes is made; their number has no factor in common with what changes from line to line."""
ALL = sorted(path for path in FILES.iterdir() if path.is_file())


@pytest.mark.parametrize("suffix", [".urdf", ".sdf", ".mjcf"])
def test_every_change_of_a_file_is_heard(suffix: str) -> None:
    if suffix == ".mjcf" and importlib.util.find_spec("mujoco") is None:
        pytest.skip("MuJoCo serves Python 3.11 and newer")
    files = [path for path in ALL if TABLES[path.suffix] is TABLES[suffix]]
    asked, found = mutations.silent(files, slice(0, None, EVERY))
    assert not found
    assert asked > 30


@pytest.mark.parametrize("suffix", [".urdf", ".sdf"])
def test_the_files_have_every_item_of_the_tables(suffix: str) -> None:
    assert not mutations.unused(TABLES[suffix], [path for path in ALL if path.suffix == suffix])


def test_the_table_of_mjcf_knows_what_mujoco_knows() -> None:
    mujoco = pytest.importorskip("mujoco")
    table, missing, path = TABLES[".mjcf"], [], list[str]()
    for line in mujoco.mj_printSchema(False, False).splitlines():
        words = line.split()
        if len(words) > 1 and words[1].startswith("("):
            depth = (len(line) - len(line.lstrip())) // 3
            path, words = [*path[:depth], words[0].replace("(world)body", "worldbody")], words[2:]
        context = table.root
        for tag in path[1:]:
            item = table.items(context).get(tag)
            if item is None:
                missing.append("/".join(path))
                context = ""
            else:
                context = item.context if item.rule in mutations.WALKED else ""
            if context not in table.contexts:
                break
        else:
            context = "body" if context == "worldbody" else context
            missing += [f"{'/'.join(path)} {key}" for key in words if f"@{key}" not in table.items(context)]
    assert not missing


@pytest.mark.parametrize("suffix", [".urdf", ".mjcf"])
@pytest.mark.parametrize("name", ["four-bar", "rssr", "bricard", "car-axis", "four-bar-spring"])
def test_what_is_written_is_read_in_full(name: str, suffix: str, tmp_path: Path) -> None:
    if suffix == ".mjcf":
        pytest.importorskip("mujoco")
    path = tmp_path / f"written{suffix}"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what the format cannot carry is said while writing
        pt.catalogue.load(name).save(path)
    assert {group.kind for group in pt.load(path).remarks} <= {"bounds", "changed", "used"}


def test_remarks_of_one_text_are_one(tmp_path: Path) -> None:
    joint = (
        '<link name="{0}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
        '<joint name="to {0}" type="revolute"><parent link="base"/><child link="{0}"/><axis xyz="0 1 0"/>'
        '<limit lower="-1" upper="1"/><dynamics friction="0.1"/></joint>\n'
    )
    links = "".join(joint.format(f"link{i}") for i in range(20))
    path = tmp_path / "many.urdf"
    path.write_text(f'<robot name="many"><link name="base"/>\n{links}<odd/></robot>', "utf-8")
    m = pt.load(path)
    assert [(group.kind, group.count) for group in m.remarks][:3] == [("motion", 20), ("bounds", 20), ("unknown", 1)]
    friction = m.remarks[0]
    assert friction.lines[:2] == (2, 3) and friction.names[0] == 'joint "to link0" dynamics friction 0.1'
    assert (
        len(str(m.reading).splitlines()) < 15
        and "20 times, from line 2" in str(friction)
        and "16 more" in str(friction)
    )
    assert friction.to_dict()["count"] == 20
    assert list(KINDS).index("motion") == 0
    assert pt.Mechanism("drawn").remarks == ()


@pytest.mark.parametrize("name", owners.CASES)
def test_a_file_moves_as_the_program_says_that_owns_the_format(name: str) -> None:
    if name.endswith(".mjcf"):
        pytest.importorskip("mujoco")
    stored = json.loads(owners.STORED.read_text("utf-8"))[name]
    assert max(owners.differences(name, stored)) < owners.SAME


@pytest.mark.parametrize("name", owners.CASES)
def test_the_program_that_owns_the_format_still_says_so(name: str) -> None:
    program = owners.PROGRAMS[Path(name).suffix][1]
    pytest.importorskip(program, reason=f"{program} is no pinned tool; its stored answers stand in")
    assert max(owners.differences(name, owners.asked(name))) < owners.SAME
