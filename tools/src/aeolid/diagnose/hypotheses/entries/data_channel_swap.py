"""Two channels of one unit that were recorded under each other's name."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.wiring import SHARE_SIZE, unit_of_input, unit_of_output, with_reading
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Parameter

_MIXED = "(1 - {share})*{own} + {share}*{other}"


def _statement(name: str, other: str, _: Mapping[str, float]) -> str:
    return f"the channels {name} and {other} are swapped: each was recorded under the other's name"


def _attach(site: Site) -> list[Attachment]:
    """Offer to swap every two outputs, and every two inputs, of one unit: by a share s each shows s of the other."""
    found = []
    for a, b in _of_one_unit(site.output_names, partial(unit_of_output, site)):
        share = f"swapped_outputs_{site.output_names.index(a) + 1}_{site.output_names.index(b) + 1}"
        found.append(_hypothesis(a, b, "output", partial(_with_outputs_mixed, a, b, share), share))
    numbers = {name: i for i, name in enumerate(site.input_names)}
    for a, b in _of_one_unit(site.input_names, lambda name: unit_of_input(site, numbers[name])):
        share = f"swapped_inputs_{numbers[a] + 1}_{numbers[b] + 1}"
        symbols = site.symbols[numbers[a]], site.symbols[numbers[b]]
        found.append(_hypothesis(a, b, "input", partial(_with_inputs_mixed, *symbols, share), share))
    return found


def _of_one_unit(names: Sequence[str], unit: Callable[[str], str]) -> list[tuple[str, str]]:
    return [(a, b) for a, b in itertools.combinations(names, 2) if unit(a) and unit(a) == unit(b)]


def _share(name: str) -> Parameter:
    return Parameter(name, 0.0, "", 0.0, 1.0)


def _with_outputs_mixed(a: str, b: str, share: str, model: Equations) -> Equations:
    plain = {o.name: o.equation for o in model.outputs}
    form = _MIXED.format(share=share, own="reading", other="neighbour")
    mixed = with_reading(model, a, form, (_share(share),), others={"neighbour": plain[b]})
    return with_reading(mixed, b, form, (), others={"neighbour": plain[a]})


def _with_inputs_mixed(a: str, b: str, share: str, model: Equations) -> Equations:
    words = {
        own: ex.parse(_MIXED.format(share=share, own=own, other=other), "input") for own, other in ((a, b), (b, a))
    }
    return replace(
        model,
        parameters=(*model.parameters, _share(share)),
        states=tuple(replace(s, derivative=ex.substitute(s.derivative, words)) for s in model.states),
        auxiliaries=tuple(replace(x, equation=ex.substitute(x.equation, words)) for x in model.auxiliaries),
        outputs=tuple(replace(o, equation=ex.substitute(o.equation, words)) for o in model.outputs),
        memories=tuple(
            replace(m, next=ex.substitute(m.next, words), settled=ex.substitute(m.settled, words))
            for m in model.memories
        ),
    )


def _hypothesis(a: str, b: str, role: str, edit: Callable[[Equations], Equations], share: str) -> Attachment:
    entry = f"{role}s:{a} and {b}"
    names = {"outputs": (a, b)} if role == "output" else {"inputs": (a, b)}
    return Attachment(
        "data_channel_swap", f"data_channel_swap {entry}", location(entry, **names), edit,
        (Slot(share, None, "", 0.0, 0.0, 1.0, SHARE_SIZE),),
        fixed={share: 1.0},
        equation=f"{a}_recorded = {b}, {b}_recorded = {a}",
        statement=partial(_statement, a, b),
    )  # fmt: skip


ENTRY = Entry(
    id="data_channel_swap",
    family="sensor_nonlinearity",
    name="two channels under each other's name",
    equation="y1_recorded = y2, y2_recorded = y1",
    source="Ljung 1999, System Identification: Theory for the User, section 14.1 (faults of recorded data)",
    quantities=(),
    attaches_to="every two outputs and every two inputs of one unit; against a simulator's run outputs alone",
    signature="each of two channels follows what the model says of the other; the verdict is a fault of the data",
    confused_with=(
        ("sensor_cross_axis", "share: a skewed sensor shows part of its neighbour and most of its own"),
        ("parameter_error", "no values let the two bodies change places in every response"),
    ),
    attach=_attach,
    rank=280,
    verdict="data_fault",
    turns=True,
)
