"""Make the vectors of extended least squares with numpy in double: python generate_els.py [--check].

Nothing here shares algorithm with the library: every sample's parameters come from a batch solution of their own
(numpy.linalg.lstsq) over all samples so far, and give the residual that the next regressors hold.
--check compares the committed els_vectors.h with fresh numbers instead of writing it; exit code 77 without numpy.
"""

import sys
from pathlib import Path

from generate import array, differs, np

TARGET = Path(__file__).with_name("els_vectors.h")
CASES = [  # inputs, outputs, past, present inputs, samples, start, end and rate of lambda, rho, VARX samples
    (1, 1, 1, 0, 40, 1.0, 1.0, 0.0, 1.0, 0),
    (1, 1, 2, 0, 60, 0.9375, 1.0, 0.875, 0.5, 0),
    (2, 1, 2, 1, 60, 0.9375, 0.96875, 0.875, 1.0, 10),
    (1, 2, 2, 0, 80, 0.875, 1.0, 0.96875, 0.25, 20),
]


def record(inputs: int, outputs: int, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Simulate a stable system under moving-average noise; multiples of 1/1024, exact in float."""
    bits = np.random.Generator(np.random.PCG64(seed))
    u = np.round(bits.uniform(-2.0, 2.0, (count, inputs)) * 1024.0) / 1024.0
    e = bits.uniform(-0.5, 0.5, (count, outputs))
    gain = bits.uniform(-1.0, 1.0, (outputs, inputs))
    y = np.zeros((count, outputs))
    for k in range(count):
        past = 0.5 * y[k - 1] + gain @ u[k - 1] + 0.5 * e[k - 1] if k else 0.0
        y[k] = np.round((past + e[k]) * 1024.0) / 1024.0
    return u, y


def solve(u: np.ndarray, y: np.ndarray, case: tuple) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the last theta (l, n), the last residual (l,) and the a priori innovations (samples, l)."""
    outputs, past, present, count, start, end, rate, rho, varx = case[1:]
    e = np.zeros_like(y)
    rows, right, weight, ridge = [], [], np.empty(0), rho
    theta, forgetting = None, start
    innovations = []
    for k in range(past, count):
        blocks = [np.concatenate([u[i], y[i], e[i]]) for i in range(k - past, k)]
        z = np.concatenate([*blocks, u[k, :present]])
        theta = np.zeros((outputs, len(z))) if theta is None else theta
        innovations.append(y[k] - theta @ z)
        rows, right = [*rows, z], [*right, y[k]]
        weight, ridge = np.append(weight * forgetting, 1.0), ridge * forgetting
        root = np.sqrt(weight)[:, None]
        a = np.vstack([np.sqrt(ridge) * np.eye(len(z)), root * np.array(rows)])
        b = np.vstack([np.zeros((len(z), outputs)), root * np.array(right)])
        theta = np.linalg.lstsq(a, b, rcond=None)[0].T
        residual = y[k] - theta @ z
        if k - past >= varx:
            e[k] = residual
        forgetting = end - (end - forgetting) * rate
    return theta, residual, np.array(innovations)


def generate() -> str:
    """Return the whole header."""
    text = "/* els_vectors.h: made by generate_els.py; do not edit. */\n/* clang-format off */\n"
    text += "#ifndef ELS_VECTORS_H\n#define ELS_VECTORS_H\n\n"
    table = []
    for c, case in enumerate(CASES):
        u, y = record(case[0], case[1], case[4], 2009 + c)
        theta, residual, innovations = solve(u, y, case)
        text += array(f"U{c}", u) + array(f"Y{c}", y) + array(f"THETA{c}", theta)
        text += array(f"RESIDUAL{c}", residual) + array(f"INNOVATIONS{c}", innovations) + "\n"
        numbers = ", ".join(repr(v) for v in case)
        table.append(f"    {{{numbers}, U{c}, Y{c}, THETA{c}, RESIDUAL{c}, INNOVATIONS{c}}},")
    text += "static const struct {\n    unsigned inputs, outputs, past, present, count;\n"
    text += "    double forgetting_start, forgetting, rate, regularisation;\n    unsigned varx_samples;\n"
    text += "    const double *u, *y, *theta, *residual, *innovations;\n} ELS_VECTORS[] = {\n"
    return text + "\n".join(table) + "\n};\n\n#endif\n"


if __name__ == "__main__":
    if "--check" in sys.argv:
        problem = differs(TARGET.read_text(), generate())
        sys.exit(f"{TARGET.name} is not what generate_els.py makes: {problem}" if problem else 0)
    TARGET.write_text(generate())
