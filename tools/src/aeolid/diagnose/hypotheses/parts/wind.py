"""Find the wind in a model: a state that nothing drives and that several others feel, as turbulence is modelled."""

from __future__ import annotations

import ast
from dataclasses import replace

import numpy as np

from aeolid.diagnose.hypotheses.parts.base import Site
from aeolid.diagnose.hypotheses.parts.rotor import Place
from aeolid.diagnose.structure.forces import FORCE
from aeolid.diagnose.structure.sums import written_out
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, State

_STEP = 1e-4  # of a state's start (at least of one unit), for the slope of an output


def wind(site: Site, output: str) -> Place | None:
    """Return the place at which more wind enters, None where the model has none that this output feels.

    What is added is felt wherever the wind is: torque and thrust at once, with the slopes that the model has. The size
    is that which moves the output by its spread.
    """
    for state in winds(site.model):
        slope = _slope(site, state.name, output)
        if slope:
            spread = float(np.nanstd(site.y[:, site.output_names.index(output)])) or 1.0
            name, unit = state.name, state.unit

            def blow(model: Equations, gust: ast.expr, _: str, name: str = name) -> Equations:
                return _with_more(model, name, gust)

            return Place(f"state:{name}", output, "wind", unit, spread / abs(slope), False, blow)
    return None


def winds(model: Equations) -> list[State]:
    """List the states that may be a model's wind: nothing drives them, and more than one other state feels them."""
    return [s for s in model.states if _is_undriven(s, model) and _felt(model, s.name) > 1]


def _with_more(model: Equations, name: str, gust: ast.expr) -> Equations:
    """Return the model with a gust added to this state wherever it is felt; the state itself goes on as it does.

    Intermediates of which the gust is made come first now: they hold states and constants, others may hold the gust.
    """
    more = {name: ex.combine("+", ast.Name(id=name), gust)}
    made_of = ex.names_in(gust)
    auxiliaries = sorted(model.auxiliaries, key=lambda a: a.name not in made_of)
    return replace(
        model,
        states=tuple(
            s if s.name == name else replace(s, derivative=ex.substitute(s.derivative, more)) for s in model.states
        ),
        outputs=tuple(replace(o, equation=ex.substitute(o.equation, more)) for o in model.outputs),
        auxiliaries=tuple(replace(a, equation=ex.substitute(a.equation, more)) for a in auxiliaries),
    )


def _is_undriven(state: State, model: Equations) -> bool:
    """Tell whether nothing enters a state's equation but itself, constants and the noise that has a memory."""
    own = {state.name, f"{FORCE}{state.name}", *(p.name for p in model.parameters)}
    return ex.names_in(written_out(state.derivative, model)) <= own


def _felt(model: Equations, name: str) -> int:
    """Count the other states whose equations have this state in them: a force has one, wind turns and pushes."""
    return sum(name in ex.names_in(written_out(s.derivative, model)) for s in model.states if s.name != name)


def _slope(site: Site, name: str, output: str) -> float:
    """Return what an output moves by for a unit of this state, where the states start and the inputs are usual."""
    model = site.model
    read = written_out(next(o.equation for o in model.outputs if o.name == output), model)
    usual = np.nanmedian(site.u, axis=0) if site.u.size else np.zeros(len(site.symbols))
    known = {p.name: np.asarray(p.value) for p in model.parameters}
    known |= {s.name: np.asarray(s.initial) for s in model.states}
    known |= {symbol: np.asarray(value) for symbol, value in zip(site.symbols, usual, strict=True)}
    if name not in ex.names_in(read) or not ex.names_in(read) <= set(known) | set(ex.CONSTANTS):
        return 0.0
    step = _STEP * max(abs(float(known[name])), 1.0)
    high, low = (float(ex.values_of(read, known | {name: known[name] + way * step})) for way in (1, -1))
    slope = (high - low) / (2 * step)
    return slope if np.isfinite(slope) else 0.0
