"""Identify simulated structures by their outputs alone: are bands held, modes missed, harmonics taken for modes?

    python tests/studies/output_only.py [--runs 100] [--save FOLDER] [--other FILE] [--out FILE]

Ten minutes at 10 Hz each, seeds 0 … runs − 1. Even seeds: four storeys seen by four sensors; odd ones: five modes like
a turbine's, two of them 8 % apart, seen by three. Forces are white in two of four records and coloured (lag of 0.5 Hz)
in the others; half of the records have 1P, 3P, 6P and 9P of a rotor of 0.2 Hz, 0.5, 0.8, 0.3 and 0.2 times the outputs,
half of them with the azimuth recorded and a speed that varies by 0.3 %, half with neither. Sensor noise is 3 %.
The 95 % bands are ± 1.96 deviations of frequency and damping, and the ellipse of each entry of a shape beside the
reference. A mode that is found within 5 % in frequency, with a modal assurance criterion above 0.8, is the true one;
what is left of those listed is false. Frequencies within 1 % of a multiple are harmonics.
--save writes the records and the truth for a tool of others (peer_modes.py); --other reads what that found, for the
table of both. Processor seconds of reading nothing, on one thread.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from aeolid.identify.modal import find_modal
from aeolid.models.shapes import assurance
from aeolid.plants.structure import Harmonics, Structure, shaken, shear_building, tower_and_shaft
from aeolid.record import Record

NORMAL, ELLIPSE = 1.959964, 5.991465
STEP, SAMPLES, ROTOR = 0.1, 6000, 0.2
LINES = (1, 3, 6, 9)
NEAR, ALIKE = 0.05, 0.8


def case(seed: int) -> tuple[Structure, Record, str]:
    """Return structure, recording and group of a seed."""
    structure = (shear_building, tower_and_shaft)[seed % 2]()
    colour = 0.5 if seed // 2 % 2 else None
    turning, told = seed // 4 % 2 == 1, seed // 8 % 2 == 1
    lines = Harmonics(ROTOR, LINES, (0.5, 0.8, 0.3, 0.2), 0.003 if told else 0.0) if turning else None
    record = shaken(structure, SAMPLES, STEP, 5000 + seed, colour_hz=colour, harmonics=lines, azimuth=told)
    group = ("storeys", "turbine")[seed % 2] + (", coloured" if colour else ", white")
    return structure, record, group + ((", azimuth" if told else ", lines") if turning else "")


def ours(record: Record) -> tuple[list[dict[str, Any]], list[dict[str, Any]], float]:
    """Return what is listed as modes, what as harmonics and sines, and the processor seconds."""
    began = time.process_time()
    found = find_modal([record])
    spent = time.process_time() - began
    told = found.to_json()
    return told["modes"], told["harmonics"], spent


def shape_of(mode: dict[str, Any]) -> np.ndarray:
    """Return the shape (l,)."""
    if "shape_re" in mode:
        return np.array(mode["shape_re"]) + 1j * np.array(mode["shape_im"])
    return np.array([complex(e["re"], e["im"]) for e in mode["shape"]["outputs"].values()])


def compare(structure: Structure, modes: list[dict[str, Any]]) -> dict[str, Any]:
    """Return of each true mode what was found of it, and what is false."""
    hertz, damping, shapes = structure.modes()
    shown = np.array([shape_of(m) for m in modes]).T if modes else np.zeros((len(shapes), 0))
    alike = assurance(shapes, shown.astype(complex))
    apart = np.array([[abs(m["frequency_hz"] / f - 1) for m in modes] for f in hertz]).reshape(len(hertz), -1)
    cost = np.where((apart < NEAR) & (alike > ALIKE), apart + 1 - alike, 1e3)
    pairs = [(i, j) for i, j in zip(*linear_sum_assignment(cost), strict=True) if cost[i, j] < 1e3]
    rows = [
        row_of(modes[j], float(hertz[i]), float(damping[i]), shapes[:, i], structure.names) | {"alike": alike[i, j]}
        for i, j in pairs
    ]
    taken = {j for _, j in pairs}
    false = [m["frequency_hz"] for j, m in enumerate(modes) if j not in taken]
    lines = [f for f in false if abs(f / ROTOR / max(round(f / ROTOR), 1) - 1) < 0.01]
    return {"modes": len(hertz), "rows": rows, "false": false, "lines": lines}


def row_of(mode: dict[str, Any], f: float, d: float, shape: np.ndarray, names: tuple[str, ...]) -> dict[str, Any]:
    """Return errors, whether the bands hold, and of the shape in how many entries."""
    row: dict[str, Any] = {"true": f, "error": mode["frequency_hz"] / f - 1, "damping_error": mode["damping"] - d}
    row |= {"damping_ratio": mode["damping"] / d - 1, "z": None, "damping_z": None, "inside": 0, "entries": 0}
    if mode.get("frequency_std_hz"):
        row["z"] = (mode["frequency_hz"] - f) / mode["frequency_std_hz"]
    if mode.get("damping_std"):
        row["damping_z"] = (mode["damping"] - d) / mode["damping_std"]
    told = mode.get("shape")
    if told is None:
        return row
    for name, value in zip(names, shape / shape[names.index(told["reference"])], strict=True):
        entry = told["outputs"][name]
        if name == told["reference"] or entry["covariance"] is None:
            continue
        off = np.array([entry["re"] - value.real, entry["im"] - value.imag])
        rr, ri, ii = entry["covariance"]
        row["entries"] += 1
        row["inside"] += int(off @ np.linalg.solve(np.array([[rr, ri], [ri, ii]]), off) <= ELLIPSE)
    return row


def told(results: list[dict[str, Any]]) -> list[str]:
    """Return a line a group, and one of all: found, false, bands held, errors, seconds."""
    groups = sorted({r["group"] for r in results})
    head = (
        f"{'group':28s} runs  found      false  as modes  frequency    damping      shapes       rms f    rms d   MAC"
        "     s"
    )
    lines = [head]
    for group in [*groups, "all"]:
        mine = [r for r in results if group in ("all", r["group"])]
        rows = [row for r in mine for row in r["rows"]]
        if not rows:
            continue
        held = [_held([row[key] for row in rows]) for key in ("z", "damping_z")]
        inside, entries = (sum(row[key] for row in rows) for key in ("inside", "entries"))
        shapes = f"{inside / entries:6.1%} of {entries}" if entries else "-"
        wrong = np.sqrt(np.mean([row["error"] ** 2 for row in rows]))
        loose = np.sqrt(np.mean([row["damping_ratio"] ** 2 for row in rows]))
        lines.append(
            f"{group:28s} {len(mine):4d}  {len(rows):4d}/{sum(r['modes'] for r in mine):4d}"
            f"  {sum(len(r['false']) for r in mine):5d}  {sum(len(r['lines']) for r in mine):8d}"
            f"  {held[0]:11s}  {held[1]:11s}  {shapes:14s}  {wrong:6.3%}  {loose:6.1%}"
            f"  {np.mean([row['alike'] for row in rows]):.4f}  {np.mean([r['seconds'] for r in mine]):.2f}"
        )
    return lines


def of_both(results: list[dict[str, Any]], others: list[dict[str, Any]]) -> list[str]:
    """Return two lines: the errors of both over the modes that both found."""
    mine, theirs = ({(r["seed"], q["true"]): q for r in rs for q in r["rows"]} for rs in (results, others))
    keys = sorted(mine.keys() & theirs.keys())
    lines = [f"the {len(keys)} modes that both found: rms f, rms d, MAC (mean, median)"]
    for name, rows in (("aeolid", mine), ("the other tool", theirs)):
        rms = [np.sqrt(np.mean([rows[k][e] ** 2 for k in keys])) for e in ("error", "damping_ratio")]
        alike = [rows[k]["alike"] for k in keys]
        lines.append(f"{name:28s} {rms[0]:6.3%}  {rms[1]:6.1%}  {np.mean(alike):.5f}  {np.median(alike):.5f}")
    return lines


def _held(z: list[float | None]) -> str:
    known = np.array([v for v in z if v is not None])
    return f"{np.mean(abs(known) <= NORMAL):6.1%} ({known.mean():+.2f})" if len(known) else "-"


def save(folder: Path, seed: int, record: Record) -> None:
    """Write what a tool of others needs: the outputs and the sample time."""
    folder.mkdir(parents=True, exist_ok=True)
    np.savez(folder / f"{seed:03d}.npz", y=record.matrix("output"), step=record.sample_time_s)


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--save", type=Path)
    parser.add_argument("--other", type=Path)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    peer = json.loads(given.other.read_text()) if given.other else {}
    results, others = [], []
    for seed in range(given.runs):
        structure, record, group = case(seed)
        if given.save:
            save(given.save, seed, record)
        modes, lines, seconds = ours(record)
        found = compare(structure, modes) | {"seed": seed, "group": group, "seconds": seconds}
        results.append(found | {"harmonics": len(lines)})
        if str(seed) in peer:
            theirs = compare(structure, peer[str(seed)]["modes"])
            others.append(theirs | {"seed": seed, "group": group, "seconds": peer[str(seed)]["seconds"]})
    both = ["", "the other tool", *told(others), "", *of_both(results, others)] if others else []
    text = "\n".join(["aeolid", *told(results), *both])
    print(text)
    if given.out:
        given.out.with_suffix(".txt").write_text(text + "\n")
        given.out.with_suffix(".json").write_text(json.dumps({"aeolid": results, "other": others}, indent=1) + "\n")


if __name__ == "__main__":
    main()
