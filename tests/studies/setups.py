"""Merge three set-ups of a structure in both ways: are modes found, are errors small, are the bands held?

    python tests/studies/setups.py [--runs 40] [--case levels|colour|near] [--apart 0.02] [--out FILE]

Ten minutes at 10 Hz a set-up, sensor noise 3 %; what shakes the structure is 1, 5 and 0.3 times as strong. levels: a
chain of seven masses, the sensors at levels 6 and 2 stay, levels 1, 3 / 4, 5 / 7 roam. colour: there the forces of the
second set-up are white noise through a lag of 1 Hz. near: four levels that move in two directions, their pairs of modes
`--apart` from each other; both sensors at the top stay, those at levels 1 / 2 / 3 roam. Bands are ± 1.96 deviations of
frequency and damping, and the 95 % ellipse of each entry of a shape beside its reference; the assurance is that of the
whole shape and the exact one, over modes that every set-up shows.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.identify.modal import find_modal
from aeolid.identify.setup_realisation import realise
from aeolid.identify.setups import MergedModal, merge
from aeolid.models.shapes import assurance
from aeolid.plants.structure import Structure, mass_chain, shaken
from aeolid.record import Record

NORMAL, ELLIPSE = 1.959964, 5.991465
STEP, SAMPLES = 0.1, 6000
REFERENCES = ("level_6", "level_2")
ROAMING = (("level_1", "level_3"), ("level_4", "level_5"), ("level_7",))
LEVELS = (1.0, 5.0, 0.3)
TOP = ("level_4_x", "level_4_y")
BESIDE = tuple((f"level_{i}_x", f"level_{i}_y") for i in (1, 2, 3))
COLOUR_HZ = 1.0
APART, TURN = 0.02, 0.5  # of the modes in two directions, and rad from the sensors to these


def mast(apart: float = APART) -> Structure:
    """Return four levels that move alike in two directions, but for a frequency that is higher in one of them."""
    chain, turn = mass_chain(4), np.array([[np.cos(TURN), -np.sin(TURN)], [np.sin(TURN), np.cos(TURN)]])
    both = np.kron(chain.stiffness, turn @ np.diag([1.0, (1 + apart) ** 2]) @ turn.T)
    whole = np.eye(len(both))
    names = tuple(f"{name}_{direction}" for name in chain.names for direction in "xy")
    return Structure(whole, 0.0008 * both + 0.06 * whole, both, whole, whole, names)


def setup(
    structure: Structure, roaming: Sequence[str], seed: int, level: float, samples: int = SAMPLES,
    references: Sequence[str] = REFERENCES, colour_hz: float | None = None,
) -> Record:  # fmt: skip
    """Return the recording of a set-up: the references and what roams."""
    whole = shaken(structure, samples, STEP, seed, colour_hz=colour_hz)
    kept = [i for i, c in enumerate(whole.channels) if c.name in (*references, *roaming)]
    channels = tuple(whole.channels[i] for i in kept)
    return replace(whole, values=level * whole.values[:, kept], channels=channels, source=f"seed {seed}")


def draw(structure: Structure, seed: int, case: str = "levels") -> dict[str, MergedModal]:
    """Return the merged modes of three set-ups, by the way of merging."""
    references, moved = (TOP, BESIDE) if case == "near" else (REFERENCES, ROAMING)
    modals = []
    for i, (roaming, level) in enumerate(zip(moved, LEVELS, strict=True)):
        colour = COLOUR_HZ if case == "colour" and i == 1 else None
        modals.append(find_modal([setup(structure, roaming, 3 * seed + i, level, SAMPLES, references, colour)]))
    return {"poser": merge(modals, references), "preger": realise(modals, references)}


def compare(structure: Structure, found: MergedModal) -> list[dict[str, Any]]:
    """Return a row a merged mode: standardised errors, entries of the shape within their ellipse, assurance."""
    hertz, damping, shapes = structure.modes()
    rows = []
    for merged in found.modes:
        mode = merged.mode
        told = mode.shape
        psi = np.array([told.values.get(n, 0.0) for n in structure.names])
        there = np.array([n in told.values for n in structure.names])
        far = 1 - assurance(psi[there, None], shapes[there])[0]
        i = int(np.argmin(abs(hertz / mode.frequency_hz - 1) + 0.1 * far))
        row: dict[str, Any] = {
            "mode": i, "setups": len(merged.seen), "z": (mode.frequency_hz - hertz[i]) / mode.frequency_std_hz,
            "damping_z": (mode.damping - damping[i]) / mode.damping_std, "damping_ratio": mode.damping / damping[i],
            "off": mode.frequency_hz / hertz[i] - 1,
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
        if there.all():
            row["alike"] = float(assurance(psi[:, None], shapes[:, i : i + 1])[0, 0])
    return rows


def report(structure: Structure, draws: list[list[dict[str, Any]]]) -> str:
    """Return a line a mode, and one of all."""
    hertz = structure.modes()[0]
    lines = [
        "mode Hz   found whole  held: frequency damping shapes   rms error: frequency damping  mean damping   "
        "1 - MAC: mean    most"
    ]
    for which in [*range(len(hertz)), None]:
        rows = [r for rows in draws for r in rows if which in (None, r["mode"])]
        if not rows:
            continue
        whole = [1 - r["alike"] for r in rows if r["alike"] is not None] or [np.nan]
        inside, entries = (sum(r[key] for r in rows) for key in ("inside", "entries"))
        held = [np.mean([abs(r[key]) <= NORMAL for r in rows]) for key in ("z", "damping_z")]
        ratio = np.array([r["damping_ratio"] for r in rows])
        off = np.sqrt(np.mean([r["off"] ** 2 for r in rows]))
        name, full = "all    " if which is None else f"{hertz[which]:.4f} ", sum(r["alike"] is not None for r in rows)
        lines.append(
            f"{name}  {len(rows):4d}  {full:4d}          {held[0]:6.1%}  {held[1]:6.1%} "
            f"{inside / max(entries, 1):6.1%}            {off:8.4%}  {np.sqrt(np.mean((ratio - 1) ** 2)):6.2%}"
            f"         {ratio.mean():.3f}         {np.mean(whole):.5f} {max(whole):.5f}"
        )
    return "\n".join(lines)


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--case", choices=("levels", "colour", "near"), default="levels")
    parser.add_argument("--apart", type=float, default=APART, help="of the frequencies of --case near, relative")
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    structure = mast(given.apart) if given.case == "near" else mass_chain()
    found = [draw(structure, seed, given.case) for seed in range(given.runs)]
    text = "\n".join(f"{way}\n{report(structure, [compare(structure, f[way]) for f in found])}" for way in found[0])
    print(text)
    if given.out:
        given.out.write_text(text + "\n")


if __name__ == "__main__":
    main()
