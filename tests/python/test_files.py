"""Files: whole or not there, and damage is noticed: what is read is right, or a typed error says which file it is."""

from __future__ import annotations

import json
import os
import resource
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from thorough import either

import partita as pt
from partita import results
from partita.errors import ChangedFileWarning, FileFormatError, MissingFileError, PartitaError
from partita.files import BLANK, sealed

FLIPS = either(60, 200)
ENDINGS = (".json", ".nc", ".zarr", ".csv", ".mat", ".parquet")


@pytest.fixture(scope="module")
def run() -> results.Result:
    return pt.catalogue.load("four-bar").simulate(0.2, t_eval=np.linspace(0.0, 0.2, 5))


def flipped(content: bytes, number: int) -> bytes:
    """`content` with one bit the other way round, anywhere."""
    bit = int(np.random.default_rng(number).integers(8 * len(content)))
    changed = bytearray(content)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def reported(result: results.Result) -> list[bytes]:
    """All numbers and texts of a result."""
    arrays = {**result.arrays, **result.at_once.observed, **result.at_once.reactions}
    words = json.dumps([result.notes, result.message, result.counters, str(result.certificate), result.spec])
    return [*(np.asarray(a, dtype=float).tobytes() for a in arrays.values()), words.encode()]


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_flipped_bit_is_noticed(run: results.Result, tmp_path: Path, ending: str) -> None:
    path = run.save(tmp_path / f"run{ending}")
    right = reported(run)
    assert reported(pt.load_result(path)) == right
    files = [p for p in sorted(path.rglob("*")) if p.is_file()] or [path]
    files = files[:: 1 if len(files) == 1 else either(4, 1)]
    flips = [(file, number) for number, file in enumerate((files * FLIPS)[: FLIPS if len(files) == 1 else len(files)])]
    for file, number in flips:  # the seal covers every byte
        content = file.read_bytes()
        if not content:
            continue
        file.write_bytes(flipped(content, number))
        with pytest.raises(FileFormatError, match=path.name) as caught:
            pt.load_result(path)
        assert caught.value.path == str(path)
        file.write_bytes(content)


def test_a_folder_that_lost_or_got_a_file_is_noticed(run: results.Result, tmp_path: Path) -> None:
    path = run.save(tmp_path / "run.zarr")
    for file in [p for p in sorted(path.rglob("*")) if p.is_file()][::9]:
        content = file.read_bytes()
        file.unlink()
        with pytest.raises(FileFormatError, match="checksum"):
            pt.load_result(path)
        file.write_bytes(content)
    (path / "more").write_bytes(b"")
    with pytest.raises(FileFormatError, match="checksum"):
        pt.load_result(path)


def test_a_folder_of_others_is_never_replaced(run: results.Result, tmp_path: Path) -> None:
    path = tmp_path / "run.zarr"
    path.mkdir()
    (path / "mine.txt").write_text("mine")
    with pytest.raises(FileFormatError, match="it is a folder"):
        run.save(path)
    assert (path / "mine.txt").read_text() == "mine"


def test_a_folder_takes_the_place_of_an_older_one_and_of_a_file(run: results.Result, tmp_path: Path) -> None:
    path = tmp_path / "run.zarr"
    path.write_text("a file")
    for _ in range(2):
        run.save(path)
        assert [p.name for p in tmp_path.iterdir()] == ["run.zarr"] and reported(pt.load_result(path)) == reported(run)


def test_a_folder_that_cannot_be_put_in_place_leaves_the_old_one(
    run: results.Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = run.save(tmp_path / "run.zarr")
    replace = os.replace

    def failing(source: Path, goal: Path) -> None:
        if str(source).endswith(".part"):
            raise OSError("no more")
        replace(source, goal)

    monkeypatch.setattr(os, "replace", failing)
    with pytest.raises(FileFormatError, match="unchanged"):
        run.save(path)
    assert [p.name for p in tmp_path.iterdir()] == ["run.zarr"] and reported(pt.load_result(path)) == reported(run)


@pytest.mark.parametrize("ending", [ending for ending in ENDINGS if ending != ".zarr"])
def test_a_truncated_file_is_noticed(run: results.Result, tmp_path: Path, ending: str) -> None:
    path = run.save(tmp_path / f"run{ending}")
    content = path.read_bytes()
    for length in [*range(0, 200, 7), *range(0, len(content), len(content) // 50)]:
        path.write_bytes(content[:length])
        with pytest.raises(FileFormatError, match=path.name):
            results.load_result(path)
    path.write_bytes(content + b" ")
    with pytest.raises(FileFormatError, match="checksum"):
        results.load_result(path)


def test_a_damaged_page_of_parquet_is_noticed_by_those_who_ask(run: results.Result, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    path = run.save(tmp_path / "run.parquet")
    assert parquet.read_table(path, page_checksum_verification=True).num_rows == 5
    column = parquet.read_metadata(path).row_group(0).column(1)
    content = bytearray(path.read_bytes())
    content[column.dictionary_page_offset + column.total_compressed_size - 1] ^= 1  # the last byte of its last page
    path.write_bytes(content)
    with pytest.raises(OSError):
        parquet.read_table(path, page_checksum_verification=True)


def test_a_flipped_bit_in_a_model_file_is_noticed(tmp_path: Path) -> None:
    m = pt.catalogue.load("four-bar")
    path = tmp_path / "m.toml"
    m.save(path)
    content, right = path.read_bytes(), m.to_spec()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert pt.load(path).to_spec() == right
    noticed = 0
    for number in range(FLIPS):
        path.write_bytes(flipped(content, number))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                same = pt.load(path).to_spec() == right
            except FileFormatError as error:
                assert error.path == str(path)
                noticed += 1
                continue
        changed = [w for w in caught if issubclass(w.category, ChangedFileWarning)]
        noticed += bool(changed)
        assert same or changed
    assert noticed > FLIPS // 2


def test_an_edited_model_file_is_read_with_a_warning_or_without_its_seal(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    pt.catalogue.load("four-bar").save(path)
    edited = path.read_text().replace("-9.81", "-1.62")
    path.write_text(edited)
    with pytest.warns(ChangedFileWarning, match="Delete that line"):
        assert json.loads(json.dumps(pt.load(path).to_spec()))["gravity"][1] == -1.62
    path.write_text("\n".join(line for line in edited.splitlines() if "sha256" not in line))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pt.load(path)


def _drop(*keys: str) -> Callable[[Any], None]:
    def change(document: Any) -> None:
        for key in keys[:-1]:
            document = document[int(key) if key.isdigit() else key]
        del document[keys[-1]]

    return change


def _put(value: Any, *keys: str) -> Callable[[Any], None]:
    def change(document: Any) -> None:
        for key in keys[:-1]:
            document = document[int(key) if key.isdigit() else key]
        document[keys[-1]] = value

    return change


TAMPERED = {
    "no arrays": _drop("arrays"),
    "no account": _drop("account"),
    "arrays a list": _put([1], "arrays"),
    "account a word": _put("x", "account"),
    "no times": _drop("arrays", "t"),
    "no coordinates": _drop("arrays", "q"),
    "times fall": _put([0.2, 0.1, 0.0, -0.1, -0.2], "arrays", "t", "values"),
    "a time too few": _put({"type": "number", "shape": [4], "values": [0, 1, 2, 3]}, "arrays", "t"),
    "a shape that lies": _put([5, 99], "arrays", "q", "shape"),
    "a negative shape": _put([-5, -3], "arrays", "q", "shape"),
    "a shape beyond all memory": _put([10**18], "arrays", "q", "shape"),
    "text for numbers": _put(["x"], "arrays", "q", "values"),
    "a joint without a name": _drop("account", "summary", "joints", "0", "name"),
    "a joint without a place": _put(None, "account", "summary", "joints", "0", "q"),
    "a joint with a number for a name": _put(3, "account", "summary", "joints", "0", "name"),
    "bodies missing": _drop("account", "summary", "bodies"),
    "joints a number": _put(7, "account", "summary", "joints"),
    "velocities a word": _put("A", "account", "summary", "velocities"),
    "no partitions": _put([{}], "account", "partitions"),
    "success a word": _put("yes", "account", "success"),
    "options a list": _put([], "account", "options"),
    "summary null": _put(None, "account", "summary"),
    "an independent coordinate that is none": _put(99, "arrays", "independent", "values"),
}


@pytest.mark.parametrize("name", TAMPERED)
def test_a_tampered_result_with_a_good_seal_is_refused(run: results.Result, tmp_path: Path, name: str) -> None:
    path = run.save(tmp_path / "run.json")
    document = json.loads(path.read_text())
    document["checksum"] = BLANK
    TAMPERED[name](document)
    path.write_bytes(sealed(json.dumps(document).encode()))
    with pytest.raises(FileFormatError, match=r"run\.json"):
        results.load_result(path)


def written(run: results.Result, path: Path) -> None:
    match path.suffix:
        case ".toml":
            pt.catalogue.load("four-bar").save(path)
        case ".html":
            run.to_html(path)
        case ".png":
            run.plot("energy", path=path)
        case _:
            run.save(path)


@pytest.mark.parametrize("ending", [*(e for e in ENDINGS if e != ".zarr"), ".toml", ".html", ".png"])
def test_a_full_disk_leaves_the_old_file(run: results.Result, tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"run{ending}"
    path.write_bytes(b"old")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))  # no file may grow beyond 100 bytes
    try:
        with pytest.raises(FileFormatError, match="cannot write") as caught:
            written(run, path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert caught.value.path == str(path) and isinstance(caught.value.__cause__, OSError)
    assert [p.name for p in tmp_path.iterdir()] == [path.name] and path.read_bytes() == b"old"


@pytest.mark.parametrize("path", [None, 3, b"x.json", "", "x\0.json", object(), [], "y" * 5000 + ".json"])
def test_what_is_no_path_is_reported(run: results.Result, path: Any) -> None:
    for use in (run.save, run.to_html, pt.load_result, pt.load, pt.catalogue.load("four-bar").save):
        with pytest.raises(PartitaError):
            use(path)


def test_places_that_are_no_files(run: results.Result, tmp_path: Path) -> None:
    for name in ("a.json", "a.toml", "a.html"):
        (tmp_path / name).mkdir()
        with pytest.raises(FileFormatError, match="folder"):
            written(run, tmp_path / name)
        with pytest.raises(MissingFileError, match="make it first"):
            written(run, tmp_path / "none" / name)
    for load in (pt.load_result, pt.load):
        with pytest.raises(PartitaError):
            load(tmp_path)


@pytest.mark.parametrize("ending", [".json", ".csv", ".zarr"])
def test_many_save_to_one_path_at_once(run: results.Result, tmp_path: Path, ending: str) -> None:
    """Each writes beside the path under a name of its own; whoever comes last stays, whole."""
    if ending == ".zarr":
        pytest.importorskip("zarr")
    path = tmp_path / f"run{ending}"
    run.save(path)
    failed: list[Exception] = []

    def save() -> None:
        try:
            for _ in range(either(1 if ending == ".zarr" else 3, 3)):
                run.save(path)
        except Exception as error:
            failed.append(error)

    writers = [threading.Thread(target=save) for _ in range(2)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert not failed
    assert np.array_equal(results.load_result(path).q, run.q)
    assert [left.name for left in tmp_path.iterdir()] == [path.name]
