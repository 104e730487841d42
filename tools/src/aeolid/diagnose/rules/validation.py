"""What sealed data, folds and free runs must show."""

from __future__ import annotations

from dataclasses import dataclass

from aeolid.diagnose.rules.declaring import rule


@dataclass(frozen=True)
class ValidationRules:
    """Hold the numbers of this section; each says what it means."""

    zero_apart_share: float = rule(
        0.05, "share", "part of a sensor's zero that must lie outside what the other values can do"
    )
    material_error_share: float = rule(
        0.005, "share", "relative improvement of the prediction error, at some horizon, that is worth a word"
    )
    visible_spread_share: float = rule(0.002, "share", "least such improvement, of the output's own spread")
    adequate_spread_share: float = rule(
        0.02,
        "share",
        "error, of the output's own spread, up to which a prediction is as good as any need be: what constants leave "
        "that are off by as much as usual",
        "measured: small imperfections leave up to 0.015, effects that matter 0.022 and more, those of machines 0.036",
    )
    unseen_spread_share: float = rule(
        0.03,
        "share",
        "error, of the output's own spread, at any horizon and on all data, up to which what has no name is not said "
        "to be missing",
        "measured: of 47 unnamed answers 14 complete models leave up to 0.023, the others 0.049 and more, all effects "
        "0.157 and more",
    )
    fewest_folds: int = rule(3, "count", "folds without which none is left out in turn")
    agreeing_share: float = rule(
        2 / 3,
        "share",
        "folds that must have come to what is named, to its kin, or to what all data do not tell from it",
    )
    material_rate: float = rule(
        0.002, "nats a sample", "gain over all folds that shows in predictions: one-step errors 0.2 % smaller"
    )
