"""A declared parameter that is wrong while the structure is right."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Parameter
from aeolid.models.intersample import PREFIX as SAMPLING


def _attach(site: Site) -> list[Attachment]:
    if site.linear is None:
        known = (p for p in site.model.parameters if not p.name.startswith(SAMPLING))
        return [_fixed(p) for p in known if not p.free and p.value]
    result = [_gain(i, name) for i, name in enumerate(site.input_names)]
    return result + [a for i, m in enumerate(site.motions) if m.position is not None for a in _mode(i, m, m.position)]


def _fixed(p: Parameter) -> Attachment:
    size, unit = 1e-3 * abs(p.value), f" {p.unit}" if p.unit.strip() else ""
    slot = Slot(p.name, p.name, p.unit, p.value, p.minimum, p.maximum, size)
    return Attachment(
        "parameter_error", f"parameter_error {p.name}", location(f"parameter:{p.name}"), lambda model: model, (slot,),
        equation=f"{p.name} is a free constant",
        statement=lambda v: (
            f"the structure is right, but {p.name} is {v[p.name]:.4g}{unit}, not {p.value:.4g}{unit}"
        ),
    )  # fmt: skip


def _gain(i: int, name: str) -> Attachment:
    factor = f"input_gain_{i + 1}"

    def edit(model: Equations) -> Equations:
        scaled = {model.symbols[i]: ex.parse(f"{model.symbols[i]}*(1 + {factor})", "gain")}
        states = tuple(replace(s, derivative=ex.substitute(s.derivative, scaled)) for s in model.states)
        outputs = tuple(replace(o, equation=ex.substitute(o.equation, scaled)) for o in model.outputs)
        auxiliaries = tuple(replace(a, equation=ex.substitute(a.equation, scaled)) for a in model.auxiliaries)
        parameters = (*model.parameters, Parameter(factor, 0.0, "1", -3.0, 10.0))
        return replace(model, states=states, outputs=outputs, parameters=parameters, auxiliaries=auxiliaries)

    return Attachment(
        "parameter_error", f"parameter_error gain of {name}", location(f"input:{name}", inputs=(name,)), edit,
        (Slot(factor, "gain_change", "1", 0.0, -3.0, 10.0, 1e-3),),
        equation=f"{name} acts with (1 + gain_change) times the model's gain",
        statement=lambda v: f"the structure is right, but the gain from {name} is off by {v['gain_change']:+.1%}",
    )  # fmt: skip


def _mode_statement(kind: str, label: str, where: str, v: Mapping[str, float]) -> str:
    return f"the structure is right, but the {kind} of {where} is off by {v[label]:+.2%}"


def _mode(number: int, motion: Motion, position: ast.expr) -> list[Attachment]:
    omega = 2 * 3.141592653589793 * (motion.frequency_hz or 0.0)
    result = []
    for kind, label, form in (
        ("frequency", "frequency_change", f"-((1 + {{p}})**2 - 1)*{omega**2!r}"),
        ("damping", "damping_change", f"-2*{{p}}*{omega!r}"),
    ):
        name = f"{kind}_{number + 1}"
        acting = position if kind == "frequency" else motion.velocity

        def edit(model: Equations, name: str = name, form: str = form, acting: ast.expr = acting) -> Equations:
            force = ex.combine("*", ex.parse(form.format(p=name), "mode change"), acting)
            extended = replace(model, parameters=(*model.parameters, Parameter(name, 0.0, "1", -0.9, 0.9)))
            return motion.inject(extended, force, f"{name}_force")

        result.append(
            Attachment(
                "parameter_error", f"parameter_error {kind} of {motion.location}", location(motion.location), edit,
                (Slot(name, label, "1", 0.0, -0.9, 0.9, 1e-4),),
                equation=f"{kind} of {motion.location} changed by {label}"
                + (" (relative)" if kind == "frequency" else " (added to the damping ratio)"),
                statement=partial(_mode_statement, kind, label, motion.location),
            )
        )  # fmt: skip
    return result


ENTRY = Entry(
    id="parameter_error",
    family="parameter",
    name="wrong value of a declared parameter",
    equation="theta in place of theta_declared; of a linear model gain = gain_declared*(1 + gain_change), frequency ="
    " frequency_declared*(1 + frequency_change), damping = damping_declared + damping_change; against a run"
    " u_actual = factor*u",
    source="Ljung 1999, System Identification: Theory for the User, chapter 16",
    quantities=(
        Quantity("theta", "the parameter's own", -1e12, 1e12, float("nan"), "its value, by the parameter's own name"),
        Quantity("gain_change", "1", -3.0, 10.0, 0.0, "relative change of an input's gain"),
        Quantity("frequency_change", "1", -0.9, 0.9, 0.0, "relative change of a mode's frequency"),
        Quantity("damping_change", "1", -0.9, 0.9, 0.0, "what is added to a mode's damping ratio"),
        Quantity("factor", "1", 0.2, 5.0, 1.0, "what an input does over what it does in a simulator's run"),
    ),
    attaches_to="every parameter that is not free; gains, frequencies and dampings of a state-space model",
    signature="the misfit vanishes when one declared number moves",
    confused_with=(("every structural effect", "the likelihood gain left after the parameter was moved"),),
    attach=_attach,
    rank=610,
    verdict="parameter",
)
