"""A stored result changed in one place and sealed anew by a stranger: it is refused by its type, or can be used."""

from __future__ import annotations

import copy
import json
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from thorough import either

import partita as pt
from partita.errors import FileFormatError, PartitaError
from partita.files import BLANK, sealed

KeyPath = tuple[str | int, ...]
GONE = object()
OTHERS: tuple[Any, ...] = (
    GONE, None, "x", "", -1, 3, 1e300, 10**30, True, [], {}, [[]], [None], ["x"], [1, 2, 3], [[1.0], [2.0]],
    {"not finite": "nan"}, {"not finite": "x"}, "NaN", "Infinity",
)  # fmt: skip


def document_of(path: Path) -> dict[str, Any]:
    """A four-bar beside a driven shaft with a gear, and a body on a ball: every part of an account has entries."""
    m = pt.catalogue.load("four-bar")
    for name in ("ball", "shaft", "wheel"):
        m.add_body(name, mass=1.0, inertia=(1.0, 1.0, 1.0))
    m.add_spherical("S", m.ground, "ball", point=(0, 0, 0))
    m.add_revolute("P", m.ground, "shaft", point=(0, 0, 0))
    m.add_revolute("W", m.ground, "wheel", point=(0, 0, 0))
    m.add_gear("P", "W", 2.0)
    m.add_drive("P", lambda t: 3.0 * t)
    m.add_sensor("tip", ("ball", (1, 0, 0)), "acceleration")
    passes = pt.Event("passes", "P", value=0.15)
    m.simulate(0.1, t_eval=[0.0, 0.05, 0.1], events=[passes]).save(path)
    found: dict[str, Any] = json.loads(path.read_text("utf-8"))
    return found


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return document_of(tmp_path_factory.mktemp("stored") / "run.json")


def key_paths(document: Any, keys: KeyPath = ()) -> Iterator[KeyPath]:
    """Every place but the mechanism's description and numbers deep in arrays; of lists the first two entries."""
    if keys:
        yield keys
    if keys[:2] == ("account", "spec") or (keys[:1] == ("arrays",) and len(keys) > 4):
        return
    if isinstance(document, dict):
        for key, item in document.items():
            yield from key_paths(item, (*keys, key))
    elif isinstance(document, list):
        for i, item in enumerate(document[:2]):
            yield from key_paths(item, (*keys, i))


def changed(document: dict[str, Any], keys: KeyPath, value: Any) -> bytes:
    """The file with something else in one place, and a right seal."""
    new = copy.deepcopy(document)
    at: Any = new
    for key in keys[:-1]:
        at = at[key]
    if value is GONE:
        del at[keys[-1]]
    else:
        at[keys[-1]] = value
    new["checksum"] = BLANK
    return sealed(json.dumps(new).encode("utf-8"))


def uses(run: Any, folder: Path) -> Iterator[Callable[[], Any]]:
    """All that one does with a result."""
    yield lambda: (repr(run), run._repr_html_(), str(run.certificate), run.title, run.units, run.message)
    yield lambda: (run.certificate.verdict, run.partitions, run.notes, run.counters, run.options, run.independent)
    yield lambda: (run.energy.total, run.energy.balance, run.measure)
    yield lambda: (run.at_once.determined, run.at_once.checks, run.at_once.reactions)
    for name in run.names.joints:
        yield lambda name=name: [
            (j.force, j.position, j.velocity, j.acceleration, j.determined, j.in_frame("joint").moment, repr(j))
            for j in [run.joint(name)]
        ]
    for name in run.names.bodies:
        yield lambda name=name: (run.body(name).position, repr(run.body(name)))
    for name in run.sensors:
        yield lambda name=name: (run.sensor(name).values, repr(run.sensor(name)))
    yield lambda: run.coupling("gear P - W").effort
    yield lambda: run.drive("drive of P").effort
    yield lambda: (
        repr(run.events),
        run.events._repr_html_(),
        run.events.t,
        [e.before.position("A") for e in run.events],
    )
    yield run.to_xarray
    yield lambda: run.state()
    yield lambda: run.state(0.03)
    yield lambda: run.save(folder / "again.csv")
    yield lambda: run.save(folder / "again.json")


def tried(document: dict[str, Any], keys: KeyPath, value: Any, folder: Path) -> str:
    """How it ends: "refused", "used", or the place and the error that is none of Partita's."""
    path = folder / "run.json"
    path.write_bytes(changed(document, keys, value))
    where = f"{keys} = {'gone' if value is GONE else value!r}"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run = pt.results.load_result(path)
    except FileFormatError:
        return "refused"
    except Exception as error:
        return f"{where}, loaded: {type(error).__name__}: {error}"
    for use in uses(run, folder):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                use()
        except PartitaError:
            pass
        except Exception as error:
            return f"{where}, used: {type(error).__name__}: {error}"
    return "used"


def test_a_resealed_result_is_refused_or_can_be_used(stored: dict[str, Any], tmp_path: Path) -> None:
    """A random draw of all key paths and contents; the same on every machine."""
    every = [(keys, value) for keys in key_paths(stored) for value in OTHERS]
    rng = np.random.default_rng(24)
    found = [tried(stored, *every[i], tmp_path) for i in rng.choice(len(every), either(100, 250), replace=False)]
    assert not [words for words in found if words not in ("refused", "used")]
    assert found.count("refused") > len(found) // 5 and found.count("used") > len(found) // 25


@pytest.mark.parametrize(
    ("keys", "value"),
    [
        (("account", "summary", "bodies", 0, "name"), None),
        (("account", "summary", "joints", 0, "q", 0), None),
        (("account", "summary", "joints", 0, "state_q"), GONE),
        (("account", "summary", "joints", 0, "state_q"), "x"),
        (("account", "summary", "joints", 0, "state_q", 0), 10**30),
        (("account", "summary", "joints", 0, "axes"), None),
        (("account", "summary", "joints", 0, "drawn"), [1, 2, 3]),
        (("account", "summary", "joints", 0, "drawn"), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        (("account", "summary", "couplings"), None),
        (("account", "summary", "drives"), None),
        (("account", "summary", "removed", 0), {}),
        (("account", "summary", "notes"), None),
        (("account", "notes"), None),
        (("account", "message"), None),
        (("account", "certificate", "closure"), "x"),
        (("account", "certificate", "sigma"), []),
        (("account", "certificate", "sigma_t"), None),
        (("account", "summary", "couplings", 0, "rows"), [1, 2, 3]),
        (("account", "summary", "drive_rows"), [1, 2, 3]),
        (("account", "events", "records"), 3),
        (("account", "events", "records", 0, "q"), [1.0]),
        (("account", "events", "records", 0, "t"), "x"),
        (("account", "events", "records", 0, "direction"), 3),
        (("arrays", "work"), GONE),
        (("arrays",), {}),
        (("arrays", "vdot"), GONE),
        (("arrays", "effort", "shape", 0), GONE),
    ],
)
def test_what_was_an_error_of_python_is_refused(
    stored: dict[str, Any], keys: KeyPath, value: Any, tmp_path: Path
) -> None:
    assert tried(stored, keys, value, tmp_path) == "refused"


def main() -> int:
    """Every place with every content: minutes."""
    folder = Path(tempfile.mkdtemp())
    document = document_of(folder / "stored.json")
    ends = [tried(document, keys, value, folder) for keys in key_paths(document) for value in OTHERS]
    wrong = [words for words in ends if words not in ("refused", "used")]
    print("\n".join(wrong[:40]))
    print(f"{len(ends)} files: {ends.count('refused')} refused, {ends.count('used')} used, {len(wrong)} raw errors")
    return int(bool(wrong))


if __name__ == "__main__":
    raise SystemExit(main())
