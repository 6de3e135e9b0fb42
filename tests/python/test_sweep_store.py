"""Sweeps on disk: continued after any crash with nothing done twice, equal to those in one go; what is refused."""

import errno
import importlib.util
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent import futures
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from pressing import heard
from thorough import either

import partita as pt
from partita.sweep import batches, identity, store

xarray = pytest.importorskip("xarray")

MODEL = '''
import os
import time
from pathlib import Path

import numpy as np

CALLS = Path(__file__).with_name("calls")
FACTOR = 3.0


def helper(x):
    return FACTOR * x


def unused():
    return 1


def study(x, name):
    """Members of all kinds; each call is written down."""
    with CALLS.open("a") as file:
        file.write(f"{os.getpid()} {x} {name}\\n")
    time.sleep(0.001)
    if x % 50 == 7:
        raise ValueError(f"{x} is out of reach: \\u03b1")
    return {"product": helper(x), "path": np.linspace(0.0, x, 3), "count": x, "text": name * (x % 3), "odd": x % 2 == 1}
'''
GRID: dict[str, list[Any]] = {"x": list(range(150)), "name": ["a", "bc"]}
SMALL: dict[str, list[Any]] = {"x": [1, 2, 7, 8], "name": ["a", "bc"]}


def loaded(path: Path) -> ModuleType:
    """The file as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """A module that workers and other processes can import."""
    path = tmp_path / "store_study.py"
    path.write_text(MODEL, "utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), str(Path(pt.__file__).parents[1])]))
    yield loaded(path)
    del sys.modules["store_study"]


def calls(study: ModuleType) -> Counter[str]:
    """How often each member was computed."""
    text = study.CALLS.read_text("utf-8") if study.CALLS.exists() else ""
    return Counter(line.partition(" ")[2] for line in text.splitlines())


def identical(found: Any, wanted: Any) -> bool:
    """Bit for bit: values, types, labels and their order."""
    same = found.identical(wanted) and list(found.variables) == list(wanted.variables)
    return same and all(
        found[name].dtype == wanted[name].dtype and found[name].values.tobytes() == wanted[name].values.tobytes()
        for name in wanted.variables
        if wanted[name].dtype.kind != "O"
    )


def named(member: int, grid: dict[str, list[Any]] = GRID) -> str:
    """A member as the study writes it down."""
    x, name = divmod(member, len(grid["name"]))
    return f"{grid['x'][x]} {grid['name'][name]}"


KILLED_AT_HALF = """
import os, signal, sys
import partita as pt
import store_study

def report(part):
    if part >= 0.5:
        os.kill(os.getpid(), signal.SIGKILL)

if __name__ == "__main__":
    grid = {{"x": list(range(150)), "name": ["a", "bc"]}}
    pt.sweep(store_study.study, grid, executor={executor}, workers=2, batch={batch}, store=sys.argv[1], progress=report)
"""


def killed_at_half(study: ModuleType, executor: str, batch: str, place: Path) -> None:
    """A sweep in another process, which is killed when it has half of the members."""
    script = place.with_name("killed.py")
    script.write_text(KILLED_AT_HALF.format(executor=executor, batch=batch), "utf-8")
    ended = subprocess.run([sys.executable, script, place], timeout=120, capture_output=True, text=True)
    assert ended.returncode == -signal.SIGKILL, ended.stderr


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGKILL on Windows")
@pytest.mark.parametrize(
    ("executor", "batch"), either([("'processes'", "20")], [("'processes'", "20"), ("'threads'", "3"), ("None", "1")])
)
def test_a_killed_parent_is_continued(study: ModuleType, executor: str, batch: str, tmp_path: Path) -> None:
    """What the store has is not computed again; only batches that were under way are. The workers end as well."""
    killed_at_half(study, executor, batch, tmp_path / "runs")
    half = pt.load_sweep(tmp_path / "runs")
    known = np.flatnonzero(half.failed.values.ravel() != "not computed")
    assert 150 <= len(known) < 300
    workers = {int(line.split()[0]) for line in study.CALLS.read_text("utf-8").splitlines()}
    deadline = time.monotonic() + 10.0
    while any(Path(f"/proc/{worker}").exists() for worker in workers) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(Path(f"/proc/{worker}").exists() for worker in workers)
    before = calls(study)
    found = pt.sweep(study.study, GRID, store=tmp_path / "runs")
    counted = calls(study)
    assert all(counted[named(member)] == 1 for member in known)
    assert sum(counted.values()) - sum(before.values()) == 300 - len(known)
    assert sum(counted.values()) - 300 <= (0 if executor == "None" else 2 * batches.AHEAD * int(batch))
    assert identical(found, pt.sweep(study.study, GRID)) and identical(pt.load_sweep(tmp_path / "runs"), found)


@pytest.mark.parametrize("executor", [None, "threads"])
@pytest.mark.parametrize("batch", ["auto", 1, 3, 1000])
def test_any_way_gives_the_same(study: ModuleType, executor: str | None, batch: Any, tmp_path: Path) -> None:
    wanted = pt.sweep(study.study, SMALL)
    found = pt.sweep(study.study, SMALL, executor=executor, workers=2, batch=batch, store=tmp_path / "a")
    assert identical(found, wanted) and identical(pt.load_sweep(tmp_path / "a"), wanted)
    assert found["count"].dtype == float
    assert wanted.failed.sel(x=7, name="a").item() == "ValueError: 7 is out of reach: α"


def test_a_log_cut_anywhere_is_continued(study: ModuleType, tmp_path: Path) -> None:
    """A crash within a batch, a member or a head: what is complete is kept, the rest is computed."""
    wanted = pt.sweep(study.study, SMALL, store=tmp_path / "runs")
    log = tmp_path / "runs" / store.LOG
    content = log.read_bytes()
    kept = []
    for length in [*range(0, len(content), 61), len(content) - 1]:
        log.write_bytes(content[:length])
        kept.append(int((pt.load_sweep(tmp_path / "runs").failed != "not computed").sum()))
        study.CALLS.unlink(missing_ok=True)
        assert identical(pt.sweep(study.study, SMALL, store=tmp_path / "runs"), wanted)
        assert sum(calls(study).values()) == 8 - kept[-1]
    assert kept == sorted(kept) and set(kept) == set(range(8))
    log.write_bytes(content + bytes(1000))  # a file system may leave zeros behind
    assert identical(pt.sweep(study.study, SMALL, store=tmp_path / "runs"), wanted)
    assert log.stat().st_size == len(content)


def test_damage_is_refused(study: ModuleType, tmp_path: Path) -> None:
    pt.sweep(study.study, SMALL, store=tmp_path / "runs")
    log, header = tmp_path / "runs" / store.LOG, tmp_path / "runs" / store.HEADER
    content = log.read_bytes()
    for place in (0, 3, 20, len(content) // 2):
        log.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
        for use in (pt.load_sweep, lambda path: pt.sweep(study.study, SMALL, store=path)):
            with pytest.raises(pt.errors.FileFormatError, match=r"damaged: bytes \d+ to \d+ are not what was written"):
                use(tmp_path / "runs")
    log.write_bytes(content)
    for spoilt in (b"", b"{", header.read_bytes().replace(b"true", b"null")):
        header.write_bytes(spoilt)
        with pytest.raises(pt.errors.FileFormatError, match=r"damaged: sweep.json"):
            pt.sweep(study.study, SMALL, store=tmp_path / "runs")


def test_another_sweep_is_refused(study: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pt.sweep(study.study, SMALL, store=tmp_path / "runs")
    before = (tmp_path / "runs" / store.LOG).read_bytes()
    samples = [{"x": 1, "name": "a"}]
    for parameters, words in (
        ({**SMALL, "x": [1, 2, 7]}, "4 values of 'x', not 3"),
        ({**SMALL, "x": [1, 2, 7, 9]}, "value 3 of 'x' is 8 there, 9 here"),
        ({**SMALL, "x": [1.0, 2, 7, 8]}, "value 0 of 'x' is 1 there, 1.0 here"),
        ({"name": SMALL["name"], "x": SMALL["x"]}, "parameters are x, name, not name, x"),
        (samples, "it has a grid, not samples"),
    ):
        with pytest.raises(pt.errors.ArgumentError, match=words) as refused:
            pt.sweep(study.study, parameters, store=tmp_path / "runs")  # type: ignore[arg-type]
        assert "belongs to another sweep" in str(refused.value) and refused.value.fields["argument"] == "store"
    with pytest.raises(pt.errors.ArgumentError, match=r"model is store_study.study, not .*<lambda>"):
        pt.sweep(lambda x, name: x, SMALL, store=tmp_path / "runs")
    monkeypatch.setattr(study, "FACTOR", 4.0)
    with pytest.raises(pt.errors.ArgumentError, match=r"the code or the constants of store_study\.study have changed"):
        pt.sweep(study.study, SMALL, store=tmp_path / "runs")
    monkeypatch.undo()
    monkeypatch.setattr(store, "version", lambda: "9.9")
    with pytest.raises(pt.errors.ArgumentError, match=r"written by Partita [\d.]+, this is 9.9"):
        pt.sweep(study.study, SMALL, store=tmp_path / "runs")
    assert (tmp_path / "runs" / store.LOG).read_bytes() == before
    pt.load_sweep(tmp_path / "runs")


def test_a_model_is_its_code_and_what_it_uses(tmp_path: Path) -> None:
    """Comments and what is not used do not count; functions and constants of the module do."""

    def digest(name: str, *changes: str) -> str:
        path = tmp_path / f"{name}.py"
        text = MODEL
        for change in changes:
            old, _, new = change.partition(" -> ")
            assert old in text
            text = text.replace(old, new)
        path.write_text(text, "utf-8")
        return identity.digest_of(loaded(path).study)

    same = digest("one")
    assert digest("two", "return 1 -> return 2", "FACTOR = 3.0 -> FACTOR = 3.0  # times") == same
    changed = {
        digest("three", "FACTOR = 3.0 -> FACTOR = 3.5"),
        digest("four", "FACTOR * x -> FACTOR + x"),
        digest("five", "x % 50 -> x % 60"),
        digest("six", "(x, name) -> (x, name, more=1)"),
        same,
    }
    assert len(changed) == 5
    number, factors = [1.0], np.arange(3.0)
    first = identity.digest_of(lambda x: x * number[0] + factors)
    assert first == identity.digest_of(lambda x: x * number[0] + factors)
    number[0] = 2.0
    assert first != identity.digest_of(lambda x: x * number[0] + factors)


def test_two_parents_are_refused(study: ModuleType, tmp_path: Path) -> None:
    """Of one process, and of two; reading goes on."""
    seen: list[int] = []

    def second(part: float) -> None:
        with pytest.raises(pt.errors.FileFormatError, match="this process is writing to the store"):
            pt.sweep(study.study, SMALL, store=tmp_path / "x" / ".." / "runs")
        seen.append(int((pt.load_sweep(tmp_path / "runs").failed != "not computed").sum()))

    (tmp_path / "x").mkdir()
    pt.sweep(study.study, SMALL, store=tmp_path / "runs", progress=second)
    assert seen == list(range(1, 9))
    waits = (
        "import sys, partita as pt, store_study\n"
        "def report(part):\n"
        "    print('here', flush=True)\n"
        "    sys.stdin.readline()\n"
        "pt.sweep(store_study.study, {'x': [1], 'name': ['a']}, store=sys.argv[1], progress=report)"
    )
    place = tmp_path / "others"
    with subprocess.Popen(
        [sys.executable, "-c", waits, place], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None and other.stdin is not None
        assert other.stdout.readline() == "here\n"
        with pytest.raises(pt.errors.FileFormatError, match=f"process {other.pid} on .* is writing to the store"):
            pt.sweep(study.study, {"x": [1], "name": ["a"]}, store=place)
        other.kill()
    study.CALLS.unlink()
    pt.sweep(study.study, {"x": [1], "name": ["a"]}, store=place)
    assert not calls(study)


def test_places_that_are_no_store_are_refused(study: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "diary.txt").write_text("x")
    (tmp_path / "older").mkdir()
    (tmp_path / "older" / store.LOG).write_bytes(b"x")
    for place, error, words in (
        (tmp_path / "file", pt.errors.FileFormatError, "is a file"),
        (tmp_path / "full", pt.errors.FileFormatError, r"contains diary.txt but no sweep.json"),
        (tmp_path / "older", pt.errors.FileFormatError, r"contains members.log but no sweep.json"),
        (tmp_path / "none" / "runs", pt.errors.MissingFileError, "does not exist"),
        (tmp_path / "runs.nc", pt.errors.ArgumentError, "'runs.zarr' to find the dataset there"),
        (3, pt.errors.ArgumentError, "name of a file"),
        ("", pt.errors.ArgumentError, "name of a file"),
    ):
        with pytest.raises(error, match=words):
            pt.sweep(study.study, SMALL, store=place)
    for place in (tmp_path / "none", tmp_path / "full"):
        with pytest.raises(pt.errors.MissingFileError, match="store"):
            pt.load_sweep(place)
    assert not calls(study) and not (tmp_path / "runs.nc").exists()
    if sys.platform == "linux":
        with pytest.raises(pt.errors.FileFormatError, match="cannot use the store '/proc/runs'"):
            pt.sweep(study.study, SMALL, store="/proc/runs")


def test_a_folder_that_cannot_be_written_is_refused_before_work(
    study: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "runs").mkdir()
    opened = os.open

    def read_only(path: Any, *arguments: Any, **options: Any) -> int:
        if "runs" in str(path):
            raise OSError(errno.EROFS, "Read-only file system")
        return opened(path, *arguments, **options)

    monkeypatch.setattr(os, "open", read_only)
    with pytest.raises(pt.errors.FileFormatError, match="Read-only file system"):
        pt.sweep(study.study, SMALL, store=tmp_path / "runs")
    assert not calls(study)


@pytest.mark.parametrize("executor", [None, "threads"])
def test_a_full_disk_keeps_what_fits(
    study: ModuleType, executor: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    room, write = [600], os.write

    def full(stream: int, content: Any) -> int:
        if len(content) > 60:
            if room[0] <= 0:
                raise OSError(errno.ENOSPC, "No space left on device")
            room[0], content = room[0] - 200, content[:200]
        return write(stream, content)

    monkeypatch.setattr(store.os, "write", full)
    with pytest.raises(pt.errors.FileFormatError, match="No space left on device; it has all members before"):
        pt.sweep(study.study, SMALL, executor=executor, batch=1, store=tmp_path / "runs")
    monkeypatch.undo()
    known = int((pt.load_sweep(tmp_path / "runs").failed != "not computed").sum())
    assert 0 < known < 8
    assert identical(pt.sweep(study.study, SMALL, store=tmp_path / "runs"), pt.sweep(study.study, SMALL))


def test_failures_are_data(tmp_path: Path) -> None:
    """A full batch of failures, its reasons kept; they are not tried again."""
    tried = tmp_path / "tried"

    def model(x: int) -> float:
        with tried.open("a") as file:
            file.write(f"{x}\n")
        if 4 <= x < 8:
            raise RuntimeError(f"no {x}")
        return float(x)

    for executor in (None, "threads"):
        found = pt.sweep(model, {"x": range(12)}, executor=executor, batch=4, store=tmp_path / "runs")  # type: ignore[dict-item]
        assert found.failed.values.tolist() == [f"RuntimeError: no {x}" if 4 <= x < 8 else "" for x in range(12)]
        assert np.isnan(found.value.values[4:8]).all() and found.value.values[11] == 11.0
        assert tried.read_text().split() == [str(x) for x in range(12)]
    with pytest.raises(pt.errors.ArgumentError, match=r"every member failed; the first, {'x': 4}: RuntimeError: no 4"):
        pt.sweep(model, {"x": [4, 5]}, store=tmp_path / "fails")
    assert pt.load_sweep(tmp_path / "fails").failed.values.tolist() == ["RuntimeError: no 4", "RuntimeError: no 5"]


def test_what_a_store_cannot_hold_is_said(tmp_path: Path) -> None:
    def model(x: float) -> Any:
        return {"good": x, "odd": object()} if x else {"good": x}

    found = pt.sweep(model, {"x": [0.0, 1.0]}, store=tmp_path / "runs")
    assert found.failed.values.tolist() == [
        "",
        "odd is of type object, which a store cannot hold; return numbers or texts",
    ]
    with pytest.raises(pt.errors.ArgumentError, match="which a store cannot hold"):
        pt.sweep(model, {"x": [(1, 2)]}, store=tmp_path / "others")  # type: ignore[list-item]
    assert not (tmp_path / "others").exists()


def test_values_come_back_bit_for_bit(tmp_path: Path) -> None:
    values: dict[str, Any] = {
        "nan": np.frombuffer(b"\x01\x00\x00\x00\x00\x00\xf8\x7f", float)[0],
        "zero": -0.0,
        "big": 2**63 - 1,
        "complex": complex(np.inf, -0.0),
        "single": np.float32(0.1),
        "text": "α\0β",
        "bytes": b"ab",
        "when": np.datetime64("2020-01-01T00:00:01", "s"),
        "empty": np.zeros((0, 3)),
        "turned": np.arange(6.0).reshape(2, 3).T,
        "truth": True,
    }
    grid: dict[str, Any] = {"x": [1, 2.5, -np.inf], "z": [1 + 2j], "flag": [True, False], "word": ["é"]}

    def model(x: float, z: complex, flag: bool, word: str) -> dict[str, Any]:
        return values

    found = pt.sweep(model, grid, store=tmp_path / "runs")
    assert identical(found, pt.sweep(model, grid)) and identical(pt.load_sweep(tmp_path / "runs"), found)
    assert found.nan.values.tobytes()[:8] == values["nan"].tobytes() and found.big.dtype == np.int64


def test_a_store_named_zarr_is_one(study: ModuleType, tmp_path: Path) -> None:
    pytest.importorskip("zarr")
    place = tmp_path / "runs.zarr"
    stopped = False

    def stop(part: float) -> None:
        nonlocal stopped
        if part > 0.5 and not stopped:
            stopped = True
            signal.raise_signal(signal.SIGINT)

    with heard(), pytest.raises(pt.errors.Interrupted, match="the same sweep continues there") as interrupted:
        pt.sweep(study.study, SMALL, store=place, progress=stop)
    with xarray.open_zarr(place, chunks=None) as there:
        assert there.load().equals(interrupted.value.result)
    found = pt.sweep(study.study, SMALL, store=place)
    with xarray.open_zarr(place, chunks=None) as there:
        assert there.load().equals(found)
    assert sum(calls(study).values()) == 8
    assert identical(pt.load_sweep(place), found) and identical(found, pt.sweep(study.study, SMALL))


class Backwards(futures.Executor):
    """Computes what it is given in the reverse order, two batches at a time."""

    _max_workers = 2

    def __init__(self) -> None:
        self.waiting: list[tuple[futures.Future[Any], Any, Any]] = []

    def submit(self, function: Any, /, *arguments: Any, **options: Any) -> futures.Future[Any]:
        future: futures.Future[Any] = futures.Future()
        self.waiting.append((future, function, arguments))
        if len(self.waiting) == 4 or len(arguments[1]) == 1:
            for other, call, given in reversed(self.waiting):
                other.set_result(call(*given))
            self.waiting.clear()
        return future


def test_the_order_of_arrival_does_not_matter(tmp_path: Path) -> None:
    """Also where shapes and types of the answers differ."""

    def model(x: int) -> dict[str, Any]:
        return {"a": np.zeros(2 + (x > 3)), "b": x if x < 5 else x + 0.5, **({"c": 1} if x == 6 else {})}

    wanted = pt.sweep(model, {"x": range(9)})  # type: ignore[dict-item]
    assert [bool(why) for why in wanted.failed.values] == [x > 3 for x in range(9)]
    found = pt.sweep(model, {"x": range(9)}, executor=Backwards(), batch=1, store=tmp_path / "a")  # type: ignore[dict-item]
    assert identical(found, wanted) and identical(pt.load_sweep(tmp_path / "a"), wanted)


def test_an_executor_that_ends_leaves_the_rest(tmp_path: Path) -> None:
    """What it did not compute is no failure of the members: the store continues."""
    pool = futures.ThreadPoolExecutor(1)

    def model(x: int) -> int:
        if x == 20 and pool is not None:
            pool.shutdown(wait=False, cancel_futures=True)
        return x

    found = pt.sweep(model, {"x": range(100)}, executor=pool, batch=5, store=tmp_path / "runs")  # type: ignore[dict-item]
    why = set(found.failed.values.tolist())
    assert len(why) == 2 and any("not computed: the executor accepts no more work" in text for text in why)
    known = (found.failed == "").values
    assert known[:25].all() and not known.all()
    pool = None  # type: ignore[assignment]
    assert not (pt.sweep(lambda x: x, {"x": range(100)}).failed != "").any()  # type: ignore[dict-item]
