"""The same bits on every machine: from what is typed to a description, and to the first numbers of a run."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from partita.products import det, inverse, inverse_pose, matmul, nearest_rotation, norm, norms, principal

KERNELS = ("Haswell", "SkylakeX", "Zen", "Prescott")
"""Kinds of processors for which the library of NumPy's products has other orders of summation."""
DESCRIBED = """
import hashlib, json, logging
logging.getLogger("partita").setLevel(logging.ERROR)
import partita as pt
made = {name: json.dumps(pt.catalogue.load(name).to_spec(), default=str) for name in pt.catalogue.names()}
print(json.dumps({name: hashlib.sha256(text.encode()).hexdigest() for name, text in made.items()}))
"""


def test_descriptions_are_the_same_by_every_kernel() -> None:
    """All of the catalogue, in a process of its own each; where the library has one kernel alone, that one."""
    found = []
    for kernel in KERNELS:
        words = [sys.executable, "-c", DESCRIBED]
        done = subprocess.run(words, env={**os.environ, "OPENBLAS_CORETYPE": kernel}, capture_output=True, text=True)
        assert not done.returncode, done.stderr
        found.append(json.loads(done.stdout))
    assert len(found[0]) > 80
    for kernel, other in zip(KERNELS, found, strict=True):
        assert {name for name, mark in other.items() if mark != found[0][name]} == set(), kernel


def test_small_products_are_those_of_numpy_to_rounding() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        a, b, v = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), rng.normal(size=3)
        stack, wide = rng.normal(size=(4, 3, 3)), rng.normal(size=(3, 2))
        for one, two in ((a, b), (a, v), (v, a), (v, v), (stack, v), (stack, wide), (a, (1, 0, 2))):
            assert np.abs(matmul(one, two) - np.asarray(one) @ np.asarray(two)).max() < 1e-14
        assert norm(v) == pytest.approx(np.linalg.norm(v), rel=1e-15)
        assert np.abs(norms(a) - np.linalg.norm(a, axis=1)).max() < 1e-15
        assert det(a) == pytest.approx(np.linalg.det(a), abs=1e-13)
        assert np.abs(inverse(a) @ a - np.eye(3)).max() < 1e-10
        left, _, right = np.linalg.svd(a)
        assert np.abs(nearest_rotation(a) - left @ right).max() < 1e-10
        turned, pose = left * np.linalg.det(left), np.eye(4)
        pose[:3, :3], pose[:3, 3] = turned, v
        assert np.abs(inverse_pose(pose) @ pose - np.eye(4)).max() < 1e-14
        values, axes = principal(a + a.T)
        assert np.abs(values - np.linalg.eigvalsh(a + a.T)).max() < 1e-13
        assert np.abs(axes * values @ axes.T - (a + a.T)).max() < 1e-13


def test_lengths_neither_overflow_nor_vanish() -> None:
    for size in (1e-320, 1e-200, 1.0, 1e200, 1e307):
        assert norm((3.0 * size, 4.0 * size)) == pytest.approx(5.0 * size, rel=1e-3 if size < 1e-300 else 1e-15)
    assert norm(()) == norm((0.0, 0.0)) == 0.0 and np.isinf(norm((np.inf, 1.0)))
    values, _ = principal(np.diag([3.0, 1.0, 2.0]))
    assert values.tolist() == [1.0, 2.0, 3.0]


def test_shapes_that_have_no_product_are_refused() -> None:
    for a, b in ((np.ones((3, 3)), np.ones(2)), (2.0, np.ones(3)), (np.ones(3), np.ones((2, 3, 3)))):
        with pytest.raises(ValueError, match="no product"):
            matmul(a, b)
