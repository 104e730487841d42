"""Make the vectors of the fast filter with numpy in double: python generate_fast_rls.py [--check].

Nothing here shares algorithm with the library: the answers come from batch least squares (numpy.linalg.lstsq) over all
samples of a window that slides in from zeros. --check compares the committed fast_rls_vectors.h with fresh numbers
instead of writing it; exit code 77 without numpy.
"""

import sys
from pathlib import Path

from generate import array, differs, np

TARGET = Path(__file__).with_name("fast_rls_vectors.h")
CASES = [  # past, block, mask of present entries, outputs, samples, forgetting, regularisation (exact in float)
    (1, 1, 0, 1, 12, 0.9375, 1.0),
    (3, 2, 0, 2, 60, 0.96875, 0.5),
    (2, 3, 1, 1, 80, 0.984375, 2.0),
    (3, 3, 6, 2, 90, 0.984375, 1.0),
    (4, 2, 2, 3, 120, 1.0, 0.25),
]


def slide(blocks: np.ndarray, past: int, mask: int) -> np.ndarray:
    """Return the windows (samples, n): past blocks, oldest first, zeros before the first; then the mask's entries."""
    count, m = blocks.shape
    present = [c for c in range(m) if mask >> c & 1]
    z = np.zeros((count, past * m + len(present)))
    for k in range(count):
        for i in range(max(0, past - k), past):
            z[k, i * m : (i + 1) * m] = blocks[k - past + i]
        z[k, past * m :] = blocks[k, present]
    return z


def prior(past: int, block: int, mask: int, forgetting: float, rho: float) -> np.ndarray:
    """Return 1 / P_-1 (n,) as the header has it: entries of the mask come first in a block, the window counts on."""
    present = mask.bit_count()
    newest = [rho / forgetting ** (past - 1 - i) for i in range(past) for _ in range(block)]
    return np.array(newest + [rho * forgetting] * present)


def solve(z: np.ndarray, y: np.ndarray, forgetting: float, ridge: np.ndarray) -> np.ndarray:
    """Return theta (l, n) minimising sum lambda^(k-i) |y_i - theta z_i|^2 + lambda^(k+1) |theta ridge^(1/2)|^2."""
    count = len(z)
    weight = np.sqrt(forgetting ** np.arange(count - 1, -1, -1.0))[:, None]
    rows = np.vstack([np.diag(np.sqrt(ridge * forgetting**count)), weight * z])
    right = np.vstack([np.zeros((z.shape[1], y.shape[1])), weight * y])
    return np.linalg.lstsq(rows, right, rcond=None)[0].T


def generate() -> str:
    """Return the whole header."""
    text = "/* fast_rls_vectors.h: made by generate_fast_rls.py; do not edit. */\n/* clang-format off */\n"
    text += "#ifndef FAST_RLS_VECTORS_H\n#define FAST_RLS_VECTORS_H\n\n"
    table = []
    for c, (past, block, mask, outputs, count, forgetting, rho) in enumerate(CASES):
        bits = np.random.Generator(np.random.PCG64(1991 + c))
        # multiples of 1/1024: exact in float, so float and double see the same data
        blocks = np.round(bits.uniform(-2.0, 2.0, (count, block)) * 1024.0) / 1024.0
        z = slide(blocks, past, mask)
        y = z @ bits.uniform(-1.0, 1.0, (z.shape[1], outputs)) + bits.uniform(-0.1, 0.1, (count, outputs))
        y = np.round(y * 1024.0) / 1024.0
        theta = solve(z, y, forgetting, prior(past, block, mask, forgetting, rho))
        text += array(f"BLOCKS{c}", blocks) + array(f"OUTPUTS{c}", y) + array(f"ANSWER{c}", theta) + "\n"
        sizes = f"{past}, {block}, {mask}, {outputs}, {count}, {forgetting!r}, {rho!r}"
        table.append(f"    {{{sizes}, BLOCKS{c}, OUTPUTS{c}, ANSWER{c}}},")
    text += "static const struct {\n    unsigned past, block, mask, outputs, count;\n"
    text += "    double forgetting, regularisation;\n    const double *blocks, *y, *theta;\n} FAST_RLS_VECTORS[] = {\n"
    return text + "\n".join(table) + "\n};\n\n#endif\n"


if __name__ == "__main__":
    if "--check" in sys.argv:
        problem = differs(TARGET.read_text(), generate())
        sys.exit(f"{TARGET.name} is not what generate_fast_rls.py makes: {problem}" if problem else 0)
    TARGET.write_text(generate())
