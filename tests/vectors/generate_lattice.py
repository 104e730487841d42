"""Make the vectors of the lattice with numpy in double: python generate_lattice.py [--check].

Nothing here shares algorithm with the library: theta and innovations come from batch least squares (numpy.linalg.lstsq)
over all samples of a window that slides in from zeros, solved afresh for each of the last samples. --check compares the
committed lattice_vectors.h with fresh numbers instead of writing it; exit code 77 without numpy.
"""

import sys
from pathlib import Path

from generate import array, differs, np

TARGET = Path(__file__).with_name("lattice_vectors.h")
LATE = 4  # samples whose innovations are given
CASES = [  # past, block, present, outputs, samples, forgetting, regularisation (exact in float)
    (1, 1, 0, 1, 12, 0.9375, 1.0),
    (1, 3, 2, 2, 40, 0.984375, 0.5),
    (3, 2, 0, 2, 60, 0.96875, 0.5),
    (2, 3, 1, 1, 80, 0.984375, 2.0),
    (4, 2, 2, 3, 120, 1.0, 0.25),
    (6, 3, 1, 3, 20, 0.9375, 4.0),  # about as many samples as regressors: the prior decides
]


def slide(blocks: np.ndarray, past: int, present: int) -> np.ndarray:
    """Return the windows (samples, n): past blocks, oldest first, zeros before the first; then present entries."""
    count, m = blocks.shape
    padded = np.vstack([np.zeros((past, m)), blocks])
    return np.hstack([padded[i : i + count] for i in range(past)] + [blocks[:, :present]])


def solve(z: np.ndarray, y: np.ndarray, case: tuple) -> np.ndarray:
    """Return theta (l, n) of all rows, the block i samples before the newest regularised by rho lambda^(count - i)."""
    past, block, present, _, _, forgetting, rho = case
    count = len(z)
    ages = np.concatenate([np.repeat(np.arange(past - 1, -1, -1), block), np.zeros(present)])
    weight = np.sqrt(forgetting ** np.arange(count - 1, -1, -1.0))[:, None]
    rows = np.vstack([np.diag(np.sqrt(rho * forgetting ** (count - ages))), weight * z])
    right = np.vstack([np.zeros((z.shape[1], y.shape[1])), weight * y])
    return np.linalg.lstsq(rows, right, rcond=None)[0].T


def generate() -> str:
    """Return the whole header."""
    text = "/* lattice_vectors.h: made by generate_lattice.py; do not edit. */\n/* clang-format off */\n"
    text += "#ifndef LATTICE_VECTORS_H\n#define LATTICE_VECTORS_H\n\n"
    text += f"enum {{ LATTICE_LATE = {LATE} }};\n\n"
    table = []
    for c, case in enumerate(CASES):
        past, block, present, outputs, count, forgetting, rho = case
        bits = np.random.Generator(np.random.PCG64(1982 + c))
        # multiples of 1/1024: exact in float, so float and double see the same data; coloured, so that stages matter
        noise = bits.uniform(-1.0, 1.0, (count, block))
        blocks = np.round((noise + 0.8 * np.vstack([np.zeros((1, block)), noise[:-1, ::-1]])) * 1024.0) / 1024.0
        z = slide(blocks, past, present)
        y = z @ bits.uniform(-1.0, 1.0, (z.shape[1], outputs)) + bits.uniform(-0.1, 0.1, (count, outputs))
        y = np.round(y * 1024.0) / 1024.0
        before = [solve(z[:k], y[:k], case) for k in range(count - LATE, count)]
        innovations = np.array([y[count - LATE + i] - theta @ z[count - LATE + i] for i, theta in enumerate(before)])
        text += array(f"BLOCKS{c}", blocks) + array(f"OUTPUTS{c}", y) + array(f"ANSWER{c}", solve(z, y, case))
        text += array(f"INNOVATION{c}", innovations) + "\n"
        sizes = f"{past}, {block}, {present}, {outputs}, {count}, {forgetting!r}, {rho!r}"
        table.append(f"    {{{sizes}, BLOCKS{c}, OUTPUTS{c}, ANSWER{c}, INNOVATION{c}}},")
    text += "static const struct {\n    unsigned past, block, present, outputs, count;\n"
    text += "    double forgetting, regularisation;\n    const double *blocks, *y, *theta, *innovation;\n"
    return text + "} LATTICE_VECTORS[] = {\n" + "\n".join(table) + "\n};\n\n#endif\n"


if __name__ == "__main__":
    if "--check" in sys.argv:
        problem = differs(TARGET.read_text(), generate())
        sys.exit(f"{TARGET.name} is not what generate_lattice.py makes: {problem}" if problem else 0)
    TARGET.write_text(generate())
