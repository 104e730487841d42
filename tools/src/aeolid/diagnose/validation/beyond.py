"""Look beyond the catalogue where it explains nothing: for a form of any kind (S6)."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.race import fit_rows, is_accepted
from aeolid.diagnose.hypotheses.generic import unlisted
from aeolid.diagnose.hypotheses.generic.places import Read, places
from aeolid.diagnose.hypotheses.generic.shapes import shapes
from aeolid.diagnose.hypotheses.parts.base import Attachment
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.scoring.scores import Bank, score_bank
from aeolid.diagnose.scoring.waves import waves
from aeolid.diagnose.selection.colour import rings_undriven
from aeolid.diagnose.selection.rivals import leads, rivals_of
from aeolid.diagnose.validation.proof import Proof
from aeolid.models import expressions as ex

Array = NDArray[np.float64]
_MOST = 3  # forms that are fitted


def form_beyond(
    prepared: Prepared, candidates: Sequence[Candidate], named: Sequence[Candidate], proof: Proof | None, seed: int
) -> tuple[Candidate | None, list[Candidate]]:
    """Return the form that takes the place of what was found, or of nothing, if one does, and all that were fitted.

    candidates: what was fitted before, of which a band of noise may be the form. named: what the sealed data were asked
    about, if anything. Where they bore it out it keeps its name, except a wrong declared value, or what is not told
    from one: that the structure is right is a claim about all that is left (a drive whose action bends was a saturated
    one or a mass 4 % off, 213 and 184 nats). A form must then explain far more, else more. None on a simulator's run,
    of which any linear model leaves something over.
    """
    borne_out = proof is not None and proof.interval[0] > in_force().evidence.proven_nats
    if prepared.surrogate is not None:
        return None, []
    if borne_out and not all(_may_be_values(c, candidates) for c in named):
        return None, []
    fitted = sorted([*beyond_the_catalogue(prepared, seed)[1], *ringing(candidates)], key=lambda c: -c.score)
    best = next((c for c in fitted if is_accepted(c)), None)
    if best is None or not named:
        return best, fitted
    takes_over = leads(best, named[0]) if borne_out else best.score > named[0].score
    return (best if takes_over else None), fitted


def _may_be_values(named: Candidate, candidates: Sequence[Candidate]) -> bool:
    """Tell whether wrong declared values are what is named, or are not told from it."""
    if len(named.attachments) > 1:
        return all(a.entry == "parameter_error" for a in named.attachments)
    return any(c.attachments[0].entry == "parameter_error" for c in [named, *rivals_of(candidates, named)])


def beyond_the_catalogue(prepared: Prepared, seed: int) -> tuple[Bank, list[Candidate]]:
    """Return the bank of all forms, and the best of those that speak, fitted; best first."""
    bare = prepared.only(())
    found = places(prepared.site, reader(bare))
    step, span = bare.site.step, bare.site.step * len(bare.site.u)
    bank = score_bank(bare, [*shapes(found, step, span), *waves(bare, found, _MOST)], seed)
    return bank, sorted(fit_rows(prepared, bank.loud[:_MOST]), key=lambda c: -c.score)


def ringing(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return what rings though no input drives it, as forms: a mode that has a name is driven by what is recorded.

    Eddies that a tower sheds, the hum of a pump: the sealed data bear out a narrow band as they do a force (60 to 164
    nats for eddies). A broad one is the colour of a sensor's or a gust's noise, in which nothing need be missing.
    """
    found = []
    for c in (c for c in candidates if rings_undriven(c)):
        (mode,) = c.attachments
        values = c.values[mode.key]
        form = replace(mode, entry=unlisted.ID, key=f"{unlisted.ID} band {mode.key}", statement=_says_band(mode))
        own = {form.key: values}
        found.append(replace(c, attachments=(form,), values=own, plausible=True, reason="", undriven=False))
    return found


def _says_band(mode: Attachment) -> Callable[[Mapping[str, float]], str]:
    where = " and ".join(mode.location["outputs"])
    return lambda v: (
        f"noise that {where} shows in a narrow band around {v['frequency_hz']:.3g} Hz and no input drives:"
        " a force that nobody measured, or what the sensor picks up"
    )


def reader(prepared: Prepared) -> Read:
    """Return what reads an expression of the model off the baseline's predictions over the fit part."""
    predictor, point = prepared.predictor, prepared.fit.point
    model = predictor.compiled.model
    known: dict[str, list[Array]] = {}
    for i, segment in enumerate(predictor.segments):
        X = predictor.run(point, i)[2][segment.burn : len(segment.y)]
        u = segment.u.reshape(len(segment.y), segment.stride, -1)[segment.burn :, 0]
        held = [*(s.name for s in model.states), *(m.name for m in model.memories)]
        columns = [*zip(held, X.T, strict=False), *zip(model.symbols, u.T, strict=False)]
        for name, values in columns:
            known.setdefault(name, []).append(values)
    signals = {name: np.concatenate(parts) for name, parts in known.items()}
    words: dict[str, ast.expr] = {
        p.name: ast.Constant(float(v)) for p, v in zip(model.parameters, point.theta, strict=True)
    }
    written = {a.name: a.equation for a in prepared.site.model.auxiliaries}

    def read(tree: ast.expr) -> Array:
        while own := ex.names_in(tree) & written.keys():
            tree = ex.substitute(tree, {name: written[name] for name in own})
        return ex.values_of(ex.substitute(tree, words), signals)

    return read
