"""Make the facts of an identification and of a diagnosis for the tests of the pages."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np


def model(scale: float = 1.0) -> dict[str, Any]:
    """Return a model.json of two lightly damped modes, two inputs and two outputs; `scale` shifts the frequencies."""
    h = 0.1
    blocks = []
    for frequency, damping in ((0.32 * scale, 0.05), (1.7 * scale, 0.02)):
        s = 2 * np.pi * frequency * (-damping + 1j * np.sqrt(1 - damping**2))
        z = np.exp(s * h)
        blocks.append(np.array([[z.real, z.imag], [-z.imag, z.real]]))
    A = np.zeros((4, 4))
    A[:2, :2], A[2:, 2:] = blocks
    return {
        "kind": "state_space", "sample_time_s": h, "A": A.tolist(),
        "B": [[0.1, 0.0], [0.0, 0.02], [0.05, 0.01], [0.0, 0.1]], "C": [[1.0, 0.0, 0.5, 0.0], [0.0, 1.0, 0.0, 0.2]],
        "D": [[0.0, 0.0], [0.0, 0.0]],
        "inputs": [{"name": "pitch", "unit": "deg"}, {"name": "torque", "unit": "kN m"}],
        "outputs": [{"name": "generator_speed", "unit": "rad/s"}, {"name": "tower_fore_aft", "unit": "m/s"}],
    }  # fmt: skip


def eigenvalues(entry: dict[str, Any]) -> list[list[float]]:
    return [[float(v.real), float(v.imag)] for v in np.linalg.eigvals(np.array(entry["A"]))]


def identification() -> dict[str, Any]:
    true, found = model(), model(1.004)
    modes = [
        {"frequency_hz": 0.3213, "damping": 0.0512, "frequency_std_hz": 0.0008, "damping_std": 0.0022},
        {"frequency_hz": 1.7068, "damping": 0.0196, "frequency_std_hz": 0.0011, "damping_std": 0.0007},
    ]
    return {
        "title": "5 MW turbine <prototype>", "command": "aeolid identify rec.csv --past 30", "order": 4,
        "recordings": [{"file": "rec.csv", "samples": 10000, "sample_time_s": 0.1}],
        "settings": {"method": "varx", "past window": 30, "future window": 30, "regularisation": 1.2e-7},
        "singular_values": [52.0, 31.0, 9.0, 4.2, *(0.2 * 0.9**k for k in range(26))],
        "order_reason": "the largest gap among the singular values is after 4 (factor 21).",
        "model": found, "true_model": true, "eigenvalues": eigenvalues(found), "true_eigenvalues": eigenvalues(true),
        "modes": modes,
        "true_modes": [
            {"name": "tower fore-aft", "frequency_hz": 0.32, "damping": 0.05},
            {"name": "drive train", "frequency_hz": 1.7, "damping": 0.02},
        ],
        "fit": {"generator_speed": {"VAF one step (%)": 98.2}, "tower_fore_aft": {"VAF one step (%)": 95.06}},
        "stream": {"frames": 123456, "frames lost": 0, "bus load": {"value": 4.83, "unit": "%"}},
    }  # fmt: skip


def diagnosis() -> dict[str, Any]:
    return {
        "schema": 1, "verdict": "named",
        "effects": [{
            "id": "actuator_lag", "family": "input_lag",
            "statement": "The pitch drive follows its demand with a first-order lag of 0.31 s that the model lacks",
            "location": {"entry": "input:pitch", "outputs": ["generator_speed", "tower_fore_aft"], "inputs": ["pitch"],
                         "frequency_hz": [0.1, 0.6], "azimuth_order": None, "region": None, "time_s": None},
            "equation": "d(beta)/dt = (beta_cmd - beta)/tau",
            "settings": [{"simulator": "ROSCO", "set": "PA_Mode = 1, PA_CornerFreq = 3.2 rad/s"}],
            "parameters": {"tau": {"value": 0.3123, "std": 0.0212, "unit": "s"}},
            "rivals": [{"id": "transport_delay", "entry": "input:pitch", "weight": 0.2}], "weight": 0.75}],
        "location": {"entry": "input:pitch", "outputs": ["generator_speed"], "frequency_hz": [0.1, 0.6]},
        "sealed": {"data": "480 s to 600 s of rec.csv", "log_likelihood_gain": 312.4, "interval": [251.0, 371.0],
                   "nrmse_before": {"generator_speed": 0.412, "tower_fore_aft": 0.271},
                   "nrmse_after": {"generator_speed": 0.043, "tower_fore_aft": 0.061}, "recovered_fraction": 0.94},
        "false_alarm": {"sham_runs": 20, "false_names": 0, "threshold": 14.2},
        "not_excluded": [{"id": "cubic_stiffness", "minimum_detectable": {"value": 0.12, "unit": "1/m²"}}],
        "next_experiment": {"text": "Pitch PRBS of 0.5 deg with a dwell of 0.4 s", "minutes": 12,
                            "separates": ["actuator_lag", "transport_delay"]},
    }  # fmt: skip


def cells(outputs: list[str]) -> dict[str, list[dict[str, Any]]]:
    """Return all maps, two recordings in time, a wind in regions; a cell of each stands out, in the last output."""

    def told(output: str, kind: str, value: float, marked: bool) -> dict[str, Any]:
        marked = marked and output == outputs[-1]
        return {"output": output, "kind": kind, "value": value, "statistic": 6.0 if marked else 1.0, "threshold": 4.0,
                "significant": marked}  # fmt: skip

    time = [
        {"source": source, "time_s": [12.0 * k, 12.0 * (k + 1)], **told(name, kind, value, kind == "power" and k == 7)}
        for source, count in (("rec.csv", 14), ("other.csv", 6)) for k in range(count)
        for name in outputs for kind, value in (("mean", 0.02 * k), ("power", 3.0 if k == 7 else 0.9))
    ]  # fmt: skip
    region = [
        {"channel": "wind", "unit": "m/s", "range": [10.0 + k, 11.0 + k], **told(name, kind, 0.1 * k, k == 5)}
        for k in range(6) for name in outputs for kind in ("mean", "power")
    ]  # fmt: skip
    azimuth = [
        {"order": k, "phase_deg": 20.0, **told(name, "line", 0.2 / (1 + abs(k - 3)), k == 3)}
        for k in range(1, 7) for name in outputs
    ]  # fmt: skip
    path = [
        {"channel": channel, "frequency_hz": [0.01 * 2**k, 0.01 * 2 ** (k + 1)],
         **told(name, "path", 9.0 if (channel, k) == ("pitch", 4) else 1.1, (channel, k) == ("pitch", 4))}
        for channel in ("pitch", "wind") for k in range(8) for name in outputs
    ]  # fmt: skip
    horizon = [
        {"horizon_s": h, **told(name, "power", 2.5 if h == 5.0 else 1.05, h == 5.0)}
        for name in outputs for h in (0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
    ]  # fmt: skip
    effort, inferred = (
        [{"frequency_hz": [0.01 * 2**k, 0.01 * 2 ** (k + 1)], **told(outputs[-1], "power", 1.6, k == 3), "output": name}
         for k in range(8)] for name in ("pitch", "gust")
    )  # fmt: skip
    return {"time": time, "region": region, "azimuth": azimuth, "path": path, "horizon": horizon, "effort": effort,
            "inferred": inferred}  # fmt: skip


def candidates() -> list[dict[str, Any]]:
    """Return what three fits gained: the named one, one not told apart, one that ran to the end of its range."""
    lag, delay = [["actuator_lag", "input:pitch"]], [["transport_delay", "input:pitch"]]
    second = [["actuator_second_order", "input:pitch"]]
    why = "damping of actuator_second_order input:pitch ran to the end of its physical range (0.98 1)"
    return [
        {"key": "actuator_lag input:pitch", "parts": lag, "score": 240.0, "fit_gain": 200.0, "select_gain": 43.0,
         "plausible": True, "reason": ""},
        {"key": "transport_delay input:pitch", "parts": delay, "score": 238.6, "fit_gain": 201.0, "select_gain": 41.0,
         "plausible": True, "reason": ""},
        {"key": "actuator_second_order input:pitch", "parts": second, "score": 251.0, "fit_gain": 210.0,
         "select_gain": 44.0, "plausible": False, "reason": why},
    ]  # fmt: skip


def mode(frequency: float, output: str, name: str = "", damping: float = 0.02) -> dict[str, Any]:
    shares = {"generator_speed": 0.1, "tower_fore_aft": 0.1} | {output: 0.9}
    return {"frequency_hz": frequency, "frequency_std_hz": 0.002, "damping": damping, "damping_std": 0.004,
            "outputs": shares, "rotor_order": None, "name": name}  # fmt: skip


def sides() -> dict[str, Any]:
    """Return modes, responses and means over the turn of a recording and a simulation that lacks a mode."""
    recorded = [mode(0.32, "tower_fore_aft", "tower fore-aft"), mode(1.7, "generator_speed", "drive train")]
    f = np.geomspace(0.01, 5.0, 40)
    pair = {"input": "pitch", "output": "tower_fore_aft", "gain": (1 / f).tolist(), "gain_std": (0.1 / f).tolist(),
            "phase_deg": [-90.0] * 40, "phase_std_deg": [4.0] * 40}  # fmt: skip
    angle = np.arange(5.0, 360.0, 10.0)
    turn = {"azimuth_deg": angle.tolist(), "recorded": np.cos(np.radians(angle)).tolist(), "simulated": [0.0] * 36,
            "unit": "m/s"}  # fmt: skip
    both = {side: {"frequency_hz": f.tolist(), "pairs": [pair]} for side in ("recorded", "simulated")}
    return {
        "modes": {"recorded": recorded, "simulated": [mode(0.34, "tower_fore_aft", "tower fore-aft")]},
        "responses": both | {"units": {"pitch": "deg", "tower_fore_aft": "m/s"}}, "turning": {"tower_fore_aft": turn},
    }  # fmt: skip


def equations() -> list[dict[str, Any]]:
    """Return a state that no fit does without, one whose noise is worth 211 nats, and a value that does not wander."""
    return [
        {"what": "state", "name": "gust", "asked": "noise its equation needs", "statistic": None, "threshold": 5.7,
         "scale": "nats", "significant": True},
        {"what": "state", "name": "v", "asked": "noise its equation needs", "statistic": 211.0, "threshold": 5.7,
         "scale": "nats", "significant": True},
        {"what": "parameter", "name": "k_beta", "asked": "wanders in time", "statistic": 1.2, "threshold": 3.4,
         "scale": "z", "significant": False},
    ]  # fmt: skip


def evidence() -> dict[str, Any]:
    rng = np.random.default_rng(1)
    t = 480 + 0.1 * np.arange(1200)
    clean = np.sin(2 * np.pi * 0.32 * t) * (1 + 0.5 * np.sin(2 * np.pi * 0.01 * t))
    late = np.sin(2 * np.pi * 0.32 * (t - 0.3)) * (1 + 0.5 * np.sin(2 * np.pi * 0.01 * t))
    series = {}
    for name, unit, size in (("generator_speed", "rad/s", 0.1), ("tower_fore_aft", "m/s", 0.3)):
        series[name] = {
            "time_s": t.tolist(), "measured": (size * late + 0.02 * size * rng.standard_normal(1200)).tolist(),
            "before": (size * clean).tolist(), "after": (0.98 * size * late).tolist(), "unit": unit,
        }  # fmt: skip
    f = np.linspace(0.01, 5, 300)
    spectrum = {
        "frequency_hz": f.tolist(), "before": (1e-4 + 0.1 / (1 + ((f - 0.32) / 0.05) ** 2)).tolist(),
        "after": (1e-4 + 0.001 / (1 + f)).tolist(),
    }  # fmt: skip
    ids = ["actuator_lag", "transport_delay", "coulomb_friction", "cubic_stiffness", "parameter_error"]
    bank = [
        {"id": name, "family": "f", "entry": "input:pitch" if i < 2 else "output:generator_speed", "statistic": s,
         "threshold": 14.2, "p_value": p, "estimate": 0.3, "unit": "s", "minimum_detectable": 0.02}
        for i, (name, s, p) in enumerate(zip(ids, (312.0, 181.0, 9.0, 3.1, 1.2), (1e-60, 1e-30, 0.01, 0.2, 0.7),
                                             strict=True))
    ]  # fmt: skip
    cos2 = np.eye(5)
    cos2[0, 1] = cos2[1, 0] = 0.86
    steps = [1, 2, 5, 10, 20, 50]
    edges = np.geomspace(0.05, 5.0, 19)
    bands = [
        {"output": name, "frequency_hz": [float(low), float(high)], "ratio": 4.0 if low < 0.6 else 0.9,
         "significant": bool(low < 0.6)}
        for name in series
        for low, high in pairwise(edges)
    ]  # fmt: skip
    return {
        "title": "Turbine with a concealed effect", "series": series, "cells": cells(list(series)),
        "equations": equations(),
        "spectra": dict.fromkeys(series, spectrum), "bank": bank,
        "bands": bands, "confusion": {"ids": ids, "cos2": cos2.tolist()},
        "forensics": [{"check": "units", "channel": "pitch", "finding": "as declared", "severity": "none"}],
        "split": [{"file": "rec.csv", "start_s": 0.0, "stop_s": 240.0, "use": "fit"},
                  {"file": "rec.csv", "start_s": 480.0, "stop_s": 600.0, "use": "sealed"}],
        "parameters": [{"name": "k_beta", "unit": "N m/deg", "prior": -37710.0, "fitted": -37102.0, "std": 310.0,
                        "pull": 0.61}],
        "horizon": {"generator_speed": {"steps": steps, "before": [0.1, 0.15, 0.25, 0.4, 0.41, 0.41],
                                        "after": [0.03, 0.03, 0.04, 0.04, 0.045, 0.045]}},
        "candidates": candidates(), **sides(),
        "timing_s": {"predictor": 2.31, "score_bank": 3.9, "sham_runs": 24.1},
    }  # fmt: skip
