"""Make the RLS test vectors with numpy in double: python generate.py [--check].

Nothing here shares code or algorithm with the library: the answers come from batch least squares (numpy.linalg.lstsq).
--check compares the committed rls_vectors.h with fresh numbers instead of writing it; exit code 77 without numpy.
"""

import re
import sys
from pathlib import Path

try:
    import numpy as np
except ImportError:
    print("skipped: this Python has no numpy")
    sys.exit(77)

TARGET = Path(__file__).with_name("rls_vectors.h")
CASES = [  # regressors, outputs, samples, forgetting, regularisation; powers of two, exact in every precision
    (1, 1, 8, 1.0, 1.0),
    (3, 2, 5, 1.0, 0.5),
    (6, 2, 60, 1.0, 0.125),
    (6, 3, 60, 0.9375, 2.0),
    (12, 1, 80, 0.96875, 1.0),
]


def solve(z: np.ndarray, y: np.ndarray, forgetting: float, rho: float) -> np.ndarray:
    """Return theta (l, n) minimising sum lambda^(k-i) |y_i - theta z_i|^2 + lambda^(k+1) rho |theta|^2."""
    count, n = z.shape
    weight = np.sqrt(forgetting ** np.arange(count - 1, -1, -1.0))[:, None]
    rows = np.vstack([np.sqrt(rho * forgetting**count) * np.eye(n), weight * z])
    right = np.vstack([np.zeros((n, y.shape[1])), weight * y])
    return np.linalg.lstsq(rows, right, rcond=None)[0].T


def array(name: str, values: np.ndarray) -> str:
    """Write one array as C text with 13 digits, four a line."""
    numbers = [f"{v:.12e}" for v in np.ravel(values)]
    lines = [", ".join(numbers[i : i + 5]) for i in range(0, len(numbers), 5)]
    return f"static const double {name}[{len(numbers)}] = {{\n    " + ",\n    ".join(lines) + "};\n"


def generate() -> str:
    """Return the whole header."""
    text = "/* rls_vectors.h: made by generate.py; do not edit. */\n/* clang-format off */\n"
    text += "#ifndef RLS_VECTORS_H\n#define RLS_VECTORS_H\n\n"
    table = []
    for c, (n, outputs, count, forgetting, rho) in enumerate(CASES):
        bits = np.random.Generator(np.random.PCG64(2009 + c))
        # multiples of 1/1024: exact in float, so float and double see the same data
        z = np.round(bits.uniform(-2.0, 2.0, (count, n)) * 1024.0) / 1024.0
        y = (
            np.round((z @ bits.uniform(-1.0, 1.0, (n, outputs)) + bits.uniform(-0.1, 0.1, (count, outputs))) * 1024.0)
            / 1024.0
        )
        theta = solve(z, y, forgetting, rho)
        text += array(f"Z{c}", z) + array(f"Y{c}", y) + array(f"THETA{c}", theta) + "\n"
        table.append(f"    {{{n}, {outputs}, {count}, {forgetting!r}, {rho!r}, Z{c}, Y{c}, THETA{c}}},")
    text += "static const struct {\n    unsigned n, l, count;\n    double forgetting, regularisation;\n"
    text += "    const double *z, *y, *theta;\n} RLS_VECTORS[] = {\n" + "\n".join(table) + "\n};\n\n#endif\n"
    return text


def differs(old: str, new: str) -> str:
    """Compare two headers: the same text but for the numbers, and those to 1e-9."""
    number = re.compile(r"-?\d\.\d{12}e[+-]\d{2}")
    if number.sub("#", old) != number.sub("#", new):
        return "their layout differs"
    a, b = (np.array([float(x) for x in number.findall(text)]) for text in (old, new))
    worst = float(np.max(np.abs(a - b)))
    return "" if worst < 1e-9 else f"they differ by up to {worst:.1e}"


if __name__ == "__main__":
    if "--check" in sys.argv:
        problem = differs(TARGET.read_text(), generate())
        sys.exit(f"{TARGET.name} is not what generate.py makes: {problem}" if problem else 0)
    TARGET.write_text(generate())
