"""Joints, forces, tables and curves of every kind drawn by chance, against the independent program."""

from __future__ import annotations

from collections import Counter

from oracle import elements
from oracle.comparison import Verdict
from oracle.elements import compare_elements
from oracle.study import report

# Every number is a mechanism; `make trust` looks at thousands more.
SEEDS = range(24)


def test_mechanisms_with_every_element_agree() -> None:
    found: dict[int, tuple[Verdict, Counter[str]]] = {seed: compare_elements(seed) for seed in SEEDS}
    wrong = [seed for seed, (verdict, _) in found.items() if verdict.wrong]
    assert not wrong, "\n\n".join(report(seed, found[seed][0], elements.mechanism) for seed in wrong[:2])
    counts = sum((verdict.counts for verdict, _ in found.values()), Counter[str]())
    ran = Counter[str]()
    for verdict, kinds in found.values():
        ran += kinds if verdict.counts["relative run"] and verdict.counts["absolute run"] else Counter()
    assert counts["power"] > 4 * counts["instants"] and counts["effort"] > 30
    assert min(ran[kind] for kind in elements.EVERY) > 0, ran
