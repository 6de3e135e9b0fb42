"""Names of the release before: each still works, warns with the name to use, and files written with it still load."""

import json
import pickle
import warnings
from collections.abc import Callable
from typing import Any

import pytest

import partita as pt
from partita import deprecated
from partita.cli.printing import plain
from partita.results import Certificate, Finding
from partita.results.record import Record


def pendulum() -> pt.Mechanism:
    m = pt.Mechanism("pendulum")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    return m


@pytest.fixture(scope="module")
def run() -> pt.Result:
    return pendulum().simulate(0.1)


@pytest.fixture(scope="module")
def report() -> dict[str, Any]:
    return pendulum().report().to_dict()


FINDINGS = {"valid": (), "suspect": (Finding(False, 0.0, "x"),), "invalid": (Finding(True, 0.0, "x"),)}


def listed() -> list[tuple[str, str, Callable[[Any, Any], tuple[Any, Any]]]]:
    """Old name, new name, and both values as a program reads them."""
    cases: list[tuple[str, str, Callable[[Any, Any], tuple[Any, Any]]]] = []
    for old, new in deprecated.ERRORS.items():
        cases.append((old, new, lambda r, d, o=old, n=new: (getattr(pt.errors, o), getattr(pt.errors, n))))  # type: ignore[misc]
    for old, new in deprecated.CERTIFICATE.items():
        cases.append((old, new, lambda r, d, o=old, n=new: (getattr(r.certificate, o), getattr(r.certificate, n))))  # type: ignore[misc]
    for old, new in deprecated.FINDING.items():
        one = FINDINGS["invalid"][0]
        cases.append((old, new, lambda r, d, o=old, n=new, f=one: (getattr(f, o), getattr(f, n))))  # type: ignore[misc]
    for old, new in deprecated.COUNTERS.items():
        cases.append((old, new, lambda r, d, o=old, n=new: (r.counters[o], r.counters[n])))  # type: ignore[misc]
    for old, new in deprecated.OPTIONS.items():
        cases.append((old, new, lambda r, d, o=old, n=new: (r.options[o], r.options[n])))  # type: ignore[misc]
    for old, new in deprecated.REPORT.items():
        cases.append((old, new, lambda r, d, o=old, n=new: (d[o], d[n])))  # type: ignore[misc]
    return cases


@pytest.mark.parametrize(("old", "new", "both"), listed())
def test_an_old_name_means_the_new_one_and_warns(
    run: pt.Result, report: dict[str, Any], old: str, new: str, both: Callable[[Any, Any], tuple[Any, Any]]
) -> None:
    with pytest.warns(DeprecationWarning, match=f"{old}.* is deprecated; use .*{new}") as caught:
        was, now = both(run, report)
    assert was is now or was == now
    assert len(caught) == 1 and caught[0].filename == __file__


@pytest.mark.parametrize(("old", "new"), deprecated.VERDICTS.items())
def test_an_old_verdict_compares_equal_and_warns(run: pt.Result, old: str, new: str) -> None:
    certificate = Certificate(**{**vars(run.certificate), "findings": FINDINGS[new]})
    assert certificate.verdict == new
    with pytest.warns(DeprecationWarning, match=f'"{old}" is deprecated; use "{new}"'):
        assert certificate.verdict == old
    with pytest.warns(DeprecationWarning):
        differs = certificate.verdict != old
    assert not differs
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        others = [word for word in (*deprecated.VERDICTS, *FINDINGS, "") if word not in (old, new)]
        assert not any(certificate.verdict == word for word in others)
        assert {certificate.verdict: 1} == {new: 1} and run.status == "finished"


def test_the_old_option_is_taken_and_warns() -> None:
    m = pendulum()
    with pytest.warns(DeprecationWarning, match="exchange= is deprecated; use switch_threshold=") as caught:
        run = m.simulate(0.1, exchange=1.5)
    assert run.options["switch_threshold"] == 1.5 and caught[0].filename == __file__
    with pytest.warns(DeprecationWarning, match="switch_threshold="):
        m.stepper(0.1, exchange=1.5)
    with (
        pytest.warns(DeprecationWarning, match="switch_threshold="),
        pytest.raises(pt.errors.ArgumentError, match=r"0\.5"),
    ):
        m.simulate(0.1, exchange=0.5)


def test_files_of_the_release_before_still_load(run: pt.Result) -> None:
    """An account with every old name becomes the record that was written."""
    record = run._record
    account = json.loads(json.dumps(record.account()))
    old = json.loads(json.dumps(account))
    for where, names in ((old, deprecated.CERTIFICATE), (old["counters"], deprecated.COUNTERS),
                         (old["options"], deprecated.OPTIONS)):  # fmt: skip
        for was, now in names.items():
            where[was] = where.pop(now)
    old["misfit"], old["status"] = 1e-4, "broken"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read = Record.from_account(old, record.arrays)
    assert read.geometric_error == 1e-4 and read.status == "invalid"
    assert read.counters == record.counters and read.options == account["options"]
    stored = vars(run.certificate) | {"misfit": 1e-4}
    del stored["geometric_error"]
    assert Certificate.from_account(stored).geometric_error == 1e-4


def test_renamed_keys_survive_a_copy_and_json_has_both(report: dict[str, Any]) -> None:
    again = pickle.loads(pickle.dumps(report))
    assert again == report and list(again) == list(report)
    with pytest.warns(DeprecationWarning):
        assert "cures" in again and again.get("freedoms") == 1
    assert again.get("nothing") is None and "nothing" not in again
    with pytest.raises(KeyError, match="nothing"):
        again["nothing"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        printed = plain(report)
    assert all(printed[old] == printed[new] for old, new in deprecated.REPORT.items())
