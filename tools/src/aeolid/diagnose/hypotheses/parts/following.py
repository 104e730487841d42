"""Let an output follow its reading as states of the model, so that the predictor's gain knows of it.

A filter that is a memory behind the output is exact between rows, but the gain is then that of the reading in front of
it: a blade's bending at 0.68 Hz came out at 0.736 ± 0.004 Hz, the gains of pitch 20 % off, 914 nats below the states.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aeolid.diagnose.hypotheses.parts.base import Attachment, Site, Slot
from aeolid.diagnose.hypotheses.parts.forces import with_parameters
from aeolid.diagnose.hypotheses.parts.wiring import SHARE_SIZE, unit_of_output, with_reading
from aeolid.models import expressions as ex
from aeolid.models.equations import STEP, Equations, State

SHORTEST, AT_NULL = 0.5, 3.0  # rows: what is faster is a memory; a stiff null costs every model that it is in


@dataclass(frozen=True)
class Filter:
    """Say what follows: its period T as text, the damping's name (None for a lag of first order), and their slots.

    grid: values that the bank scores, from mild to strong; starts: values a fit begins from.
    """

    period: str
    damping: str | None
    slots: tuple[Slot, ...]
    grid: tuple[Mapping[str, float], ...]
    starts: tuple[Mapping[str, float], ...]


def _at_once(model: Equations, name: str) -> ast.expr:
    """Return what an output reads, memories settled: they are renewed once a row, states run through it.

    Behind the memory of a faster filter at none, the same reading came a row late: z −0.49 in place of −0.34.
    """
    reading = next(o.equation for o in model.outputs if o.name == name)
    settled = {m.name: m.settled for m in model.memories}
    for _ in model.memories:
        reading = ex.substitute(reading, settled)
    return reading


def is_possible(site: Site) -> bool:
    """Tell whether states can be added: to equations in continuous time; the gain of a linear model is free."""
    return site.linear is None and not site.model.sample_time_s


def following(
    site: Site, j: int, tag: str, f: Filter, *, entry: str, key: str, where: Mapping[str, Any], equation: str,
    statement: Callable[[Mapping[str, float]], str],
) -> Attachment:  # fmt: skip
    """Return the hypothesis that output j follows its reading y: T m' = y − m, or T² m'' + 2 damping T m' + m = y.

    By a share it is blended in. The states count from the median that was measured, so that they may start at zero.
    """
    name, share, m, v = site.output_names[j], f"{tag}_share", f"{tag}_seen", f"{tag}_rate"
    level, unit = float(np.nanmedian(site.y[:, j])), unit_of_output(site, name)
    slots = (Slot(share, None, "", 0.0, 0.0, 1.0, SHARE_SIZE), *f.slots)
    names = (m,) if f.damping is None else (m, v)

    def edit(model: Equations) -> Equations:
        behind = f"({ex.to_text(_at_once(model, name))}) - {level!r} - {m}"
        if f.damping is None:
            forms: Sequence[str] = (f"({behind})/{f.period}",)
        else:
            forms = (f"{v}/{f.period}", f"({behind} - 2*{f.damping}*{v})/{f.period}")
        blend = f"(1 - {share})*reading + {share}*({level!r} + {m})"
        states = [State(n, unit, ex.parse(d, key), 0.0, True) for n, d in zip(names, forms, strict=True)]
        model = with_reading(with_parameters(model, slots), name, blend, ())
        return replace(model, states=(*model.states, *states))

    return Attachment(
        entry, key, where, edit, slots, start_states=names, fixed={share: 1.0}, share=share, grid=f.grid,
        starts=f.starts, equation=equation, statement=statement,
    )  # fmt: skip


def apart(site: Site, j: int, *names: str) -> tuple[State, ...]:
    """Return states that stand still, by whose free starts a filter of output j begins apart from what it measures.

    A recording starts in motion. A body of minutes behind a sensor of 25 s, without process noise, began so far off on
    other data that a right lag (225 nats) lost 330 there. None where no states can be added, nor to a law without any,
    in which nothing goes on long.
    """
    if not (is_possible(site) and site.model.states):
        return ()
    unit = unit_of_output(site, site.output_names[j])
    return tuple(State(n, unit, ex.parse("0", n), 0.0, True) for n in names)


def memories_of(
    tag: str, inverse: str, zeta: str, start: Sequence[State] = ()
) -> tuple[tuple[str, str, str], ...]:  # fmt: skip
    """Follow T² m'' + 2 zeta T m' + m = y exactly for y straight between rows, T = 1/omega, w = T m'.

    The steady answer to a ramp of slope s is y − 2 zeta T s; what m and T m' lack of it turns and decays. start: states
    that say how far apart from y and at which T m' it begins (else at y, at rest).
    """
    now, before, rate, rate_before = f"{tag}_now", f"{tag}_before", f"{tag}_rate", f"{tag}_rate_before"
    slope = f"{inverse}*({now} - {before})/{STEP}"  # T s
    turn = f"{STEP}/max({inverse}, 1e-9*{STEP})"
    root = f"sqrt(1 - {zeta}**2)"
    decay, c, s = f"exp(-{zeta}*{turn})", f"cos({turn}*{root})", f"sin({turn}*{root})"
    d = f"({tag} - {before} + 2*{zeta}*{slope})"
    return (
        (rate_before, rate, "0"),
        (before, now, "reading"),
        (now, "reading", "reading"),
        (
            rate, f"{slope} + {decay}*(({rate} - {slope})*({c} - {zeta}/{root}*{s}) - {d}/{root}*{s})",
            start[1].name if start else "0",
        ),
        (tag, f"{now} - 2*{zeta}*{slope} + {decay}*({d}*({c} + {zeta}/{root}*{s})"
              f" + ({rate_before} - {slope})/{root}*{s})", f"{now} + {start[0].name}" if start else now),
    )  # fmt: skip
