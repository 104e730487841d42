"""Merge three set-ups of a chain of seven masses: are modes found, and are the bands of the merged values held?

    python tests/studies/setups.py [--runs 40] [--out FILE]

Ten minutes at 10 Hz a set-up, sensor noise 3 %. The sensors at levels 6 and 2 stay, levels 1, 3 / 4, 5 / 7 roam; what
shakes the chain is 1, 5 and 0.3 times as strong. Bands are ± 1.96 deviations of frequency and damping, and the 95 %
ellipse of each entry of a shape beside its reference; the assurance is that of the whole shape and the exact one, over
modes that every set-up shows.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.identify.modal import find_modal
from aeolid.identify.setups import MergedModal, merge
from aeolid.models.shapes import assurance
from aeolid.plants.structure import Structure, mass_chain, shaken
from aeolid.record import Record

NORMAL, ELLIPSE = 1.959964, 5.991465
STEP, SAMPLES = 0.1, 6000
REFERENCES = ("level_6", "level_2")
ROAMING = (("level_1", "level_3"), ("level_4", "level_5"), ("level_7",))
LEVELS = (1.0, 5.0, 0.3)


def setup(structure: Structure, roaming: tuple[str, ...], seed: int, level: float, samples: int = SAMPLES) -> Record:
    """Return the recording of a set-up: the references and what roams."""
    whole = shaken(structure, samples, STEP, seed)
    kept = [i for i, c in enumerate(whole.channels) if c.name in (*REFERENCES, *roaming)]
    channels = tuple(whole.channels[i] for i in kept)
    return replace(whole, values=level * whole.values[:, kept], channels=channels, source=f"seed {seed}")


def draw(structure: Structure, seed: int) -> MergedModal:
    """Return the merged modes of three set-ups."""
    parts = zip(ROAMING, LEVELS, strict=True)
    records = [setup(structure, roaming, 3 * seed + i, level) for i, (roaming, level) in enumerate(parts)]
    return merge([find_modal([r]) for r in records], REFERENCES)


def compare(structure: Structure, found: MergedModal) -> list[dict[str, Any]]:
    """Return a row a merged mode: standardised errors, entries of the shape within their ellipse, assurance."""
    hertz, damping, shapes = structure.modes()
    rows = []
    for merged in found.modes:
        mode = merged.mode
        i = int(np.argmin(abs(hertz - mode.frequency_hz)))
        told = mode.shape
        row: dict[str, Any] = {
            "mode": i, "setups": len(merged.seen), "z": (mode.frequency_hz - hertz[i]) / mode.frequency_std_hz,
            "damping_z": (mode.damping - damping[i]) / mode.damping_std, "damping_ratio": mode.damping / damping[i],
            "notes": len(merged.notes), "inside": 0, "entries": 0, "alike": None,
        }  # fmt: skip
        rows.append(row)
        true = dict(zip(structure.names, shapes[:, i], strict=True))
        for name, value in told.values.items():
            if name == told.reference:
                continue
            off = value - true[name] / true[told.reference]
            rr, ri, ii = told.covariance[name]
            apart = np.array([off.real, off.imag])
            row["entries"] += 1
            row["inside"] += int(apart @ np.linalg.solve(np.array([[rr, ri], [ri, ii]]), apart) <= ELLIPSE)
        if set(told.values) == set(structure.names):
            psi = np.array([told.values[n] for n in structure.names])
            row["alike"] = float(assurance(psi[:, None], shapes[:, i : i + 1])[0, 0])
    return rows


def report(structure: Structure, draws: list[list[dict[str, Any]]]) -> str:
    """Return a line a mode, and one of all."""
    hertz = structure.modes()[0]
    lines = ["mode Hz   found in all set-ups  frequency held  damping held  mean damping  shapes held     least MAC"]
    for which in [*range(len(hertz)), None]:
        rows = [r for rows in draws for r in rows if which in (None, r["mode"])]
        whole = [r["alike"] for r in rows if r["alike"] is not None]
        entries = sum(r["entries"] for r in rows)
        held = [np.mean([abs(r[key]) <= NORMAL for r in rows]) for key in ("z", "damping_z")]
        name = "all    " if which is None else f"{hertz[which]:.4f} "
        lines.append(
            f"{name}  {len(rows):4d}  {sum(r['setups'] == len(ROAMING) for r in rows):4d}             {held[0]:6.1%}"
            f"          {held[1]:6.1%}        {np.mean([r['damping_ratio'] for r in rows]):.3f}"
            f"         {sum(r['inside'] for r in rows) / entries:6.1%} of {entries:4d}  {min(whole):.4f}"
        )
    return "\n".join(lines)


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    structure = mass_chain()
    text = report(structure, [compare(structure, draw(structure, seed)) for seed in range(given.runs)])
    print(text)
    if given.out:
        given.out.write_text(text + "\n")


if __name__ == "__main__":
    main()
