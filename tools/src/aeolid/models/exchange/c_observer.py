"""Write a Kalman observer as a C header for the controller."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError, UsageError
from aeolid.models.exchange.c_template import TEMPLATE
from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
Kind = type[np.float32] | type[np.float64]


def c_observer(model: StateSpace, *, name: str, precision: str = "f32", source: str = "model") -> str:
    """Return the text of a C99 header with the one-step predictor of a model, paper 000 eq. (1).

    name: prefix of everything in it; precision: f32 or f64. The coefficients are checked as they are written: the error
    of the estimate decays with the eigenvalues of A − K C, so an observer with one at or outside the unit circle is
    refused. Raises DataError where the model cannot be an observer, UsageError on the name or precision.
    """
    require_name(name)
    if precision not in ("f32", "f64"):
        raise UsageError(f"precision {precision!r} is neither f32 nor f64")
    kind: Kind = np.float32 if precision == "f32" else np.float64
    K = _checked_gain(model, kind, source)
    n, r, m = model.order, len(model.inputs), len(model.outputs)
    matrices = (("A", model.A), ("B", model.B), ("C", model.C), ("D", model.D), ("K", K))
    vectors = (("x_start", model.x0), ("u_offset", model.u_offset), ("y_offset", model.y_offset))
    coefficients = [_table(label, np.atleast_2d(v), kind, name) for label, v in matrices]
    coefficients += [_table(label, v, kind, name) for label, v in vectors]
    text = TEMPLATE.replace("@COEFFICIENTS@", "\n".join(coefficients))
    signals = _described("u", model.inputs) + _described("y", model.outputs)
    slowest = abs(np.linalg.eigvals(model.A - K @ model.C)).max()
    words = {
        "@SOURCE@": comment(source),
        "@SIGNALS@": "\n".join(signals),
        "@SAMPLE_TIME@": repr(float(model.sample_time_s)),
        "@SLOWEST@": f"{slowest:.6f}",
        "@REAL@": "float" if precision == "f32" else "double",
        "@BITS@": "uint32_t" if precision == "f32" else "uint64_t",
        "@EXPONENT@": "0x7F800000u" if precision == "f32" else "0x7FF0000000000000u",
        "@ZERO@": "0.0f" if precision == "f32" else "0.0",
        "@N@": str(n), "@R@": str(r), "@L@": str(m),
        "@GUARD@": f"{name.upper()}_H", "@UPPER@": name.upper(), "@name@": name,
    }  # fmt: skip
    for mark, word in words.items():
        text = text.replace(mark, word)
    return text


def require_name(name: str) -> None:
    """Refuse what cannot begin names in C."""
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,40}", name):
        raise UsageError(f"{name!r} cannot begin names in C: a letter, then letters, digits and _, up to 41")


def _checked_gain(model: StateSpace, kind: Kind, source: str) -> Array:
    """Return K; refuse what cannot run as an observer in a controller with numbers of this kind."""
    if model.sample_time_s <= 0:
        raise DataError(f"{source}: a continuous-time model; an observer needs one in discrete time with a Kalman gain")
    if model.K is None:
        raise DataError(f"{source}: no Kalman gain K; identify the model from a recording with aeolid identify")
    if model.order == 0 or not model.outputs:
        raise DataError(f"{source}: {model.order} states and {len(model.outputs)} outputs; an observer needs both")
    with np.errstate(over="ignore"):
        A, B, C, D, K = (
            np.asarray(v).astype(kind).astype(float) for v in (model.A, model.B, model.C, model.D, model.K)
        )
    offsets = np.concatenate([model.x0, model.u_offset, model.y_offset])
    limit = float(np.finfo(kind).max)
    if not all(np.isfinite(v).all() for v in (A, B, C, D, K)) or (abs(offsets) > limit).any():
        raise DataError(f"{source}: a coefficient exceeds the range of the precision; scale the channels or use f64")
    radius = abs(np.linalg.eigvals(A - K @ C)).max()
    if not radius < 1:
        raise DataError(
            f"{source}: the observer would not settle: A - K C has an eigenvalue of magnitude {radius:.6g}, below 1 is "
            "needed; identify again with a longer past window or another order"
        )
    return model.K


def _table(label: str, values: Array, kind: Kind, name: str) -> str:
    """Write a constant array, empty ones as one zero that is never read: C knows no array of no entries."""
    if values.size == 0:
        values = np.zeros([max(k, 1) for k in values.shape])
    sizes = "".join(f"[{k}]" for k in values.shape)
    if values.ndim == 1:
        body = _row(values, kind)
    else:
        body = "{\n" + "\n".join(f"    {_row(row, kind)}," for row in values) + "\n}"
    return f"static const {name}_real {name}_{label}{sizes} = {body};"


def _row(values: Array, kind: Kind) -> str:
    return "{" + ", ".join(_literal(v, kind) for v in values) + "}"


def _literal(value: float, kind: Kind) -> str:
    """Write the shortest decimal number that reads back as the same bits."""
    text = np.format_float_scientific(kind(value), unique=True, trim="0")
    return text + ("f" if kind is np.float32 else "")


def _described(letter: str, signals: tuple[Signal, ...]) -> list[str]:
    return [f" *   {letter}[{i}]  {comment(s.name)}, {comment(s.unit) or '-'}" for i, s in enumerate(signals)]


def comment(text: str) -> str:
    """Make a text of somebody else's safe inside a comment: it cannot end it, nor begin one, nor join lines."""
    printable = "".join(c if c.isprintable() and c not in "\\?" else "_" for c in text)
    return printable.replace("*/", "*_").replace("/*", "_*").replace("*", "_")
