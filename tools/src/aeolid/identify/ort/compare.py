"""Hold ORT against VARX with the disturbance as one more input, on samples that neither has seen.

VARX takes all that moves the loop as information, ORT only what the disturbance explains and what it leaves, each by
itself: where the disturbance is measured without error and inputs have noise of their own, as ORT needs too, VARX has
the smaller error in most loops. Where it has not, the held-out free run says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aeolid.errors import AeolidError
from aeolid.identify.decimate import decimate
from aeolid.identify.fit import measure_fit
from aeolid.identify.ort.identify import identify_ort
from aeolid.identify.ort.result import OrtIdentification
from aeolid.identify.split import FIT_PART, cut
from aeolid.identify.varx import identify_varx
from aeolid.identify.windows import find_scaling
from aeolid.record import Record

CLEARLY = 0.98  # of ORT's error: VARX is named from here on


def compare_with_varx(records: Sequence[Record], result: OrtIdentification) -> str:
    """Return a sentence on how ORT and VARX do on the last 30 % of each recording, both of the first 70 %.

    result: of ORT on the whole recordings, whose settings and orders both take. The errors are those of a free run, in
    standard deviations, geometric mean over the outputs. Cost: a second ORT of known orders, and a VARX.
    """
    chosen = result.settings
    lowered = [decimate(r, chosen.decimation) for r in records]
    heads, tails = cut(lowered, find_scaling(_as_inputs(lowered)), 0)
    try:
        ort = identify_ort(
            heads, past=chosen.past, future=chosen.future, order=result.order, joint_order=result.joint_choice.order,
            feedthrough=chosen.feedthrough, response=chosen.response, stable=chosen.stable,
        )  # fmt: skip
        varx = identify_varx(
            _as_inputs(heads), past=chosen.past, order=result.order, feedthrough=chosen.feedthrough,
            stable=chosen.stable, uncertainty="none",
        )  # fmt: skip
        errors = [_error(ort.model, tails), _error(varx.model, _as_inputs(tails))]
    except AeolidError as error:
        return f"not compared with varx with the disturbance as an input: {error}"
    said = (
        f"on the held-out last {1 - FIT_PART:.0%} the free-run error of ort is {errors[0]:.3g} standard deviations, "
        f"that of varx with the role 'input' for the disturbance {errors[1]:.3g}"
    )
    if errors[1] < CLEARLY * errors[0]:
        return f"{said}: give the disturbance the role 'input' and use --method varx"
    return said


def _as_inputs(records: Sequence[Record]) -> list[Record]:
    """Return the recordings with disturbances as inputs."""
    return [
        replace(r, channels=tuple(replace(c, role="input") if c.role == "disturbance" else c for c in r.channels))
        for r in records
    ]


def _error(model: object, records: Sequence[Record]) -> float:
    from aeolid.models.state_space import StateSpace

    assert isinstance(model, StateSpace)
    errors = list(measure_fit(model, records).free_run.nrmse.values())
    return float(np.exp(np.mean(np.log(np.maximum(errors, 1e-12)))))
