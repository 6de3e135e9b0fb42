"""`partita mcp`, asked by a client of the official SDK over stdio: ten tools, hostile input, limits."""

from __future__ import annotations

import base64
import importlib.util
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

import partita as pt
from partita.cli import main

pytest.importorskip("mcp", reason="the SDK of the Model Context Protocol is not installed: pip install 'partita[mcp]'")

from anyio.from_thread import start_blocking_portal
from jsonschema import Draft202012Validator
from mcp import Client, StdioServerParameters, stdio_client

from partita.cli.mcp.folder import Folder
from partita.cli.mcp.limits import ANSWER, LEAST, MEMBERS, TEXT, Limits
from partita.cli.mcp.server import refusal
from partita.cli.mcp.tools import TOOLS
from partita.cli.mcp.worker import answer

Ask = Callable[..., Any]
PENDULUM = """[mechanism]
partita = 1
name = "pendulum"
[[rod]]
name = "rod"
start = [0.0, 0.0, 0.0]
end = [1.0, 0.0, 0.0]
mass = 1.0
[[joint]]
name = "A"
type = "revolute"
parent = "ground"
child = "rod"
point = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
"""
OPEN = (
    PENDULUM
    + """[[joint]]
name = "B"
type = "spherical"
parent = "ground"
child = "rod"
point = [3.0, 0.0, 0.0]
child_point = [1.0, 0.0, 0.0]
"""
)
FOUR_BAR = {"catalogue": "four-bar"}


@contextmanager
def server(root: Path, *options: str) -> Iterator[Ask]:
    """A server in a folder, and what asks it."""
    command = ["-m", "partita", "mcp", "--root", str(root), *options]
    same = {"PYTHONPATH": str(Path(pt.__file__).parents[1])}  # the package that is tested
    with (
        start_blocking_portal() as portal,
        portal.wrap_async_context_manager(
            Client(stdio_client(StdioServerParameters(command=sys.executable, args=command, cwd=root.parent, env=same)))
        ) as client,
    ):

        def ask(tool: str, /, **arguments: Any) -> Any:
            if tool == "tools/list":
                return portal.call(client.list_tools)
            seconds = arguments.pop("give_up", None)
            return portal.call(lambda: client.call_tool(tool, arguments, read_timeout_seconds=seconds))

        yield ask


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the server, with links out of it and with modules that must not be imported."""
    outside = tmp_path_factory.mktemp("outside")
    (outside / "secret.toml").write_text(PENDULUM)
    root: Path = tmp_path_factory.mktemp("around") / "root"
    (root / "inner").mkdir(parents=True)
    (root / "pendulum.toml").write_text(PENDULUM)
    (root / "inner" / "open.toml").write_text(OPEN)
    (root / "numpy.py").write_text("raise SystemExit(7)")
    (root / "broken.toml").write_text('[mechanism]\npartita = 1\nname = "m"\n[[rod]]\nname = "r"\nmass = "heavy"\n')
    if sys.platform != "win32":
        (root / "link.toml").symlink_to(outside / "secret.toml")
        (root / "folder").symlink_to(outside)
        (root / "new.toml").symlink_to(outside / "planted.toml")
        (root / "circle").symlink_to(root / "circle")
        os.mkfifo(root / "pipe.toml")
    return root


@pytest.fixture(scope="module")
def ask(root: Path) -> Iterator[Ask]:
    with server(root, "--seconds", "60") as ask:
        yield ask


def found(result: Any) -> dict[str, Any]:
    """The answer, which is no error, and is in the text too."""
    assert not result.is_error, result.structured_content
    assert json.loads(result.content[0].text) == result.structured_content
    data: dict[str, Any] = result.structured_content
    return data


def local(root: Path, tool: str, **arguments: Any) -> dict[str, Any]:
    """The error of a call without a client and a process between."""
    got = refusal(tool, arguments) or answer({"tool": tool, "arguments": arguments}, Folder.of(str(root)), Limits())
    error: dict[str, Any] = got["error"]
    return judged(error)


def refused(result: Any) -> dict[str, Any]:
    """The error of a call."""
    assert result.is_error
    error: dict[str, Any] = result.structured_content["error"]
    return judged(error)


def judged(error: dict[str, Any]) -> dict[str, Any]:
    """An error, once it is a sentence without a traceback."""
    assert error["kind"].endswith("Error") and 20 < len(error["message"]) < 1500
    assert "Traceback" not in error["message"] and 'File "' not in error["message"]
    return error


def test_ten_tools_with_schemas(ask: Ask) -> None:
    tools = ask("tools/list").tools
    assert [tool.name for tool in tools] == list(TOOLS) and len(tools) == 10
    for tool in tools:
        Draft202012Validator.check_schema(tool.input_schema)
        assert tool.description and tool.annotations.read_only_hint == (tool.name != "export")


def test_a_client_without_a_model_learns_what_there_is(ask: Ask) -> None:
    about = found(ask("describe"))
    assert {"pendulum.toml", "inner/open.toml"} <= set(about["files"])
    assert set(about["catalogue"]) == set(pt.catalogue.names()) and about["limits"]["seconds"] == 60
    described = found(ask("describe", model=about["example"]))
    assert described["mobility"] == 1 and described["parameters"]["rod.mass"] == 1.0
    assert "mass=1" in described["bodies"]["rod"]


def test_a_run_is_that_of_the_core(ask: Ask) -> None:
    got = found(ask("run", file="pendulum.toml", duration="500 ms", outputs=6, targets={"A": "-30 deg"}))
    m = pt.Mechanism("pendulum")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    run = m.simulate(0.5, t_eval=np.linspace(0, 0.5, 6), initial=m.assemble({"A": "-30 deg"}))
    assert got["verdict"] == "valid" and got["success"] and got["t"] == run.t.tolist()
    assert got["coordinates"]["A"] == run.q[:, 0].tolist() and got["velocities"]["A"] == run.v[:, 0].tolist()
    assert got["certificate"] == str(run.certificate).splitlines()


def test_reactions_name_what_is_determined(ask: Ask) -> None:
    got = found(ask("reactions", **FOUR_BAR, duration=0.5, outputs=51, joints=["B"], series=True))
    entry = pt.catalogue.entry("four-bar")
    m = entry.mechanism()
    run = m.simulate(0.5, t_eval=np.linspace(0, 0.5, 51), initial=entry.initial(m), **entry.options)
    joint, force = run.joint("B"), got["joints"]["B"]["force"]
    assert list(got["joints"]) == ["B"] and force["determined"] == [True, True, False]
    sizes = np.linalg.norm(joint.force[:, :2], axis=1)
    assert force["largest"] == pytest.approx(sizes.max(), rel=1e-12) and force["t"] == run.t[sizes.argmax()]
    assert force["components"][2] is None and {row[2] for row in force["values"]} == {None}


def test_a_sweep_goes_on_where_a_member_fails(ask: Ask) -> None:
    got = found(ask("sweep", **FOUR_BAR, duration=0.2, parameters={"crank.mass": [0.2, -1.0, 0.6]}, joints=["A"]))
    light, wrong, heavy = got["members"]
    assert light["verdict"] == heavy["verdict"] == "valid" and "mass = -1 kg" in wrong["failed"]
    assert light["joints"]["A"]["force"] < heavy["joints"]["A"]["force"]


def test_checks_reports_and_positions(ask: Ask) -> None:
    checked = found(ask("check", catalogue="bennett"))
    assert checked["closes"] and checked["report"]["remedies"]
    apart = found(ask("check", file="inner/open.toml"))
    assert not apart["closes"] and apart["why"]
    assert "mobility" in found(ask("report", **FOUR_BAR))["text"].lower()
    placed = found(ask("assemble", **FOUR_BAR, targets={"A": "30 deg"}))
    assert placed["coordinates"]["A"] == pytest.approx(np.pi / 6) and placed["assembly"]["residual"] < 1e-12


def test_pictures(ask: Ask) -> None:
    for result in (ask("draw", file="inner/open.toml"), ask("plot", **FOUR_BAR, duration=0.2, what=["energy", "A"])):
        found(result)
        image = result.content[1]
        assert image.mime_type == "image/png" and base64.b64decode(image.data).startswith(b"\x89PNG")
    drawn = found(ask("draw", model=PENDULUM, format="svg"))
    assert drawn["closes"] and drawn["svg"].startswith("<?xml") and "</svg>" in drawn["svg"]


def test_exports_are_texts_or_new_files(ask: Ask, root: Path) -> None:
    text = found(ask("export", **FOUR_BAR, format="toml"))["files"]["mechanism.toml"]
    assert found(ask("describe", model=text))["mobility"] == 1
    assert set(found(ask("export", **FOUR_BAR, format="urdf"))["files"]) == {"mechanism.urdf", "mechanism.yaml"}
    assert "<canvas" in found(ask("export", model=PENDULUM, format="html", duration=0.5))["files"]["mechanism.html"]
    assert found(ask("export", **FOUR_BAR, format="c", to="inner/bar.c"))["written"] == ["inner/bar.c", "inner/bar.h"]
    assert "bar_accelerations" in (root / "inner" / "bar.c").read_text()
    (root / "inner" / "bar.c").unlink()
    error = refused(ask("export", **FOUR_BAR, format="c", to="inner/bar.c"))  # its header is still there
    assert "inner/bar.h" in error["message"] and not (root / "inner" / "bar.c").exists()


OUTSIDE = (
    "../secret.toml", "inner/../../x.toml", "/etc/passwd", "C:\\x.toml", "..\\x.toml", "\\\\host\\x.toml",
    "~/../x/..", "link.toml", "folder/secret.toml", "circle",
)  # fmt: skip


@pytest.mark.skipif(sys.platform == "win32", reason="named pipes, and links without a privilege, need POSIX")
def test_no_path_leads_out_of_the_folder(ask: Ask, root: Path) -> None:
    for name in OUTSIDE:
        error = local(root, "describe", file=name)
        assert error["kind"] in ("ArgumentError", "FileFormatError") and "folder" in error["message"], name
    for name in ("pipe.toml", "inner", ".", "no.toml"):
        assert local(root, "describe", file=name)["kind"] == "MissingFileError", name
    for name in ("a\0b.toml", "", "x" * 301, "\0"):
        assert local(root, "describe", file=name)["kind"] == "ArgumentError", name
    for name in (
        "../planted.toml",
        "/tmp/planted.toml",
        "folder/planted.toml",
        "new.toml",
        "a\0.toml",
        "pendulum.toml",
    ):
        assert local(root, "export", **FOUR_BAR, format="toml", to=name)["kind"] == "ArgumentError", name
    for name in ("../secret.toml", "folder/secret.toml", "a\0.toml"):
        assert refused(ask("describe", file=name))["kind"] == "ArgumentError", name
        assert refused(ask("export", **FOUR_BAR, format="toml", to=name))["kind"] == "ArgumentError", name
    assert (root / "pendulum.toml").read_text() == PENDULUM
    assert not list(root.parent.parent.rglob("planted*.toml"))


WRONG: list[tuple[str, dict[str, Any], str, str]] = [
    ("fly", {}, "UnknownNameError", "describe"),
    ("run", {"duration": 1.0}, "ArgumentError", "model"),
    ("run", FOUR_BAR | {"file": "pendulum.toml"}, "ArgumentError", "file and catalogue"),
    ("run", {"model": PENDULUM}, "ArgumentError", "duration"),
    ("run", {"model": PENDULUM, "duration": -1}, "ArgumentError", "duration"),
    ("run", {"model": PENDULUM, "duration": None}, "ArgumentError", "length of the run"),
    ("run", {"model": PENDULUM, "duration": 1, "targets": {"A": [[1]]}}, "ArgumentError", "not of type 'number'"),
    ("run", {"model": PENDULUM, "duration": "3 kg"}, "ArgumentError", "duration"),
    ("run", {"model": PENDULUM, "duration": 1, "outputs": 10**9}, "ArgumentError", "outputs"),
    ("run", {"model": PENDULUM, "duration": 1, "method": "magic"}, "ArgumentError", "method"),
    ("run", {"model": PENDULUM, "duration": 1, "targets": {"Z": 1.0}}, "UnknownNameError", "Z"),
    ("run", {"model": PENDULUM, "duration": 1, "__class__": 1}, "ArgumentError", "__class__"),
    ("run", {"model": "[" * 100_000, "duration": 1}, "FileFormatError", "line 1"),
    ("run", {"model": "x" * (TEXT + 1), "duration": 1}, "ArgumentError", "model"),
    ("run", {"model": PENDULUM.replace("mass = 1.0", "mass = -1.0"), "duration": 1}, "FileFormatError", "line 8"),
    ("run", {"model": OPEN, "duration": 1}, "AssemblyError", "B"),
    ("run", {"catalogue": "four-bra"}, "UnknownNameError", "four-bar"),
    ("describe", {"file": "broken.toml"}, "FileFormatError", "broken.toml"),
    ("describe", {"file": "numpy.py"}, "FileFormatError", "suffix"),
    ("reactions", FOUR_BAR | {"joints": ["Q"]}, "UnknownNameError", "Q"),
    ("sweep", FOUR_BAR | {"duration": 0.1, "parameters": {"crank.mas": [1.0]}}, "ArgumentError", "crank.mass"),
    ("sweep", FOUR_BAR | {"parameters": {"crank.mass": [1.0, 1.0]}}, "ArgumentError", "parameters.crank.mass"),
    ("sweep", FOUR_BAR | {"parameters": {n: list(range(1, 30)) for n in "ab"}}, "ArgumentError", str(MEMBERS)),
    ("sweep", FOUR_BAR, "ArgumentError", "parameters"),
    ("plot", FOUR_BAR | {"duration": 0.1, "what": ["nonsense"]}, "UnknownNameError", "nonsense"),
    ("export", FOUR_BAR | {"format": "toml", "to": "x.py"}, "ArgumentError", ".toml"),
    ("export", FOUR_BAR | {"format": "toml", "to": "no/x.toml"}, "MissingFileError", "no/x.toml"),
]  # fmt: skip


def test_errors_are_results_that_say_what_to_do(ask: Ask, root: Path) -> None:
    asked = [local(root, tool, **arguments) for tool, arguments, _, _ in WRONG]
    some = [6, 12, 14, 15, 17]  # refused by the server, the reader, the solver, and with a file
    assert [refused(ask(WRONG[i][0], **WRONG[i][1])) for i in some] == [asked[i] for i in some]
    for (tool, _, kind, words), error in zip(WRONG, asked, strict=True):
        assert error["kind"] == kind and words in error["message"], (tool, error)
        assert str(root) not in json.dumps(error)


def test_an_answer_that_is_too_long_says_so(ask: Ask) -> None:
    error = refused(ask("reactions", **FOUR_BAR, outputs=5001, series=True))
    assert error["kind"] == "ArgumentError" and f"more than the {ANSWER}" in error["message"]


def test_a_failure_of_the_program_is_a_sentence_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: object) -> None:
        raise ZeroDivisionError("nothing left")

    monkeypatch.setattr("partita.cli.mcp.worker.call", fail)
    got = answer({"tool": "run", "arguments": {}}, Folder.of(str(tmp_path)), Limits())["error"]
    assert got["kind"] == "ZeroDivisionError" and "nothing left" in got["message"]


def test_a_long_call_is_stopped_and_the_next_one_served(tmp_path: Path) -> None:
    with server(tmp_path, "--seconds", "3") as ask:
        start = time.monotonic()
        error = refused(ask("run", **FOUR_BAR, duration=1e7))
        assert error["kind"] == "TimeoutError" and "3 s" in error["message"] and time.monotonic() - start < 20
        assert found(ask("describe", **FOUR_BAR))["mobility"] == 1


@pytest.mark.skipif(
    not sys.platform.startswith("linux"),
    reason="only Linux enforces a limit of memory",
)
def test_a_call_beyond_its_memory_is_stopped(tmp_path: Path) -> None:
    with server(tmp_path, "--memory", str(LEAST)) as ask:
        assert found(ask("draw", **FOUR_BAR))["closes"]
        few = "".join(
            f"""[[body]]
name = "b{i}"
mass = 1.0
inertia = [1.0, 1.0, 1.0]
[[joint]]
name = "j{i}"
type = "revolute"
parent = "{f"b{i - 1}" if i else "ground"}"
child = "b{i}"
point = [{i}.0, 0.0, 0.0]
"""
            for i in range(1000)
        )
        model = f'[mechanism]\npartita = 1\nname = "chain"\n{few}'
        error = refused(ask("run", duration=0.01, outputs=5001, model=model))
        assert error["kind"] == "MemoryError" and f"{LEAST} MB" in error["message"]
        assert len(ask("tools/list").tools) == 10


def test_memory_in_which_no_call_begins_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["mcp", "--root", str(tmp_path), "--memory", str(LEAST - 1)]) == 2
    assert f"memory is {LEAST - 1} MB; a call needs at least {LEAST} MB" in capsys.readouterr().err


def test_what_a_client_cancels_is_stopped(ask: Ask) -> None:
    psutil = pytest.importorskip("psutil")

    def command(process: Any) -> list[str]:
        try:
            return cast(list[str], process.cmdline())
        except psutil.NoSuchProcess:  # ended since it was listed, perhaps not yet waited for
            return []

    def workers() -> int:
        return sum("partita.cli.mcp.worker" in command(child) for child in psutil.Process().children(recursive=True))

    found(ask("describe"))
    with pytest.raises(Exception, match=r"(?i)timed out"):
        ask("run", **FOUR_BAR, duration=1e7, give_up=1.0)
    end = time.monotonic() + 20
    while workers() > 1 and time.monotonic() < end:
        time.sleep(0.1)
    assert workers() == 1  # the one that waits for the next call


def test_the_command_says_what_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["mcp", "--root", str(tmp_path / "no")]) == 2
    assert "make it first" in capsys.readouterr().err
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert main(["mcp", "--root", str(tmp_path)]) == 2
    assert "pip install 'partita[mcp]'" in capsys.readouterr().err
