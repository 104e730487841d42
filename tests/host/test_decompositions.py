"""Singular values, pseudo-inverses and least squares where LAPACK's divide-and-conquer routines refuse a matrix.

Which finite matrix they refuse depends on processor, threads and version, so that the refusal is played here: numpy's
routines raise as they do then. Sizes are some tens at most, so that rounding is some 1e-15 of the entries.
"""

import ast
from pathlib import Path

import numpy as np
import pytest

import aeolid
from aeolid.decompositions import condition, lstsq, pinv, singular_values, spectral_norm, svd

SOURCES = Path(aeolid.__file__).parent
OURS = ("svd", "svdvals", "pinv", "pinvh", "lstsq", "cond", "matrix_rank")
LOST = np.random.default_rng(0).standard_normal((7, 4)) @ np.diag([1.0, 1e-3, 1e-15, 0.0])
WIDE = np.random.default_rng(1).standard_normal((3, 6))
COMPLEX = np.random.default_rng(2).standard_normal((6, 3)) + 1j * np.random.default_rng(3).standard_normal((6, 3))
EVERY = pytest.mark.parametrize("matrix", [LOST, WIDE, COMPLEX], ids=["rank lost", "wide", "complex"])


@pytest.fixture
def refused(monkeypatch):
    """Let numpy's three routines refuse every matrix; returns how often they were asked."""
    asked = []

    def refuse(*_, **__):
        asked.append(1)
        raise np.linalg.LinAlgError("SVD did not converge")

    for name in ("svd", "pinv", "lstsq"):
        monkeypatch.setattr(np.linalg, name, refuse)
    return asked


def _each(matrix, target):
    solutions = [lstsq(matrix, right, 1e-10) for right in (target, target[:, 0])]
    return singular_values(matrix), pinv(matrix, 1e-10), *solutions


@EVERY
def test_the_slower_routine_finds_the_same(matrix, request):
    target = np.random.default_rng(4).standard_normal((len(matrix), 2))
    before = (
        singular_values(matrix),
        pinv(matrix, 1e-10),
        lstsq(matrix, target, 1e-10),
        lstsq(matrix, target[:, 0], 1e-10),
    )
    asked = request.getfixturevalue("refused")
    U, s, Vt = svd(matrix)
    np.testing.assert_allclose(U * s @ Vt, matrix, atol=1e-14)
    after = (
        singular_values(matrix),
        pinv(matrix, 1e-10),
        lstsq(matrix, target, 1e-10),
        lstsq(matrix, target[:, 0], 1e-10),
    )
    for a, b in zip(after, before, strict=True):
        assert a.shape == b.shape
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9 * abs(b).max())
    assert len(asked) == 5
    assert spectral_norm(matrix) == pytest.approx(before[0][0]) and condition(WIDE) < 100


def test_all_left_vectors_and_stacks(refused):
    U, _, Vt = svd(LOST, full_matrices=True)
    assert U.shape == (7, 7) and Vt.shape == (4, 4)
    np.testing.assert_allclose(U.T @ U, np.eye(7), atol=1e-14)
    stack = np.stack([WIDE, 2 * WIDE])
    np.testing.assert_allclose(WIDE @ pinv(stack), [np.eye(3), np.eye(3) / 2], atol=1e-12)
    np.testing.assert_allclose(singular_values(stack)[1], 2 * singular_values(WIDE))
    assert len(refused) > 0


def test_without_entries_and_singular():
    assert spectral_norm(np.zeros((0, 3))) == 0.0
    assert condition(np.zeros((2, 2))) == float("inf")


@pytest.mark.parametrize("way", [svd, singular_values])
def test_a_matrix_with_nan_is_refused_by_both(way):
    with pytest.raises(np.linalg.LinAlgError, match="NaN or infinite"):
        way(np.array([[1.0, np.nan], [0.0, 1.0]]))


def _calls(source: str) -> list[int]:
    """Return the lines that take one of these routines from numpy or scipy."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute) and node.attr in OURS and ast.unparse(node.value).endswith("linalg"):
            found.append(node.lineno)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").endswith("linalg"):
            found += [node.lineno for a in node.names if a.name in OURS]
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("linalg.norm"):
            order = [*node.args[1:2], *(k.value for k in node.keywords if k.arg == "ord")]
            found += [node.lineno for o in order if ast.unparse(o) in ("2", "-2", "'nuc'")]
    return found


def test_the_gate_sees_each_way():
    each = ("np.linalg.svd(a)", "from scipy.linalg import qr, svd", "np.linalg.norm(a, 2)", "linalg.norm(a, ord=2)")
    assert all(_calls(line) == [1] for line in each)
    assert _calls("np.linalg.norm(a, axis=1)\nfrom aeolid.decompositions import svd\nsvd(a)") == []


def test_no_other_module_asks_numpy_or_scipy():
    found = {
        str(path.relative_to(SOURCES)): lines
        for path in sorted(SOURCES.rglob("*.py"))
        if path.name != "decompositions.py" and (lines := _calls(path.read_text(encoding="utf-8")))
    }
    assert not found
