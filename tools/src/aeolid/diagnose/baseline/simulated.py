"""Turn a simulator's run into a baseline: a linear model of it, and how surely the run determines that model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import pinv, svd
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.deadline import Deadline
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Free, Point, Prior, Scales
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.baseline import equations_of, offset_sizes
from aeolid.diagnose.structure.modal import ModalForm, modal_form
from aeolid.errors import NotIdentifiable
from aeolid.identify.plain import identify_plainly
from aeolid.models.equations import Equations
from aeolid.models.integrate import compile_equations
from aeolid.record import Record

Array = NDArray[np.float64]
_PAST = 40  # samples
_MOST = 14  # states
_ITERATIONS = 15
_RUNAWAY = 1e6  # times its own median and what was recorded: no output of a simulation is, unless it diverges
_BLOCK = 100  # samples a block of the sandwich covariance: longer than the innovations' memory


@dataclass(frozen=True, eq=False)
class Surrogate:
    """Hold the linear model of a run, its parameters' names, and what the run knows of them.

    mean (k,), root (k, k) of the precision, in the order of `form.values`; predictor, fit: on the run itself.
    """

    form: ModalForm
    mean: Array
    root: Array
    predictor: Predictor
    fit: Fit

    def inform(self, predictor: Predictor) -> Predictor:
        """Return the predictor of an extended model with this knowledge as its prior, and the parameters' sizes."""
        names = [p.name for p in predictor.compiled.model.parameters]
        theta = predictor.scales.theta.copy()
        for name, size in modal_sizes(self.form).items():
            theta[names.index(name)] = size
        sized = Predictor(
            predictor.compiled, predictor.segments, replace(predictor.scales, theta=theta), predictor.var_order,
            predictor.deadline,
        )  # fmt: skip
        return sized.informed(self.prior(predictor.compiled.model))

    def prior(self, model: Equations) -> Prior:
        """Return the knowledge as a prior on the parameters of a model that holds them by name."""
        names = [p.name for p in model.parameters]
        places = [names.index(n) for n in self.form.values]
        mean, root = model.theta, np.zeros((len(self.root), len(names)))
        mean[places] = self.mean
        root[:, places] = self.root
        return Prior(mean, root)


def surrogate(run: Record, order: int | None = None, deadline: Deadline | None = None) -> Surrogate:
    """Identify the run by PBSIDopt, refine by maximum likelihood in modal coordinates, and measure the information.

    Raises NotIdentifiable where the run is too short or does not excite. Cost: 15 Gauss–Newton steps of n (r + 2 l)
    filter passes.
    """
    found = identify_plainly([run], past=_past(run), stable=True, order=order)
    if order is None and found.order > _MOST:
        found = identify_plainly([run], past=_past(run), order=_MOST, stable=True)
    spreads = np.nanstd(run.matrix("output"), axis=0)
    form = modal_form(found.model, spreads)
    model = equations_of(form.model, shaped_noise=True, modal=form)
    whole = _whole(run, form)
    sizes = modal_sizes(form) | offset_sizes(whole.u, spreads)
    predictor = Predictor(compile_equations(model), [whole], _scales(model, sizes, spreads), 0, deadline)
    fit = predictor.fit(_start(model, form, len(spreads)), _free(model, form, len(spreads)), iterations=_ITERATIONS)
    if fit is None:
        raise NotIdentifiable(f"{run.source}: no stable linear model predicts the simulation; lengthen the run")
    names = [p.name for p in model.parameters]
    places = [names.index(n) for n in form.values]
    columns = [fit.free.theta.index(i) for i in places]
    return Surrogate(form, fit.point.theta[places], _information_root(fit, columns, len(spreads)), predictor, fit)


def check_run(run: Record, records: Sequence[Record]) -> None:
    """Raise NotIdentifiable for a run that no model can be made of: too short, mostly missing, or running away.

    It runs away where it leaves its own usual size and that of the recordings behind: a run that rests for most of its
    time and then moves as the recordings do does not.
    """
    rules = in_force().baseline
    y = run.matrix("output")
    if len(run) < rules.run_samples:
        least = rules.run_samples
        raise NotIdentifiable(f"{run.source}: {len(run)} samples, a simulation of at least {least} is needed")
    missing = int(np.sum(~np.all(np.isfinite(y), axis=1)))
    if 2 * missing >= len(run) - 1:
        raise NotIdentifiable(
            f"{run.source}: {missing} of {len(run)} samples are missing; was it simulated at another sample time than"
            f" the {run.sample_time_s:g} s of the recording?"
        )
    for name, column in zip(run.names("output"), y.T, strict=True):
        size = np.abs(np.nan_to_num(column))
        usual = float(np.median(size))
        most = _RUNAWAY * max(usual, _largest(records, name))
        if 0 < most < size.max():
            first = int(np.argmax(size > most))
            raise NotIdentifiable(f"{run.source}: the simulation diverges, {name} at sample {first + 1}; simulate anew")


def _largest(records: Sequence[Record], name: str) -> float:
    """Return the largest size that was recorded of a channel; 0 where it has no sample."""
    sizes = [np.abs(r.column(name)) for r in records if name in r.names("output")]
    return max((float(np.max(x, initial=0.0, where=np.isfinite(x))) for x in sizes), default=0.0)


def is_simple(run: Record) -> bool:
    """Tell whether no more states than a surrogate may have describe the run at its own rate."""
    return identify_plainly([run], past=_past(run), stable=True).order <= _MOST


def _past(run: Record) -> int:
    return min(_PAST, len(run) // 30)


def _whole(run: Record, form: ModalForm) -> Segment:
    u, y = run.columns([s.name for s in form.model.inputs]), run.columns([s.name for s in form.model.outputs])
    good = np.all(np.isfinite(u), axis=1)
    if not np.all(good):
        raise NotIdentifiable(f"{run.source}: the simulation misses inputs from sample {int(np.argmin(good))} on")
    return Segment(np.ascontiguousarray(u), np.ascontiguousarray(y), run.sample_time_s, run.source, 0.0, 0)


def _scales(model: Equations, sizes: Mapping[str, float], spreads: Array) -> Scales:
    theta = np.array([sizes.get(p.name, max(abs(p.value), 1e-3)) for p in model.parameters])
    x_size = np.ones(len(model.states))
    low, high = (np.array([getattr(p, end) for p in model.parameters]) for end in ("minimum", "maximum"))
    prior = Prior(model.theta, np.zeros((0, len(theta))))
    return Scales(theta, np.outer(x_size, 1.0 / spreads), x_size, low, high, prior, spreads)


def modal_sizes(form: ModalForm) -> dict[str, float]:
    """Return a typical size of each parameter: the root mean square of its matrix's row or column."""
    m = form.model
    rows = {"A": np.ones(len(m.A)), "B": np.sqrt(np.mean(m.B**2, axis=0)), "C": np.sqrt(np.mean(m.C**2, axis=1))}
    return {
        name: float(max(rows[k][i if k == "C" else j], 1e-12))
        for (k, i, j), name in form.names.items()
        if not name.startswith("-")
    }


def _start(model: Equations, form: ModalForm, outputs: int) -> Point:
    n = len(model.states)
    K = np.zeros((n, outputs))
    if form.model.K is not None:
        K[: form.model.order] = form.model.K
    return Point(model.theta, np.zeros(n + outputs), K, (model.x0,))


def _free(model: Equations, form: ModalForm, outputs: int) -> Free:
    n = form.model.order
    return Free(
        tuple(i for i, p in enumerate(model.parameters) if p.free), (),
        tuple((i, j) for i in range(n) for j in range(outputs)), tuple(range(n)),
    )  # fmt: skip


def _information_root(fit: Fit, columns: Sequence[int], outputs: int) -> Array:
    """Return R with Rᵀ R the precision of some parameters, the others projected out.

    The information JᵀJ is divided by how much larger the scores' block sums vary than white innovations would let
    them: what a model of finite order leaves over is not white.
    """
    rest = np.delete(fit.jacobian, columns, axis=1)
    basis = svd(rest / np.maximum(np.linalg.norm(rest, axis=0), 1e-300))
    Q = basis[0][:, basis[1] > 1e-9 * basis[1][0]]
    own = fit.jacobian[:, list(columns)]
    own = own - Q @ (Q.T @ own)
    R: Array = np.asarray(np.linalg.qr(own, mode="r"), dtype=np.float64)
    white = own @ pinv(R, rcond=1e-10)
    scores = white * fit.residual[:, None]
    sums = np.add.reduceat(scores, np.arange(0, len(scores), _BLOCK * outputs), axis=0)
    inflation = max(1.0, float(np.sum(sums**2)) / len(columns))
    result: Array = R / np.sqrt(inflation)
    return result


def with_values(form: ModalForm, values: dict[str, float]) -> ModalForm:
    """Return the modal form with other values of its parameters."""
    matrices = {"A": form.model.A.copy(), "B": form.model.B.copy(), "C": form.model.C.copy()}
    for (m, i, j), name in form.names.items():
        matrices[m][i, j] = -values[name[1:]] if name.startswith("-") else values[name]
    return replace(form, model=replace(form.model, A=matrices["A"], B=matrices["B"], C=matrices["C"]))
