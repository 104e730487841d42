"""Look beyond the catalogue where it explains nothing: for a form of any kind (S6)."""

from __future__ import annotations

import ast
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.candidate import Candidate
from aeolid.diagnose.catalogue.places import Read, places
from aeolid.diagnose.catalogue.shapes import shapes
from aeolid.diagnose.prepare import Prepared
from aeolid.diagnose.proof import PROVEN, Proof
from aeolid.diagnose.race import fit_rows, is_accepted
from aeolid.diagnose.rivals import leads
from aeolid.diagnose.scores import Bank, score_bank
from aeolid.diagnose.waves import waves
from aeolid.models import expressions as ex

Array = NDArray[np.float64]
_MOST = 3  # forms that are fitted


def form_beyond(
    prepared: Prepared, named: Sequence[Candidate], proof: Proof | None, seed: int
) -> tuple[Candidate | None, list[Candidate]]:
    """Return the form that takes the place of what was found, or of nothing, if one does, and all that were fitted.

    named: what the sealed data were asked about, if anything. Where they bore it out it keeps its name, except a wrong
    declared value: that the structure is right is a claim about all that is left. A form must then explain far more,
    else more. None on a simulator's run, of which any linear model leaves something over.
    """
    borne_out = proof is not None and proof.interval[0] > PROVEN
    if prepared.surrogate is not None:
        return None, []
    if borne_out and any(a.entry != "parameter_error" for c in named for a in c.attachments):
        return None, []
    fitted = beyond_the_catalogue(prepared, seed)[1]
    best = next((c for c in fitted if is_accepted(c)), None)
    if best is None or not named:
        return best, fitted
    takes_over = leads(best, named[0]) if borne_out else best.score > named[0].score
    return (best if takes_over else None), fitted


def beyond_the_catalogue(prepared: Prepared, seed: int) -> tuple[Bank, list[Candidate]]:
    """Return the bank of all forms, and the best of those that speak, fitted; best first."""
    bare = prepared.only(())
    found = places(prepared.site, reader(bare))
    step, span = bare.site.step, bare.site.step * len(bare.site.u)
    bank = score_bank(bare, [*shapes(found, step, span), *waves(bare, found, _MOST)], seed)
    return bank, sorted(fit_rows(prepared, bank.loud[:_MOST]), key=lambda c: -c.score)


def reader(prepared: Prepared) -> Read:
    """Return what reads an expression of the model off the baseline's predictions over the fit part."""
    predictor, point = prepared.predictor, prepared.fit.point
    model = predictor.compiled.model
    known: dict[str, list[Array]] = {}
    for i, segment in enumerate(predictor.segments):
        X = predictor.run(point, i)[2][segment.burn : len(segment.y)]
        u = segment.u.reshape(len(segment.y), segment.stride, -1)[segment.burn :, 0]
        columns = [*zip((s.name for s in model.states), X.T, strict=False), *zip(model.symbols, u.T, strict=False)]
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
