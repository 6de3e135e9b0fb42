"""The types of the entries in the record of a stored result: text, numbers, lists, spans."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

Check = Callable[[Any, str], None]
"""Raises `ValueError` for a value that does not belong in a place."""

LARGEST = 1 << 53
"""No count and no index is larger, and larger ones cannot be distinguished as doubles."""


def text(value: Any, where: str) -> None:
    """A text."""
    if not isinstance(value, str):
        raise ValueError(f"{where} is not text")


def flag(value: Any, where: str) -> None:
    """True or false."""
    if not isinstance(value, bool):
        raise ValueError(f"{where} is neither true nor false")


def number(value: Any, where: str) -> None:
    """A number, which need not be finite."""
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or (isinstance(value, int) and abs(value) > LARGEST)
    ):
        raise ValueError(f"{where} is not a number")


def count(value: Any, where: str) -> None:
    """A whole number, not negative."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= LARGEST:
        raise ValueError(f"{where} is not a count")


def anything(value: Any, where: str) -> None:
    """What nobody computes with."""


def either(*checks: Check) -> Check:
    """One of several."""

    def check(value: Any, where: str) -> None:
        for i, one in enumerate(checks):
            try:
                return one(value, where)
            except ValueError:
                if i + 1 == len(checks):
                    raise

    return check


def null(value: Any, where: str) -> None:
    """Nothing."""
    if value is not None:
        raise ValueError(f"{where} is not null")


def many(item: Check) -> Check:
    """A list of any length."""

    def check(value: Any, where: str) -> None:
        if not isinstance(value, list):
            raise ValueError(f"{where} is not a list")
        for i, one in enumerate(value):
            item(one, f"{where}[{i}]")

    return check


def row(*items: Check) -> Check:
    """A list of this length."""

    def check(value: Any, where: str) -> None:
        if not isinstance(value, list) or len(value) != len(items):
            raise ValueError(f"{where} is not a list of {len(items)}")
        for i, (one, item) in enumerate(zip(value, items, strict=True)):
            item(one, f"{where}[{i}]")

    return check


def table(**entries: Check) -> Check:
    """Named entries: those with "may_" before their name are optional; other entries are ignored."""

    def check(value: Any, where: str) -> None:
        if not isinstance(value, Mapping):
            raise ValueError(f"{where} has no entries")
        for key, one in entries.items():
            name = key.removeprefix("may_")
            if name in value:
                one(value[name], f"{where}.{name}")
            elif name == key:
                raise ValueError(f"{where} has no {name}")

    return check


def by_name(item: Check) -> Check:
    """Entries of any names, all of one kind."""

    def check(value: Any, where: str) -> None:
        if not isinstance(value, Mapping):
            raise ValueError(f"{where} has no entries")
        for name, one in value.items():
            item(one, f"{where}.{name}")

    return check


_span = row(count, count)
_maybe_span = either(_span, null)
_maybe_number = either(number, null)
_maybe_text = either(text, null)
_indices = either(many(either(count, null)), count, null)
_finding = row(flag, _maybe_number, text)

SUMMARY = table(
    may_name=_maybe_text,
    rows=count,
    may_closing_rows=count,
    may_rank=count,
    may_mobility=count,
    may_joint_rows=count,
    may_joint_rank=count,
    bodies=many(table(name=text)),
    joints=many(
        table(
            name=text, kind=text, parent=text, child=text, q=_span, v=_span, state_q=_maybe_span, state_v=_maybe_span,
            may_drawn=either(row(*3 * [row(number, number, number)]), null), axes=many(text),
        )
    ),
    may_couplings=many(table(name=text, word=text, rows=many(count))),
    may_drives=many(text),
    may_drive_rows=many(count),
    may_rows_names=many(text),
    may_removed=many(table(row=text, why=text)),
    may_notes=many(text),
    may_sensors=many(table(name=text, variable=text, unit=text, text=text)),
    coordinates=many(text),
    velocities=many(text),
)  # fmt: skip

CERTIFICATE = table(
    closure=number,
    velocity_closure=number,
    energy_balance=_maybe_number,
    newton_euler=_maybe_number,
    sigma=number,
    sigma_t=number,
    sqrt_mu=number,
    sqrt_mu_t=number,
    switches=count,
    corrections=count,
    notes=many(text),
    may_closure_row=_maybe_text,
    may_closure_t=number,
    may_acceleration_closure=_maybe_number,
    may_acceleration_row=_maybe_text,
    may_acceleration_t=number,
    may_worst_body=_maybe_text,
    may_worst_body_t=number,
    bodies=many(row(text, number, number)),
    rank=many(count),
    may_margin=number,
    may_margin_t=number,
    may_geometric_error=number,
    findings=many(_finding),
)

ACCOUNT = table(
    summary=SUMMARY,
    partitions=many(
        table(
            t=number, independent=_indices, dependent=_indices, may_entering=_indices, may_leaving=_indices,
            may_reason=text, may_sigma=_maybe_number, may_sqrt_mu=_maybe_number,
        )
    ),
    notes=many(text),
    counters=by_name(count),
    status=text,
    success=flag,
    message=text,
    may_steps_open=either(row(_maybe_number, _maybe_number), null),
    may_gaps=either(row(_maybe_number, _maybe_number), null),
    may_exchanged=_maybe_number,
    may_geometric_error=_maybe_number,
    may_findings=many(_finding),
    options=by_name(anything),
    may_events=table(
        may_names=many(text),
        may_records=many(
            table(
                name=text, kind=text, direction=number, t=number, q=many(number), v=many(number),
                may_after=many(number), may_impulses=by_name(number), may_energy_lost=number,
                may_joints=by_name(row(row(*6 * [number]), row(*6 * [flag]))),
            )
        ),
    ),
    may_version=text,
    may_certificate=CERTIFICATE,
)  # fmt: skip


def check_account(account: Any) -> None:
    """Raise `ValueError` for the first entry of the wrong type."""
    ACCOUNT(account, "its account")
