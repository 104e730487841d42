"""Hold aeolid beside the stored answers of the reference toolbox on the same data: poles, frequency responses, VAF.

    python tests/studies/reference.py [--runs 50] [--reference ../shared/reference] [--only SET …] [--out FOLDER]

Writes reference.md and reference.json; results/ beside this file holds all runs. Each answer is judged against the true
system of the data set; several runs of a set are compared pair by pair. "better" and "behind" are differences that
Student's test finds at 5 % (one-sided), "behind" one of at least 1 % of the toolbox's error (0.001 % in VAF); a single
set is one draw and bears no verdict, except where the toolbox cannot be right (closed loop with feedthrough, batches).

Settings are the toolbox's where it has them (windows, order, regularisation none or Tikhonov with cross-validation),
ours otherwise: `varmax` and the refinement of scheduled models run as they come. Errors are, for poles, the mean
distance by optimal assignment (fourth-order example: the largest, as its printed answers have it); for gains the mean
of |dB| over even steps in log frequency; for fits 100 − VAF of a free run on fresh noise-free data (turbine: one-step
prediction of the next recording). Singular values are not compared: on the turbine the regressors are singular and
their values depend on rounding. The answers for the fourth-order example and for batches are those printed with the
data; there the feedthrough mask and the merging of recordings are put beside what they replace.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.stats import t as student

from aeolid.identify.frequency import frequency_response
from aeolid.identify.lpv import LpvIdentification, identify_lpv
from aeolid.identify.varmax import identify_varmax
from aeolid.identify.varx import identify_varx
from aeolid.models.lpv import LpvStateSpace
from aeolid.models.prediction import predict, vaf
from aeolid.models.state_space import StateSpace
from aeolid.plants.disturbed_loop import disturbed_plant, simulate_disturbed_loop
from aeolid.plants.hawt import build_turbine, simulate_closed_loop
from aeolid.plants.lpv import benchmark, bilinear_system, flapping_blade, record_of
from aeolid.plants.lti import fourth_order, simulate_fourth_order
from aeolid.record import Record

REFERENCE = Path(__file__).resolve().parents[2].parent / "shared" / "reference"
LEVEL, MATERIAL, VAF_FLOOR = 0.05, 0.01, 1e-3
RULES = {"none": "none", "tikh": "gcv"}
Errors = dict[str, float]

TURBINE = {  # answer: method, past, future, regularisation
    "varx10": ("varx", 10, 10, "none"), "varx10t": ("varx", 10, 10, "gcv"), "varx20": ("varx", 20, 10, "none"),
    "varx30": ("varx", 30, 10, "none"), "varx30f": ("varx", 30, 30, "none"), "varx50": ("varx", 50, 10, "none"),
    "varx50t": ("varx", 50, 20, "gcv"), "elsdef": ("varmax", 10, 10, "gcv"), "els999": ("varmax", 10, 10, "gcv"),
}  # fmt: skip
POLES = {"integrator": 1.0, "tower 1": 0.9522 + 0.2726j, "tower 2": 0.9605 + 0.2752j, "drive train": 0.4905 + 0.8656j}
# (output, input); torque does not move the tower fore and aft, pitch hardly sideways
GAINS = {"pitch→Ω": (0, 0), "T→Ω": (0, 1), "pitch→ẋfa": (1, 0), "T→ẋsd": (2, 1)}
BILINEAR_PAST = tuple(range(2, 10))
TURBINE_HZ = np.geomspace(0.01 / (2 * np.pi), 4.999, 300)
PER_SAMPLE = np.geomspace(1e-3, 0.499, 200)
# largest pole error, VAF of both outputs: the toolbox in the closed loop as it comes, without D, in open loop
PRINTED_FOUR = {
    "four_ol_N1000": {"as it comes": (0.0038, 99.62, 99.86)},
    "four_ol_N10000": {"as it comes": (0.0007, 99.990, 99.991)},
    "four_cl_N1000": {"as it comes": (0.028, 90.4, 96.6), "without D": (0.0138, 97.5, 99.0)},
    "four_cl_N10000": {"as it comes": (0.0132, 97.6, 96.8), "without D": (0.0038, 99.7, 99.97)},
}
EXPLAINED = {
    ("turbine elsdef", "gain pitch→Ω"): "Without measurement noise one combination of the outputs is exactly "
    "predictable. The toolbox carries its covariance from pass to pass, so that parameters along that combination grow "
    "to 10³ … 10⁷ (S₁ is 2·10⁵) and the state basis leans on an exact relation. The same recursion in square-root form "
    "gives 0.99 dB here, and on 24 other recordings 1.04 against our 1.48. With 1 % measurement noise nothing is left "
    "of it: 1.68 against our 1.64, T→Ω 3.05 against 2.68. Not taken over: Markov parameters and singular values are "
    "rounding then. What the relation tells is had by prediction-error steps (--refine), with and without noise: the "
    "row refined.",
}


@dataclass(frozen=True, eq=False)
class Case:
    """Hold what we and the toolbox made of one set: errors by measure, ours and theirs (runs,).

    claim: the toolbox's answer cannot be right, so ours must be better even in a single draw.
    """

    name: str
    ours: dict[str, Any]
    theirs: dict[str, Any]
    claim: bool = False

    @classmethod
    def of(cls, name: str, ours: list[Errors], theirs: list[Errors], claim: bool = False) -> Case:
        """Gather the runs; measures that one side lacks are left out."""
        keys = [k for k in ours[0] if k in theirs[0]]
        return cls(name, *({k: np.array([e[k] for e in side]) for k in keys} for side in (ours, theirs)), claim)

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield a row of facts a measure."""
        for measure, ours in self.ours.items():
            theirs = self.theirs[measure]
            difference, runs = ours - theirs, len(ours)
            mean = float(difference.mean())
            error = float(difference.std(ddof=1) / np.sqrt(runs)) if runs > 1 else 0.0
            yield {"set": self.name, "measure": measure, "runs": runs, "ours": float(ours.mean()),
                   "toolbox": float(theirs.mean()), "difference": mean, "standard_error": error,
                   "word": self._word(measure, mean, error, runs, float(theirs.mean()))}  # fmt: skip

    def _word(self, measure: str, mean: float, error: float, runs: int, theirs: float) -> str:
        floor = max(MATERIAL * theirs, VAF_FLOOR if "VAF" in measure else 0.0)
        if runs == 1:
            return "one draw" if not self.claim else "better" if mean < 0 else "behind"
        far = float(student.ppf(1 - LEVEL, runs - 1)) * error
        return "better" if mean < -far else "behind" if mean > max(far, floor) else "equal"


def distances(found: Any, true: Any) -> Any:
    """Return the distance of each true pole to its estimate, by optimal assignment."""
    distance = abs(np.asarray(found)[:, None] - np.asarray(true)[None])
    rows, columns = linear_sum_assignment(distance)
    out = np.empty(len(true))
    out[columns] = distance[rows, columns]
    return out


def pole_error(found: Any, true: Any) -> float:
    """Return the mean distance of the eigenvalues of two matrices."""
    return float(distances(np.linalg.eigvals(found), np.linalg.eigvals(true)).mean())


def gain_errors(found: StateSpace, true: StateSpace, hz: Any) -> Any:
    """Return the mean |dB| of each channel, (l, r)."""
    both = [frequency_response(m, hz).magnitude_db for m in (found, true)]
    return abs(both[0] - both[1]).mean(axis=0)


def with_data(record: Record, u: Any, y: Any) -> Record:
    """Return a recording with these inputs and outputs in place of its own."""
    names = record.names("input", "output")
    channels = tuple(next(c for c in record.channels if c.name == n) for n in names)
    return replace(record, time_s=np.arange(len(u)) * record.sample_time_s, values=np.hstack([u, y]), channels=channels)


def turbine(folder: Path, runs: int) -> Iterator[Case]:
    """Compare on the closed-loop turbine of paper 000: four recordings, nine answers each, one of them twice."""
    plant, like = build_turbine(), simulate_closed_loop(20, 0)
    files = [np.load(path) for path in sorted((folder / "data").glob("hawt_*.npz"))]
    records = [with_data(like, d["u"], d["y"]) for d in files]
    true = plant.model()
    poles = np.linalg.eigvals(plant.A)
    place = [int(np.argmin(abs(poles - z))) for z in POLES.values()]

    def judge(model: StateSpace, following: Record) -> Errors:
        found = distances(np.linalg.eigvals(model.A), poles)[place]
        gains = gain_errors(model, true, TURBINE_HZ)
        u, y = following.matrix("input"), following.matrix("output")
        fit = 100 - vaf(y, predict(model, u, y))
        errors = {f"pole {n}": float(e) for n, e in zip(POLES, found, strict=True)}
        errors |= {f"gain {n}": float(gains[i, j]) for n, (i, j) in GAINS.items()}
        return errors | {f"100 − VAF {n}": float(e) for n, e in zip(("Ω", "ẋfa", "ẋsd"), fit, strict=True)}

    for answer, refined in [*((a, False) for a in TURBINE), ("elsdef", True)]:
        (method, past, future, rule), ours, theirs = TURBINE[answer], [], []
        for i, record in list(enumerate(records))[:runs]:
            run = identify_varmax if method == "varmax" else identify_varx
            result = run([record], past=past, future=future, order=7, regularization=rule, refined=refined,
                         feedthrough=record.names("input"))  # fmt: skip
            following = records[(i + 1) % len(records)]
            ours.append(judge(result.model, following))
            with np.load(folder / "toolbox" / f"hawt_{answer}_{i:02d}.npz") as t:
                iu, Dy = np.linalg.inv(t["Du"]), t["Dy"]
                model = replace(true, A=t["A"], B=t["B"] @ iu, C=Dy @ t["C"], D=Dy @ t["D"] @ iu,
                                K=t["K"] @ np.linalg.inv(Dy))  # fmt: skip
            theirs.append(judge(model, following))
        yield Case.of(f"turbine {answer}" + ", refined" * refined, ours, theirs)


def fourth_order_judge(folder: Path) -> Callable[[list[Record], tuple[str, ...]], Errors]:
    """Return what identifies the fourth-order example from recordings and measures the model."""
    true = fourth_order()
    poles = np.linalg.eigvals(true.A)
    with np.load(folder / "data" / "four_val.npz") as d:
        fresh_u, fresh_y = d["u"], d["y"]

    def judge(records: list[Record], feedthrough: tuple[str, ...]) -> Errors:
        model = identify_varx(records, past=10, order=4, feedthrough=feedthrough).model
        fit = 100 - vaf(fresh_y, model.simulate(fresh_u, np.zeros(4)))
        errors = {"largest pole error": float(distances(np.linalg.eigvals(model.A), poles).max())}
        errors["gain"] = float(gain_errors(model, true, PER_SAMPLE).mean())
        return errors | {f"100 − VAF y{i + 1}": float(e) for i, e in enumerate(fit)}

    return judge


def fourth_order_sets(folder: Path, runs: int) -> Iterator[Case]:
    """Compare with the printed answers on the fourth-order example, and merge batches, which the toolbox does not."""
    like, judge = simulate_fourth_order(2, 0), fourth_order_judge(folder)
    for name, answers in PRINTED_FOUR.items():
        with np.load(folder / "data" / f"{name}.npz") as d:
            record = with_data(like, d["u"], d["y"])
        for setting, (pole, *fits) in answers.items():
            closed = "cl" in name
            mine = judge([record], () if closed else ("u1", "u2"))
            printed = {"largest pole error": pole} | {f"100 − VAF y{i + 1}": 100 - f for i, f in enumerate(fits)}
            yield Case.of(f"{name}, {setting}", [mine], [printed], claim=closed and setting == "as it comes")
    ours, last = [], []
    with np.load(folder / "data" / "four_ol_N10000.npz") as d:
        whole = with_data(like, d["u"], d["y"])
    for k in range(min(runs, 5)):  # the toolbox's answer to two batches is that of the last one, to rounding
        long, short = whole.slice(2000 * k, 2000 * k + 1600), whole.slice(2000 * k + 1600, 2000 * k + 2000)
        ours.append(judge([long, short], ("u1", "u2")))
        last.append(judge([short], ("u1", "u2")))
    yield Case.of("four_ol_N10000 in batches of 1600 and 400", ours, last, claim=True)


def disturbed_loop(folder: Path, runs: int) -> Iterator[Case]:
    """Compare on the loop of paper 002: with a mask the same, with D of every input (as it comes) ours is better."""
    true, like = disturbed_plant(), simulate_disturbed_loop(10, 0)
    like = replace(like, channels=tuple(replace(c, role="input") if c.name == "r" else c for c in like.channels))
    fresh = np.random.default_rng(0).standard_normal((1000, 2))
    expected = true.simulate(fresh, np.zeros(2))

    def judge(model: StateSpace) -> Errors:
        deviations = replace(model, inputs=true.inputs, outputs=true.outputs)  # the data have no operating point
        fit = 100 - vaf(expected, deviations.simulate(fresh, np.zeros(2)))
        gain = float(gain_errors(model, true, PER_SAMPLE).mean())
        return {"pole": pole_error(model.A, true.A), "gain": gain, "100 − VAF": float(fit[0])}

    with np.load(folder / "data" / "katayama.npz") as d:
        u, r, y = d["u"], d["r"], d["y"]
    with np.load(folder / "toolbox" / "katayama_pbsid.npz") as t:
        answers = {k.removeprefix("ABCD_"): t[k] for k in t.files if k.startswith("ABCD_")}
    for name, matrices in answers.items():
        past, future = (int(part) for part in name.partition("_p")[2].split("f"))
        ours, theirs = [], []
        for i in range(min(runs, matrices.shape[2])):
            record = with_data(like, np.column_stack([u[i], r[i]]), y[i][:, None])
            result = identify_varx([record], past=past, future=future, order=2, feedthrough=("r",),
                                   regularization="none")  # fmt: skip
            ours.append(judge(result.model))
            M = matrices[:, :, i]
            theirs.append(judge(replace(true, A=M[:2, :2], B=M[:2, 2:], C=M[2:, :2], D=M[2:, 2:], K=None)))
        yield Case.of(f"disturbed loop {name}", ours, theirs, claim=name.startswith("std"))


def scheduled_errors(found: LpvStateSpace, true: LpvStateSpace, points: list[Any]) -> Errors:
    """Return pole errors of each matrix, and the gain error at frozen operating points (matrices, l, r)."""
    errors = {f"pole A{j + 1}": pole_error(A, true.A[j]) for j, A in enumerate(found.A)}
    gains = [gain_errors(found.frozen(s), true.frozen(s), PER_SAMPLE).mean() for s in points]
    return errors | {"gain at frozen points": float(np.mean(gains))}


def free_run_error(result: LpvIdentification, u: Any, scheduling: Any, y: Any) -> Any:
    """Return 100 − VAF (l,) of a free run from rest, VAF cut at zero as the toolbox does."""
    with np.errstate(all="ignore"):
        found = vaf(y, result.model.simulate(u, scheduling, np.zeros(result.order)))
    return 100 - np.maximum(np.nan_to_num(found, nan=0.0, neginf=0.0), 0.0)


def blocks(matrix: Any, count: int) -> Any:
    """Cut [M₁ M₂ …] into (count, rows, columns)."""
    return np.stack(np.split(matrix, count, axis=1))


def scheduled_benchmark(folder: Path, runs: int) -> Iterator[Case]:
    """Compare on the benchmark of paper 001, N = 500; the gains of the one answer that is stored with all matrices."""
    true = benchmark()
    points = [[rho, 0.0, 0.5 * rho] for rho in (0.1, 0.3, 0.5)]
    with np.load(folder / "data" / "lpv4c_N500.npz") as file:
        d = {k: file[k] for k in file.files}
    for past, rule in ((p, r) for p in (3, 5) for r in RULES):
        with np.load(folder / "toolbox" / f"lpv4c_N500_p{past}_y40_{rule}.npz") as file:
            t = {k: file[k] for k in file.files}
        stored = replace(true, K=None, **{k: blocks(t[k], 4) for k in "ABCD"})
        shown = next(i for i, A in enumerate(t["AA"]) if np.array_equal(A, t["A"]))
        ours, theirs, gain = [], [], []
        for i in range(min(runs, len(t["AA"]))):
            record = record_of(true, d["u"][i], d["mu"][i][:, 1:], d["y40"][i], "benchmark")
            result = identify_lpv([record], past=past, method="lpv" if past == 3 else "lpv-kernel", order=4,
                                  regularization=RULES[rule])  # fmt: skip
            errors = scheduled_errors(result.model, true, points)
            if i == shown:
                gain.append({"gain at frozen points": errors["gain at frozen points"]})
            fit = free_run_error(result, d["uv"][i], d["muv"][i][:, 1:], d["yv"][i])
            ours.append(errors | {f"100 − VAF y{j + 1}": float(e) for j, e in enumerate(fit)})
            fit = 100 - np.maximum(t["vaf_"][i], 0.0)
            mine = {f"pole A{j + 1}": pole_error(A, true.A[j]) for j, A in enumerate(blocks(t["AA"][i], 4))}
            theirs.append(mine | {f"100 − VAF y{j + 1}": float(e) for j, e in enumerate(fit)})
        name = f"benchmark p = {past} {rule}"
        yield Case.of(name, ours, theirs)
        if gain:
            yield Case.of(f"{name}, run {shown + 1}", gain, [scheduled_errors(stored, true, points)])


def bilinear(folder: Path, runs: int) -> Iterator[Case]:
    """Compare on the bilinear system: VAF for each past window; c says whether B is scheduled (000) or not (010)."""
    true = bilinear_system()
    with np.load(folder / "data" / "bilinear.npz") as file:
        d = {k: file[k] for k in file.files}
    with np.load(folder / "toolbox" / "bilinear.npz") as t:
        answers = {k[2:]: t[k] for k in t.files if k.startswith("V_")}
    for name, fits in answers.items():
        key, rule, constant = name.split("_")
        count = min(runs, fits.shape[1])
        ours: list[Errors] = [{} for _ in range(count)]
        for i, past in ((i, p) for i in range(count) for p in BILINEAR_PAST):
            record = record_of(true, d["u"][i], d["u"][i], d[key][i], "bilinear")
            result = identify_lpv([record], past=past, method="lpv-kernel", order=2, scheduling=("u1",),
                                  varying="A,B,K" if constant == "000" else "A,K",
                                  regularization=RULES[rule])  # fmt: skip
            ours[i][f"100 − VAF p = {past}"] = float(free_run_error(result, d["uv"][i], d["uv"][i], d["yv"][i])[0])
        theirs = [{f"100 − VAF p = {p}": float(100 - max(fits[p - 1, i], 0.0)) for p in BILINEAR_PAST}
                  for i in range(count)]  # fmt: skip
        yield Case.of(f"bilinear {name}", ours, theirs)


def blade(folder: Path, runs: int) -> Iterator[Case]:
    """Compare on the flapping blade in open loop, also with the toolbox's route for periodic scheduling."""
    true = flapping_blade(False)
    points = [[-0.5], [0.2], [0.9]]
    with np.load(folder / "data" / "flap_ol.npz") as file:
        d = {k: file[k] for k in file.files}
    with np.load(folder / "toolbox" / "flap.npz") as file:
        t = {k: file[k] for k in file.files}
    for rule in ("none", "tikh"):
        ours, theirs, periodic = [], [], []
        for i in range(min(runs, len(t["per_vaf"]))):
            record = record_of(true, d["u"][i], d["mu"][i][:, 1:], d["y"][i], "blade")
            result = identify_lpv([record], past=5, future=3, method="lpv-kernel", order=2, varying="A,K",
                                  regularization=RULES[rule])  # fmt: skip
            fit = free_run_error(result, d["u"][i], d["mu"][i][:, 1:], d["y0"][i])
            ours.append(scheduled_errors(result.model, true, points) | {"100 − VAF": float(fit[0])})
            v = t[f"ol_{rule}_ABCDK"][i]
            shapes = {"A": (2, 4), "B": (2, 2), "C": (1, 4), "D": (1, 2)}
            at = np.cumsum([0] + [rows * columns for rows, columns in shapes.values()])
            parts = {k: blocks(v[a : a + s[0] * s[1]].reshape(s, order="F"), 2)
                     for a, (k, s) in zip(at, shapes.items(), strict=False)}  # fmt: skip
            errors = scheduled_errors(replace(true, K=None, **parts), true, points)
            theirs.append(errors | {"100 − VAF": float(100 - t[f"ol_{rule}_vaf"][i, 0])})
            per = distances(t["per_eigA1"][i], np.linalg.eigvals(true.A[0])).mean()
            periodic.append({"pole A1": float(per), "100 − VAF": float(100 - t["per_vaf"][i, 0])})
        yield Case.of(f"blade {rule}", ours, theirs)
        if rule == "tikh":
            yield Case.of("blade, periodic route", ours, periodic)


SETS: dict[str, Callable[[Path, int], Iterator[Case]]] = {
    "turbine": turbine, "four": fourth_order_sets, "loop": disturbed_loop, "benchmark": scheduled_benchmark,
    "bilinear": bilinear, "blade": blade,
}  # fmt: skip


def study(folder: Path, runs: int, only: tuple[str, ...]) -> list[Case]:
    """Run the sets asked for; a progress bar goes to standard error."""
    from rich.console import Console
    from rich.progress import Progress

    cases = []
    with Progress(console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task("sets", total=len(only))
        for name in only:
            progress.update(bar, description=name)
            cases += list(SETS[name](folder, runs))
            progress.advance(bar)
    return cases


def table(rows: list[dict[str, Any]]) -> str:
    """Return the study as Markdown: counts for each set, what is behind and why, and every measure."""
    lines = ["# The reference toolbox's stored answers and ours", "", "`python tests/studies/reference.py`", "",
             "| set | runs | better | equal | behind | one draw |", "|---|---|---|---|---|---|"]  # fmt: skip
    for name in dict.fromkeys(r["set"] for r in rows):
        mine = [r for r in rows if r["set"] == name]
        counts = [sum(r["word"] == w for r in mine) for w in ("better", "equal", "behind", "one draw")]
        lines.append(f"| {name} | {mine[0]['runs']} | " + " | ".join(str(c) for c in counts) + " |")
    behind = [r for r in rows if r["word"] == "behind"]
    lines += ["", "Behind:" if behind else "Nothing is behind."]
    for r in behind:
        why = EXPLAINED.get((r["set"], r["measure"]), "Not explained.")
        lines += ["", f"- {r['set']}, {r['measure']}: {r['ours']:.4g} against {r['toolbox']:.4g}, "
                  f"difference {r['difference']:.2g} ± {r['standard_error']:.1g}. {why}"]  # fmt: skip
    lines += ["", "Errors, small is good: poles as distances, gains in dB, fits as 100 − VAF in percent. ± is the "
              "standard error of the paired difference.", "",
              "| set | measure | ours | toolbox | ours less toolbox | |", "|---|---|---|---|---|---|"]  # fmt: skip
    for r in rows:
        spread = f" ± {r['standard_error']:.1g}" if r["runs"] > 1 else ""
        lines.append(f"| {r['set']} | {r['measure']} | {r['ours']:.4g} | {r['toolbox']:.4g} | "
                     f"{r['difference']:+.2g}{spread} | {r['word']} |")  # fmt: skip
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Run the comparison from the command line."""
    parser = argparse.ArgumentParser(description="Hold aeolid beside the reference toolbox's stored answers.")
    parser.add_argument("--runs", type=int, default=50, help="runs of each set, at most; all by default")
    parser.add_argument("--reference", type=Path, default=REFERENCE, help="folder with data/ and toolbox/")
    parser.add_argument("--only", nargs="+", choices=list(SETS), default=list(SETS))
    parser.add_argument("--out", type=Path, default=Path("build/studies"), help="folder of the two files")
    options = parser.parse_args(arguments)
    if not options.reference.is_dir():
        parser.error(f"{options.reference} is absent: name the folder of the stored answers with --reference")
    rows = [row for case in study(options.reference, options.runs, tuple(options.only)) for row in case.rows()]
    options.out.mkdir(parents=True, exist_ok=True)
    text = table(rows)
    print(text)
    (options.out / "reference.md").write_text(text + "\n", encoding="utf-8")
    (options.out / "reference.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
