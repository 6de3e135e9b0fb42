"""Building the wheel of this machine into dist/, and proving what is said of it.

python tools/wheels.py                      the wheel for this system, from its own linker
python tools/wheels.py --zig                for Linux with glibc 2.28 or newer, whatever this machine has
python tools/wheels.py --target TRIPLE      for another system; its Rust target must be installed
python tools/wheels.py --address URL        links of the front page lead into this repository, at the tag of the version
python tools/wheels.py --whole              the binary inside FMUs as it is, for tools that rewrite the module
python tools/wheels.py --check FILE|FOLDER  build nothing, look at what is there

The wheel holds the module, the binary inside FMUs, the package's files and nothing else; no folder of this machine
stands in it; its binaries need no newer system than its name says; for Linux it is smaller than 8.3 MB. The binary
inside FMUs is stored as its difference to the module, whose code it shares. `tools/install_check.py` then installs
and uses it.
"""

from __future__ import annotations

import argparse
import base64
import contextlib
import hashlib
import importlib.util
import lzma
import os
import platform
import re
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import linking
import zipping

ROOT = Path(__file__).resolve().parents[1]
LARGEST = 8.0e6
"""Bytes of a wheel for Linux: five sixths are the module."""
LARGEST_ELSEWHERE = 9.5e6
"""Where the linker does not put similar functions beside each other (see `linking.py`)."""
FMU = "partita/_fmu"
WEB = "partita/_web"
"""The core inside pages, which no wheel holds: it would be a quarter larger."""
GLIBC = "2_28"
"""Oldest glibc of the wheels for Linux, of 2018: that of NumPy's and SciPy's."""
MUSL = "1_2"
LICENCES = ("LICENSE-APACHE", "LICENSE-MIT")
LIBRARIES = {"libpartita_fmu.so", "libpartita_fmu.dylib", "partita_fmu.dll"}
DELTAS = {f"{name}.delta" for name in LIBRARIES}
MODULES = re.compile(r"partita/_core(\.abi3)?(\.[\w-]+)?\.(so|pyd)")
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\((?!https?:|#)([^)\s]+)\)")
"""Links of Markdown to files beside it."""


def main(given: list[str]) -> int:
    """Build what is asked for, and look at it; 1 if it is not as it should be."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--target", metavar="TRIPLE", help="Rust target; default: this system")
    parser.add_argument("--zig", action="store_true", help="link with zig, for an older glibc, or for musl")
    parser.add_argument("--interpreter", help="build for this Python alone, as one without a lock needs")
    parser.add_argument("--address", default="", help="address of the repository")
    parser.add_argument("--whole", action="store_true", help="store the binary inside FMUs as it is")
    parser.add_argument("--out", type=Path, default=ROOT / "dist")
    parser.add_argument("--check", type=Path, help="a wheel, or a folder of wheels")
    asked = parser.parse_args(given)
    if asked.check is None:
        wheel, library, module = build(asked.target, asked.zig, asked.interpreter, asked.out)
        repack(wheel, asked.address, library, asked.whole, module)
        wheels = [wheel]
    else:
        wheels = [asked.check] if asked.check.is_file() else sorted(asked.check.glob("*.whl"))
        if not wheels:
            raise SystemExit(f"there is no wheel in {asked.check}")
    for wheel in wheels:
        found = [word for look in LOOKS for word in look(wheel)]
        print(f"{wheel.name}: {wheel.stat().st_size / 1e6:.2f} MB", *found, sep="\n  ")
        if found:
            return 1
    return 0


def build(target: str | None, zig: bool, interpreter: str | None, out: Path) -> tuple[Path, Path, Path | None]:
    """The wheel as maturin makes it; the binary inside FMUs, for which most of the core is not compiled again; and,
    where zig links, the module to be put into the wheel."""
    programs = Path(sys.executable).parent
    folder = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    environment = {**os.environ, "RUSTFLAGS": flags(target), "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}"}
    triple, tag, kept = target, f"musllinux_{MUSL}", None
    if zig:
        target = target or f"{platform.machine()}-unknown-linux-gnu"
        if not target.endswith("musl"):
            triple, tag = f"{target}.{GLIBC.replace('_', '.')}", f"manylinux_{GLIBC}"
        variable = f"CARGO_TARGET_{target.upper().replace('-', '_')}_LINKER"
        kept = folder / "linkers" / str(triple or target).replace("-unknown-", "-")
        environment[variable] = str(linker(kept, programs))
    for path in out.glob("*.whl"):
        path.unlink()
    command = [str(programs / "maturin"), "build", "--profile", "wheel", "--locked", "--out", str(out)]
    command += ["--target", target] if target else []
    command += ["--zig", "--compatibility", tag] if zig else []
    command += ["--interpreter", interpreter] if interpreter is not None else []
    run(command, environment)
    # asked for by way of its test, cargo takes the core of the module; asked for alone, one with fewer features
    command = ["cargo", "zigbuild" if zig else "build", "--profile", "wheel", "--locked", "--workspace"]
    run([*command, "--test", "fmu_wall", *(["--target", str(triple)] if triple else [])], environment)
    (wheel,) = out.glob("*.whl")
    if kept is not None:
        module, library = linking.arranged(kept)
        return wheel, library, module
    made = folder / (target or "") / "wheel" / "deps"
    (library,) = (made / name for name in LIBRARIES if (made / name).is_file())
    return wheel, library, None


def linker(kept: Path, programs: Path) -> Path:
    """One linker for both builds, `linking.py`: cargo compiles everything again where its path is another one."""
    path = kept.parent / f"{kept.name}.sh"
    path.parent.mkdir(parents=True, exist_ok=True)
    command = f'"{sys.executable}" "{ROOT / "tools" / "linking.py"}" "{kept}" {kept.name} "$@"'
    path.write_text(f'#!/bin/sh\nPATH="{programs}:$PATH" exec {command}\n', "utf-8")
    path.chmod(0o755)
    return path


def flags(target: str | None) -> str:
    """Flags of the compiler: folders of this machine leave no trace."""
    cargo = Path(os.environ.get("CARGO_HOME", Path.home() / ".cargo"))
    sources = sorted((cargo / "registry" / "src").glob("*"))
    found = [os.environ.get("RUSTFLAGS", "")]
    found += [f"--remap-path-prefix={path}=" for path in (cargo, ROOT, *sources)]
    if "musl" in (target or ""):
        found += ["-C target-feature=-crt-static"]  # else no library can be loaded
    return " ".join(found).strip()


def run(command: list[str], environment: dict[str, str]) -> None:
    """Run a command in this folder; its failure ends this program."""
    print("+", *command, flush=True)
    subprocess.run(command, cwd=ROOT, env=environment, check=True)


def package_page(text: str, address: str, version: str) -> str:
    """The front page as a package index shows it: links lead into the repository or, without an address, are words."""

    def absolute(found: re.Match[str]) -> str:
        picture, words, path = found.groups()
        if not address:
            return "" if picture else words
        return f"{picture}[{words}]({address.rstrip('/')}/{'raw' if picture else 'blob'}/v{version}/{path})"

    return LINK.sub(absolute, text)


def repack(wheel: Path, address: str, library: Path, whole: bool = False, linked: Path | None = None) -> None:
    """The same wheel with the front page of a package, the addresses of the project, the module as it was linked last,
    the binary inside FMUs as it is or as its difference to the module, and its files packed closely."""
    packed = wheel.with_suffix(".new")
    added = {f"{FMU}/{name}": (ROOT / name).read_bytes() for name in LICENCES}
    with zipfile.ZipFile(wheel) as old:
        (module,) = (name for name in old.namelist() if MODULES.fullmatch(name))
        binary, core = library.read_bytes(), old.read(module) if linked is None else linked.read_bytes()
        if whole:
            added[f"{FMU}/{library.name}"] = binary
        else:
            added[f"{FMU}/{library.name}.delta"] = difference(core, binary)
        replaced = {**added, module: core}
    with zipfile.ZipFile(wheel) as old:
        record: zipfile.ZipInfo | None = None
        rows, files = "", list[tuple[zipfile.ZipInfo, bytes]]()
        kept = [item for item in old.infolist() if not item.filename.startswith(f"{FMU}/")]
        about = next(i for i, item in enumerate(kept) if ".dist-info/" in item.filename)
        for name in reversed(added):
            kept.insert(about, zipfile.ZipInfo(name, kept[0].date_time))
            kept[about].external_attr = kept[0].external_attr
        for item in kept:
            data = replaced[item.filename] if item.filename in replaced else old.read(item)
            if item.filename.endswith(".dist-info/METADATA"):
                head, _, page = data.decode("utf-8").partition("\n\n")
                version = re.search(r"^Version: (.*)$", head, flags=re.MULTILINE)
                assert version is not None
                head += "".join(f"\nProject-URL: {name}, {url}" for name, url in urls(address, version[1]).items())
                data = f"{head}\n\n{package_page(page, address, version[1])}".encode()
            elif "/sboms/" in item.filename:  # the list of crates names ours by their folders
                data = data.replace(ROOT.as_posix().encode(), b"partita")
            elif item.filename.endswith(".dist-info/RECORD"):
                record = item
                continue
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            files.append((item, data))
            rows += f"{item.filename},sha256={digest},{len(data)}\n"
        assert record is not None
    files.append((record, f"{rows}{record.filename},,\n".encode()))
    zipping.write(packed, files, zipping.by_zlib if whole else zipping.by_libdeflate)
    packed.replace(wheel)


def difference(module: bytes, library: bytes) -> bytes:
    """What is stored of the binary inside FMUs: its difference to the module, compressed."""
    from bsdiff4 import core  # of constraints-wheels.txt

    stored = delta().stored(module, library, *core.diff(module, library))
    return lzma.compress(stored, preset=9 | lzma.PRESET_EXTREME)


def delta() -> Any:
    """The module of the package that applies differences, without the package, which is not installed here."""
    known = importlib.util.spec_from_file_location("delta", ROOT / "python" / "partita" / "io" / "delta.py")
    assert known is not None and known.loader is not None
    module = importlib.util.module_from_spec(known)
    known.loader.exec_module(module)
    return module


def urls(address: str, version: str) -> dict[str, str]:
    """The places of the project, by their names on a package page."""
    if not address:
        return {}
    base = address.rstrip("/")
    return {
        "Source": base,
        "Documentation": f"{base}/blob/v{version}/docs/index.md",
        "Changelog": f"{base}/blob/v{version}/CHANGELOG.md",
        "Issues": f"{base}/issues",
    }


def size(wheel: Path) -> list[str]:
    """What is wrong with its size; the binary inside FMUs does not count where it is stored as it is."""
    with zipfile.ZipFile(wheel) as archive:
        whole = [x.compress_size for x in archive.infolist() if x.filename.removeprefix(f"{FMU}/") in LIBRARIES]
    found = wheel.stat().st_size - sum(whole)
    most = LARGEST if "linux" in wheel.name else LARGEST_ELSEWHERE
    return [f"it has {found / 1e6:.2f} MB; {most / 1e6:g} MB are the most"] if found >= most else []


def sources() -> set[str]:
    """The files of the package: those under version control, or, in a source archive, those that are there."""
    folder = ROOT / "python"
    if (ROOT / ".git").exists():
        command = ["git", "ls-files", "partita"]
        return set(
            subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout.split("\n")
        ) - {""}
    there = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    built = (FMU, WEB, "__pycache__")
    return {name for name in there if not any(x in name for x in built) and not MODULES.fullmatch(name)}


def contents(wheel: Path) -> list[str]:
    """What it lacks, and what should not be there."""
    wanted = sources() | {f"{FMU}/{name}" for name in LICENCES}
    with zipfile.ZipFile(wheel) as archive:
        there = {name for name in archive.namelist() if ".dist-info/" not in name}
        about = {name.partition(".dist-info/")[2] for name in archive.namelist()} - {""}
    module = {name for name in there if MODULES.fullmatch(name)}
    library = {name for name in there if name in {f"{FMU}/{file}" for file in LIBRARIES | DELTAS}}
    found = [f"it lacks {name}" for name in sorted(wanted - there)]
    found += [f"it holds {name}" for name in sorted(there - wanted - module - library)]
    for what, group in (("the module", module), ("the binary inside FMUs", library)):
        found += [f"it has {len(group)} of {what}"] if len(group) != 1 else []
    known = {"METADATA", "WHEEL", "RECORD", "entry_points.txt", *(f"licenses/{name}" for name in LICENCES)}
    return found + [f"it holds {name}" for name in sorted(about - known) if not name.startswith("sboms/")]


def opened(wheel: Path) -> dict[str, bytes]:
    """All its files by name, the binary inside FMUs as it will be in them if it can be restored."""
    with zipfile.ZipFile(wheel) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    module = next((data for name, data in files.items() if MODULES.fullmatch(name)), b"")
    for name in [name for name in files if name.removeprefix(f"{FMU}/") in DELTAS]:
        with contextlib.suppress(ValueError):
            files[name.removesuffix(".delta")] = delta().applied(module, lzma.decompress(files[name]))
            del files[name]
    return files


def restored(wheel: Path) -> list[str]:
    """Differences that are not to the module beside them."""
    left = DELTAS & {name.removeprefix(f"{FMU}/") for name in opened(wheel)}
    return [f"its {name} is not a difference to its module" for name in sorted(left)]


def folders(wheel: Path) -> list[str]:
    """Folders of the machine that built it, in any of its files."""
    homes = {os.path.expanduser("~"), str(ROOT), os.environ.get("CARGO_HOME", "registry/src/")} - {"", "/"}
    wanted = {name.encode() for home in homes for name in (home, home.replace(os.sep, "/"))}
    return [
        f"{name} holds the folder {folder.decode()}"
        for name, data in opened(wheel).items()
        for folder in sorted(wanted)
        if re.search(rb"(?<![\w.-])" + re.escape(folder) + rb"(?![\w.-])", data)
    ]


def newest_glibc(wheel: Path) -> list[str]:
    """Symbols of a glibc newer than the wheel's name says, in the module or in the binary inside FMUs."""
    named = re.search(r"manylinux_(\d+)_(\d+)", wheel.name)
    if named is None:
        return []
    most = int(named[1]), int(named[2])
    found = []
    for name, data in opened(wheel).items():
        needed = [(int(a), int(b)) for a, b in re.findall(rb"\0GLIBC_(\d+)\.(\d+)", data)]
        newest = max(needed, default=most)
        if newest > most:
            found.append(f"{name} needs glibc {newest[0]}.{newest[1]}, the wheel says {most[0]}.{most[1]}")
    return found


def links(wheel: Path) -> list[str]:
    """Links of its page that lead nowhere from there."""
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        page = archive.read(name).decode("utf-8")
    return [f"its page links to {path}, which is not beside it" for _, _, path in LINK.findall(page)]


LOOKS = (size, contents, restored, folders, newest_glibc, links)
"""What is looked at: each says what is wrong."""

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
