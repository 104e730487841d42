"""Gather the facts of an identification's page from model.json, whose entry "identification" says how it came about."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from aeolid.models.modes import modes_of
from aeolid.models.state_space import from_json

Facts = dict[str, Any]


def identification_facts(
    model: Facts,
    *,
    title: str = "Identification",
    command: str | None = None,
    true_model: Facts | None = None,
    true_names: Mapping[int, str] | None = None,
    stream: Facts | None = None,
) -> Facts:
    """Return the facts that `render_identification` shows.

    model: content of the model.json that `identify` wrote; true_model: that of the true system, where it is known;
    true_names: names of its modes, counted from 0 by frequency; stream: {name: value} about how the data arrived.
    """
    how = model.get("identification") or {}
    facts: Facts = {"title": title, "command": command, "model": model, "stream": stream or {}}
    facts |= {key: how.get(key) for key in ("singular_values", "order", "order_reason", "eigenvalues", "modes")}
    facts |= {key: how.get(key) for key in ("frequency_response", "spectral")}
    facts["recordings"] = [
        {"file": entry.get("source"), "samples": entry.get("samples"), "sample_time_s": model.get("sample_time_s")}
        for entry in how.get("data") or []
    ]
    facts["settings"] = _settings(how)
    facts["fit"] = _fit(how.get("fit") or {})
    facts["notes"] = how.get("notes") or []
    if true_model is not None:
        modes = [m.to_json() for m in modes_of(from_json(true_model, "true model"))]
        for index, name in (true_names or {}).items():
            modes[index]["name"] = name
        facts |= {"true_model": true_model, "true_modes": modes}
        facts["true_eigenvalues"] = [pole for mode in modes for pole in _pair(mode["eigenvalue"])]
    return facts


def _pair(pole: list[float]) -> list[list[float]]:
    """Return a pole and, where it is complex, its conjugate."""
    return [pole, [pole[0], -pole[1]]] if pole[1] else [pole]


def _settings(how: Facts) -> Facts:
    settings = {k: v for k, v in (how.get("settings") or {}).items() if v not in (None, [], {}, False)}
    for key, value in settings.items():
        if isinstance(value, list):
            settings[key] = ", ".join(map(str, value))
    rank = how.get("rank") or {}
    if rank:
        settings["rank of the regressors"] = f"{rank.get('found')} of {rank.get('of')}"
    return settings


def _fit(fit: Facts) -> Facts:
    """Turn {horizon: {measure: {output: value}}} into {output: {"measure, horizon": value}}."""
    horizons = {"one step": fit.get("one_step") or {}, "free run": fit.get("free_run") or {}}
    horizons |= {f"{k} steps": v for k, v in (fit.get("k_step") or {}).items()}
    result: Facts = {}
    for horizon, measures in horizons.items():
        for measure, label in (("vaf", "VAF (%)"), ("nrmse", "NRMSE")):
            for output, value in (measures.get(measure) or {}).items():
                result.setdefault(output, {})[f"{label}, {horizon}"] = value
    return result
