"""What is installed, by which name, and what a release builds: the places that say so agree."""

from __future__ import annotations

import base64
import hashlib
import json
import lzma
import random
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import partita as pt
from partita.cli import main
from partita.io import delta, fmu

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tools"))
import install_check  # noqa: E402
import linking  # noqa: E402
import wheels  # noqa: E402
import zipping  # noqa: E402

SYSTEMS = {f"{system}-{kind}" for system in ("linux", "musl", "macos", "windows") for kind in ("x86_64", "aarch64")}


def project() -> dict[str, Any]:
    tomllib = pytest.importorskip("tomllib")
    found: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    return found


def packages(requirements: list[str]) -> set[str]:
    return {re.split(r"[<>=\[ ;]", requirement)[0].lower() for requirement in requirements}


def test_numpy_and_scipy_are_all_that_is_needed() -> None:
    assert packages(project()["dependencies"]) == {"numpy", "scipy"}


def test_the_citation_that_is_offered_is_that_of_the_sources() -> None:
    offered = (ROOT / "docs" / "questions.md").read_text("utf-8").partition("```bibtex")[2].partition("```")[0]
    cited = (ROOT / "CITATION.cff").read_text("utf-8")
    for key, bibtex in (("version", "version"), ("title", "title"), ("doi", "doi")):
        for value in re.findall(rf'^ *(?:- )?{key}: "?([^"\n]+)"?$', cited, flags=re.MULTILINE):
            assert f"{bibtex} = {{{value}}}" in offered, value
    assert f"version = {{{project()['version']}}}" in offered


def test_every_extra_that_an_error_names_exists_and_is_pinned() -> None:
    extras = project()["optional-dependencies"]
    named: set[str] = set()
    for path in (ROOT / "python" / "partita").rglob("*.py"):
        text = path.read_text("utf-8")
        named |= set(re.findall(r"partita\[(\w+)\]", text)) | set(
            re.findall(r'(?:extra|missing)\("[\w.]+", "(\w+)"', text)
        )
    assert {"plots", "netcdf", "zarr", "parquet", "progress", "xarray", "pandas", "robots", "mujoco"} <= named
    assert named <= set(extras)
    files = ("constraints.txt", "constraints-torch.txt")
    pinned = packages([line for name in files for line in (ROOT / name).read_text("utf-8").splitlines()])
    for name, wanted in extras.items():
        group = re.fullmatch(r"partita\[([\w,]+)\]", wanted[0])
        assert set(group.group(1).split(",")) <= set(extras) if group else packages(wanted) <= pinned, name


def test_every_extra_stands_among_the_dependencies() -> None:
    page = (ROOT / "docs" / "dependencies.md").read_text("utf-8")
    rows = [row for row in page.splitlines() if row.startswith("| ")]
    for name, wanted in project()["optional-dependencies"].items():
        for package in packages(wanted) - {"partita"}:
            assert any(package in row.lower() and name in row for row in rows), (name, package)


def test_every_extra_stands_on_the_page_about_installation() -> None:
    page = (ROOT / "docs" / "install.md").read_text("utf-8")
    first = [row.split("|")[1] for row in page.splitlines() if row.startswith("| ")]
    assert set(re.findall(r"`(\w+)`", "".join(first))) >= set(project()["optional-dependencies"])


def test_a_release_builds_every_system_and_uses_what_it_built() -> None:
    yaml = pytest.importorskip("yaml")
    release = yaml.safe_load((ROOT / ".github" / "workflows" / "release.yml").read_text("utf-8"))
    jobs = release["jobs"]
    matrix = jobs["wheels"]["strategy"]["matrix"]
    assert {row["name"] for row in matrix["system"]} == SYSTEMS and matrix["python"] == ["abi3", "3.14t"]
    for row in matrix["system"]:
        assert ("--zig" in row["build"]) == row["name"].startswith(("linux", "musl"))
        assert row["musl"] == (f"{row['name'][5:]}-unknown-linux-musl" if row["name"].startswith("musl") else "")
        assert row["musl"] in row["build"]
    commands = [step.get("run", "") for step in jobs["wheels"]["steps"]]
    (build,) = (i for i, command in enumerate(commands) if "tools/wheels.py" in command)
    uses = [i for i, command in enumerate(commands) if "tools/install_check.py dist" in command]
    (threads,) = (i for i, command in enumerate(commands) if "tests/python/test_threads.py" in command)
    assert len(uses) == 2 and build < min(uses) and build < threads
    assert any("tools/install_check.py dist" in step.get("run", "") for step in jobs["sdist"]["steps"])
    assert set(jobs["publish"]["needs"]) == {"wheels", "sdist"}
    assert jobs["publish"]["permissions"] == {"id-token": "write"} and release["permissions"] == {"contents": "read"}


def test_the_recipe_for_conda_says_what_the_project_says() -> None:
    yaml = pytest.importorskip("yaml")
    text = (ROOT / "recipe" / "meta.yaml").read_text("utf-8")
    version = re.search(r'set version = "(.*)"', text)
    assert version is not None and version[1] == project()["version"] == pt.__version__
    recipe = yaml.safe_load(re.sub(r"\{\{.*?\}\}", "X", re.sub(r"\{%.*%\}", "", text)))
    needed = {item.replace(" ", "") for item in recipe["requirements"]["run"]} - {"python"}
    assert needed == set(project()["dependencies"])
    assert recipe["about"]["license"] == project()["license"]
    assert set(recipe["about"]["license_file"]) == set(project()["license-files"]) == set(wheels.LICENCES)
    assert recipe["about"]["summary"] == project()["description"]


def test_the_page_of_the_package_has_no_link_to_a_file_beside_it() -> None:
    text = (ROOT / "README.md").read_text("utf-8")
    there = wheels.LINK.findall(text)
    assert any(picture for picture, _, _ in there) and len(there) > 20
    for address in ("https://example.org/partita", "https://example.org/partita/", ""):
        page = wheels.package_page(text, address, "1.2.3")
        assert wheels.LINK.findall(page) == []
    page = wheels.package_page(text, "https://example.org/partita", "1.2.3")
    for picture, words, path in there:
        kind = "raw" if picture else "blob"
        assert f"{picture}[{words}](https://example.org/partita/{kind}/v1.2.3/{path})" in page
    assert "docs/" not in wheels.package_page("see [five minutes](docs/five-minutes.md#x)", "", "1.2.3")


METADATA = "Metadata-Version: 2.4\nName: partita\nVersion: 0.1.0\n\n# Partita\n\n![a](docs/a.svg) [b](docs/b.md)\n"


MODULE = b"x\0GLIBC_2.28\0y"


def difference(library: bytes, module: bytes = MODULE) -> bytes:
    """As a wheel stores it, with everything new."""
    control = delta.ROW.pack(0, len(library), 0)
    return lzma.compress(delta.stored(module, library, control, b"", library))


def packed(folder: Path, change: Callable[[dict[str, bytes]], None] = lambda files: None, tag: str = "2_28") -> Path:
    """A wheel whose files are all there and empty but for the module, changed."""
    about = "partita-0.1.0.dist-info"
    files = dict.fromkeys(wheels.sources(), b"")
    files |= {f"{wheels.FMU}/{name}": b"" for name in ("libpartita_fmu.so.delta", *wheels.LICENCES)}
    files |= {
        "partita/_core.abi3.so": MODULE,
        f"{wheels.FMU}/libpartita_fmu.so.delta": difference(b"x\0GLIBC_2.17\0"),
    }
    files |= {f"{about}/METADATA": METADATA.encode(), f"{about}/WHEEL": b"", f"{about}/RECORD": b""}
    change(files)
    path = folder / f"partita-0.1.0-cp310-abi3-manylinux_{tag}_x86_64.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return path


def test_what_is_in_a_wheel_is_looked_at(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    module, library = "partita/_core.abi3.so", f"{wheels.FMU}/libpartita_fmu.so.delta"
    big = bytes(9_600_000)
    cases: list[tuple[Callable[[dict[str, bytes]], Any], str]] = [
        (lambda files: files.pop("partita/py.typed"), "it lacks partita/py.typed"),
        (lambda files: files.pop(library), "it has 0 of the binary inside FMUs"),
        (lambda files: files.pop(module), "it has 0 of the module"),
        (lambda files: files.update({"partita/_core.cp314t.so": b"\0GLIBC_2.5\0"}), "it has 2 of the module"),
        (lambda files: files.update({"tests/test_x.py": b""}), "it holds tests/test_x.py"),
        (
            lambda files: files.update({library: difference(f"\0GLIBC_2.5\0{ROOT}/crates".encode())}),
            f"libpartita_fmu.so holds the folder {ROOT}",
        ),
        (
            lambda files: files.update({library: difference(b"\0GLIBC_2.34\0")}),
            "needs glibc 2.34, the wheel says 2.28",
        ),
        (lambda files: files.update({module: b"signed"}), "delta is not a difference to its module"),
        (lambda files: files.update({module: big, library: difference(b"", big)}), "it has 9."),
    ]
    for change, wanted in cases:
        path = packed(tmp_path, change)
        found = [word for look in wheels.LOOKS if look is not wheels.links for word in look(path)]
        assert any(wanted in word for word in found), (found, wanted)
    path = packed(tmp_path)
    assert wheels.main(["--check", str(path)]) == 1
    assert "its page links to docs/a.svg" in capsys.readouterr().out
    crates = {"partita-0.1.0.dist-info/sboms/partita.json": f'"path+file://{ROOT.as_posix()}/crates/partita"'.encode()}
    path = packed(tmp_path, lambda files: files.update(crates))
    assert any("holds the folder" in word for word in wheels.folders(path))
    binary = tmp_path / "libpartita_fmu.so"
    binary.write_bytes(b"x\0GLIBC_2.17\0 and more")
    monkeypatch.setattr(wheels, "difference", lambda module, library: difference(library, module))
    monkeypatch.setattr(zipping, "by_libdeflate", zipping.by_zlib)
    wheels.repack(path, "https://example.org/partita", binary)
    assert wheels.opened(path)[f"{wheels.FMU}/{binary.name}"] == binary.read_bytes()
    assert wheels.main(["--check", str(tmp_path)]) == 0
    with zipfile.ZipFile(path) as archive:
        page = archive.read("partita-0.1.0.dist-info/METADATA").decode()
        assert "Project-URL: Source, https://example.org/partita\n" in page
        assert "![a](https://example.org/partita/raw/v0.1.0/docs/a.svg)" in page
        rows = [line.split(",") for line in archive.read("partita-0.1.0.dist-info/RECORD").decode().splitlines()]
        assert [row[0] for row in rows] == archive.namelist()
        for name, digest, length in rows[:-1]:
            data = archive.read(name)
            wanted = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).decode().rstrip("=")
            assert digest == f"sha256={wanted}" and int(length) == len(data)
    binary.write_bytes(b"\0GLIBC_2.17\0" + random.Random(0).randbytes(20_000))
    monkeypatch.setattr(wheels, "LARGEST", path.stat().st_size + 10_000)
    wheels.repack(path, "", binary, whole=True)
    assert wheels.opened(path)[f"{wheels.FMU}/{binary.name}"] == binary.read_bytes()
    assert path.stat().st_size > wheels.LARGEST and wheels.size(path) == wheels.contents(path) == []
    with pytest.raises(SystemExit, match="there is no wheel"):
        wheels.main(["--check", str(tmp_path / "none")])


def test_an_archive_that_is_packed_closely_is_read_by_any_reader(tmp_path: Path) -> None:
    path, when = tmp_path / "a.zip", (2026, 11, 27, 23, 59, 58)
    files = {
        "a/empty": b"",
        "a/short": b"x",
        "a/long \u00e4": b"abc" * 5000,
        "a/noise": random.Random(1).randbytes(9000),
    }
    items = [(zipfile.ZipInfo(name, when), data) for name, data in files.items()]
    for item, _ in items:
        item.external_attr = 0o100755 << 16
    zipping.write(path, items, zipping.by_zlib)
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None and {name: archive.read(name) for name in archive.namelist()} == files
        assert {(x.date_time, x.external_attr) for x in archive.infolist()} == {(when, 0o100755 << 16)}
        assert archive.getinfo("a/long \u00e4").compress_size < 100 and archive.getinfo("a/noise").compress_size == 9000


def test_a_difference_gives_the_file_it_was_taken_from() -> None:
    """Copied with changed bytes, new bytes, and a step back; then by hand what bsdiff finds in two files."""
    old, new = bytes(range(250, 256)) + bytes(range(200)), bytes([251, 4, 253]) + b"new" + bytes(range(250, 256))
    rows = [(3, 3, 3 + (1 << 63)), (6, 0, 0)]
    control = b"".join(delta.ROW.pack(*row) for row in rows)
    stored = delta.stored(old, new, control, bytes([1, 9, 1, 0, 0, 0, 0, 0, 0]), b"new")
    assert delta.applied(old, stored) == new
    with pytest.raises(delta.OtherFileError, match="the file has been changed"):
        delta.applied(old + b"x", stored)
    with pytest.raises(delta.OtherFileError, match="the difference is damaged"):
        delta.applied(old, stored[:-1] + b"W")


def test_a_difference_of_real_files_is_small_and_right() -> None:
    core = pytest.importorskip("bsdiff4.core", reason="bsdiff4 is pinned for wheels alone")
    old = (ROOT / "tools" / "wheels.py").read_bytes()
    new = old.replace(b"wheel", b"Wheel")[500:] + old[:900]
    stored = delta.stored(old, new, *core.diff(old, new))
    assert delta.applied(old, stored) == new and len(lzma.compress(stored)) < 0.2 * len(lzma.compress(new))


def test_the_binary_of_a_wheel_is_restored_for_an_fmu(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fmu, "BINARIES", tmp_path)
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    with pytest.raises(pt.errors.MissingDependencyError, match="`make fmu` in its sources builds it"):
        fmu.binary("3.0")
    module = Path(str(fmu._core.__file__)).read_bytes()
    for name in wheels.LIBRARIES:
        (tmp_path / f"{name}.delta").write_bytes(difference(b"stored", module))
    assert fmu.binary("3.0")[1] == b"stored"
    for damaged in (difference(b"stored", module + b"signed"), b"no archive"):
        for name in wheels.LIBRARIES:
            (tmp_path / f"{name}.delta").write_bytes(damaged)
        with pytest.raises(pt.errors.MissingDependencyError, match="install Partita again from its wheel"):
            fmu.binary("3.0")
    monkeypatch.setitem(sys.modules, "lzma", None)
    with pytest.raises(pt.errors.MissingDependencyError, match="this Python has no lzma"):
        fmu.binary("3.0")
    for name in wheels.LIBRARIES:
        (tmp_path / name).write_bytes(b"as built")
    assert fmu.binary("3.0")[1] == b"as built"


def test_a_wheel_is_for_the_pythons_that_can_load_it() -> None:
    shared, own = Path("partita-0.1.0-cp310-abi3-x.whl"), Path("partita-0.1.0-cp314-cp314t-x.whl")
    assert [install_check.fits(shared, version) for version in ("3.10", "3.14", "3.14t")] == [True, True, False]
    assert [install_check.fits(own, version) for version in ("3.14", "3.14t", "3.15t")] == [False, True, False]
    here = f"{sys.version_info[0]}.{sys.version_info[1]}"
    assert any(version.rstrip("t") == here for version in install_check.pythons())


def test_the_first_five_minutes_are_commands_and_blocks() -> None:
    """What `make wheels` follows by the letter."""
    assert install_check.commands("five-minutes.md") == ["python -m venv .venv", INSTALL]
    install, first = install_check.commands("index.md")[:2]
    assert install.split("#")[0].strip() == "pip install partita" and first.startswith("partita simulate")
    assert "after release" in install
    assert len(install_check.blocks("five-minutes.md")) >= 4
    front = (ROOT / "README.md").read_text("utf-8")
    assert [line.split("#")[0].strip() for line in install_check.COMMAND.findall(front)[:3]] == [
        "python -m venv .venv && . .venv/bin/activate",
        "python -m pip install '.[plots,netcdf,completion]'",
        "partita simulate four-bar --html four-bar.html",
    ]


INSTALL = ".venv/bin/python -m pip install partita"


def test_the_check_of_an_installation_refuses_what_it_cannot_find(tmp_path: Path) -> None:
    tool = ROOT / "tools" / "install_check.py"
    done = subprocess.run([sys.executable, tool, tmp_path], capture_output=True, text=True)
    assert done.returncode == 1 and "no wheel and no source archive" in done.stderr


def test_the_first_animation_is_one_command_or_ten_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As they stand on the page, in an empty folder."""
    page = (ROOT / "docs" / "index.md").read_text("utf-8").partition("## First animation")[2].partition("\n## ")[0]
    monkeypatch.chdir(tmp_path)
    command = re.search(r"^    partita (.*)$", page, flags=re.MULTILINE)
    lines = re.search(r"```python\n(.*?)```", page, flags=re.DOTALL)
    assert command is not None and lines is not None
    assert main(command[1].split()) == 0
    assert lines[1].count("\n") <= 10
    exec(compile(lines[1], "index.md", "exec"), {})
    assert capsys.readouterr().err == ""
    for name in ("four-bar.html", "mine.html"):
        assert "<canvas" in (tmp_path / name).read_text("utf-8")


SHOWN = """clang version 22
 ld.lld is not called here
ld.lld --gc-sections -o /cache/libm.so.6 -soname libm.so.6 /cache/m.o
ld.lld --gc-sections -o /cache/libc.so.6 -soname libc.so.6 /cache/c.o
ld.lld --gc-sections -o {0} {1}/list {1}/a.rlib {1}/libc.so.6 -lc
"""
MAP = """     VMA      LMA     Size Align Out     In      Symbol
    2478a0   2478a0      110    16         /r/libstd.rlib(std.o):(.text._ZN3std4park17h0E)
    2479b0   2479b0      195    16         /r/libstd.rlib(std.o):(.text.unlikely._ZN3std4lock17h1E)
    2479b0   2479b0      195     1                 _ZN3std4lock17h1E
    247b50   247b50       e7    16         /r/libcore.rlib(core.o):(.rodata..L1)
    247b50   247b50       e7    16         /r/libcore.rlib(core.o):(.text._ZN3std4park17h0E)
    247c40   247c40       e7    16         /r/libcore.rlib(core.o):(.text._ZN4core3fmt17h2E)
"""
ZIG = """import pathlib, sys
options = [x for x in sys.argv[1:] if "=" in x]
files = [x for x in sys.argv[1:] if x.startswith("/")]
result = pathlib.Path(files.pop())
shown = {map!r} if "lib_core" in result.name else ""
[pathlib.Path(x.removeprefix("--Map=")).write_text(shown) for x in options if x.startswith("--Map=")]
orders = [pathlib.Path(x.partition("=")[2]).read_text() for x in options if x.startswith("--symbol-ordering")]
result.write_text(" ".join([pathlib.Path(files[0]).read_text(), *options[1:], *orders]))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="the programs of the test are scripts")
def test_what_is_shipped_is_linked_again_with_its_functions_in_one_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def link(linked: str, shown: str = SHOWN, status: int = 0) -> int:
        (tmp_path / "shown").write_text(shown.format(linked, tmp_path))
        zig = f'#!/bin/sh\necho zig "$@"\ncat "{tmp_path / "shown"}" >&2\nexit {status}\n'
        (tmp_path / "cargo-zigbuild").write_text(zig)
        (tmp_path / "cargo-zigbuild").chmod(0o755)
        for name in ("list", "a.rlib", "libc.so.6"):
            (tmp_path / name).write_text(f"{name} of {Path(linked).name}")
        return linking.main([str(kept), "x86_64-linux-gnu.2.28", "a.o", "-o", linked])

    (tmp_path / "ziglang.py").write_text(ZIG.format(map=MAP))
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    kept = tmp_path / "target" / "linkers" / "system"
    assert link("/t/build_script") == 0 and not kept.exists()
    assert "zig zig cc -- -fno-sanitize=all -target x86_64-linux-gnu.2.28 a.o -o /t/build" in capfd.readouterr().out
    assert link("/t/deps/lib_core.so") == 0
    with pytest.raises(SystemExit, match=f"how libpartita_fmu.so was linked: remove {tmp_path / 'target'} and build"):
        linking.arranged(kept)
    assert link("/t/deps/libpartita_fmu.so") == 0
    (tmp_path / "list").unlink()  # as cargo does
    call = json.loads((kept / "lib_core.so" / "call.json").read_text())
    copied = str(kept / "lib_core.so" / "1-list")
    assert call == ["--gc-sections", copied, str(tmp_path / "a.rlib"), str(tmp_path / "libc.so.6"), "-lc"]
    module, binary = linking.arranged(kept)
    order = "_ZN3std4park17h0E\n_ZN3std4lock17h1E\n_ZN4core3fmt17h2E\n"
    for path in (module, binary):
        assert path.read_text() == f"list of {path.name} --symbol-ordering-file={kept / 'order.txt'} {order}"
    for shown in ("", SHOWN, SHOWN.replace("/list", "/of mine/list")):
        with pytest.raises(SystemExit, match=r"no call of its linker for /t/of mine/lib_core\.so, so its functions"):
            link("/t/of mine/lib_core.so", shown)
    assert link("/t/deps/lib_core.so", "ld.lld: error: undefined symbol\n", 1) == 1
    assert "undefined symbol" in capfd.readouterr().err
