"""Channels were stamped by two clocks that do not agree: inputs against outputs, or one output against all others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.lateness import later_than_a_reading
from aeolid.models.equations import Equations, InputFilter, Parameter

_STARTS = (0.5, 1.5, 2.5, 3.5, 5.5, 8.5, 13.5)  # samples, either way: a shift has an optimum in every sample


def _statement(v: Mapping[str, float]) -> str:
    offset = v["offset_s"]
    which = "before" if offset > 0 else "after"
    return (
        f"the clocks of the loggers disagree: the inputs are stamped {abs(offset):.3g} s {which} the outputs"
        " that belong to them"
    )


def _attach(site: Site) -> list[Attachment]:
    """Shift all inputs against all outputs by one common time, either way."""
    if not site.input_names:
        return []
    longest = len(site.u) * site.step / 10
    offset = "clock_offset"
    names = site.input_names

    def edit(model: Equations) -> Equations:
        return replace(
            model,
            parameters=(*model.parameters, Parameter(offset, 0.0, "s", -longest, longest)),
            filters=(*model.filters, *(InputFilter(n, "transport_delay", (offset,)) for n in names)),
        )

    where = f"input:{names[0]}" if len(names) == 1 else "recording"
    starts = ({}, *({offset: sign * k * site.step} for k in _STARTS for sign in (1.0, -1.0)))
    return [
        Attachment(
            "data_time_offset", f"data_time_offset {where}", location(where, inputs=names), edit,
            (Slot(offset, "offset_s", "s", 0.0, -longest, longest, 0.3 * site.step),),
            stepped=True,
            beside={offset: site.row_step},  # within a row it is how a logger fills one
            starts=starts,
            equation="u_acting(t) = u_recorded(t - offset_s), the same for all inputs",
            statement=_statement,
            credible=later_than_a_reading(site.step),
        )
    ]  # fmt: skip


ENTRY = Entry(
    id="data_time_offset",
    family="input_lag",
    name="clock offset between loggers",
    equation="u_acting(t) = u_recorded(t - offset_s), all inputs alike",
    source="Maes et al. 2016, Journal of Sound and Vibration 381 (synchronising loggers by system identification)",
    quantities=(Quantity("offset_s", "s", -60.0, 60.0, 0.0, "delay of the outputs, or of one; negative: early"),),
    attaches_to="all inputs together; one output of several, whose column is moved; one of a simulator's run, too",
    signature="phase falls (or rises) in proportion to frequency from every input to every output by one time",
    confused_with=(
        ("transport_delay",
         "let both loggers record one event: a clock offset is there too, alike for all inputs, of either sign"),
        ("actuator_lag", "gain: a shift in time leaves it flat, a lag lets it droop above 1/tau_s"),
    ),
    attach=_attach,
    rank=30,
    turns=True,
)  # fmt: skip
