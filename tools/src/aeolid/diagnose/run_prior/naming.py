"""Say what was found in the catalogue's names, with its place, its values and what is not told from it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.hypotheses.parts.base import location
from aeolid.diagnose.hypotheses.parts.modes import KINDS
from aeolid.diagnose.hypotheses.simulators import settings
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.explain import Explanation, Found
from aeolid.diagnose.run_prior.hypotheses import Hypothesis
from aeolid.diagnose.run_prior.resonances import HIDDEN
from aeolid.diagnose.run_prior.standing import Standing

Told = dict[str, tuple[float, float]]  # name → value, deviation
_DRIVES = ("actuator_lag", "transport_delay", "actuator_second_order", "rate_limit")
_IN_PLANE = ("tower_side_side", "blade_edge")
_LATERAL = r"side.?(to.?)?side|(^|[\W_])ss([\W_]|$)|tayp|lateral"
_WORDS = {
    "actuator_lag": "{name} acts through a first-order lag of {tau_s:.3g} s that the simulation leaves out",
    "transport_delay": "{name} acts {delay_s:.3g} s later than in the simulation",
    "actuator_second_order": "{name} acts through a second-order drive of {omega_rad_s:.3g} rad/s with damping"
    " {damping:.2g} that the simulation leaves out",
    "backlash": "{name} acts with {width:.3g} {unit} of play (backlash) that the simulation leaves out",
    "deadband": "{name} acts only when it has moved by {width:.3g} {unit}, which the simulation leaves out",
    "rate_limit": "{name} moves no faster than {rate_per_s:.3g} {unit}, which the simulation leaves out",
    "dynamic_inflow": "{name} acts {overshoot:.2g} times more at once than in the end, over {tau_s:.3g} s: the wake"
    " takes its time (dynamic inflow), which the simulation leaves out",
    "unsteady_aero": "a share {lagging_share:.2g} of what {name} does comes {tau_s:.3g} s late (unsteady aerodynamics),"
    " which the simulation leaves out",
    "parameter_error": "{name} acts {factor:.3g} times as much as in the simulation",
    "air_density": "the air's density is off by {density_change:+.1%} from the simulation's: {name} acts by as much",
    "data_time_offset": "the outputs are stamped {offset_s:.3g} s late against the inputs",
    "sensor_lag": "{name} is measured through a lag of {tau_s:.3g} s that the simulation leaves out",
    "sensor_scale": "{name} reads {factor:.3g} times what the simulation says",
    "added_mass": "{name} moves {factor:.3g} times as much as in the simulation: another mass moves with it",
    "sensor_sign": "{name} has the other sign in the recording",
    "sensor_rectified": "{name} is recorded as its absolute value",
    "sensor_saturation": "{name} is cut at the ends of its range",
    "mass_imbalance": "the rotor is out of balance: a force turns with it that the simulation leaves out",
    "aero_imbalance": "the blades are not pitched alike: a load turns with the rotor that the simulation leaves out",
    "tower_shadow": "loads come {times} a revolution (tower shadow) that the simulation leaves out",
    "rotational_sampling": "loads come {times} a revolution (turbulence sampled by the blades) that the simulation"
    " leaves out",
}  # fmt: skip


@dataclass(frozen=True)
class Name:
    """Hold one name of an effect, with its share among those not told apart."""

    entry: str
    place: str
    told: Told
    units: Mapping[str, str]
    weight: float
    words: str = ""
    fault: bool = False


def names_of(found: Found, told: Told, explanation: Explanation, context: Mapping[str, Any]) -> list[Name]:
    """Return the names an effect may have, the likeliest first, shares summing to 1."""
    if found.standing is not None:
        return _standing_names(found.standing)
    if found.mode is not None:
        return [Name(_mode_name(found, context), f"output:{found.mode.output}", told, _MODE_UNITS, 1.0)]
    assert found.scored is not None
    h = found.scored.hypothesis
    units = dict(zip(h.names, h.units, strict=True))
    if h.of:
        return _moved_names(h, found, told, explanation)
    own = _physical(h, found, explanation, context)
    share = 1.0 / len(own)
    values = {n: v for n, (v, _) in told.items()}
    names = [Name(n, h.place, *_in_quantities(n, told, units), share, h.words.format(**values), h.fault) for n in own]
    if hidden := _hidden(h, found, explanation, context):
        return [*(replace(n, weight=0.4 * n.weight) for n in names), *hidden]
    if not found.rivals:
        return names
    each = 0.4 / len(found.rivals)
    names = [replace(n, weight=0.6 * n.weight) for n in names]
    for rival in found.rivals:
        pairs = zip(rival.hypothesis.names, rival.values, strict=True)
        open_values = {n: (v, np.inf) for n, v in pairs if n not in HIDDEN}
        r = rival.hypothesis
        words = r.words.format(**{n: v for n, (v, _) in open_values.items()})
        names.append(
            Name(r.entry, r.place, open_values, dict(zip(r.names, r.units, strict=True)), each, words, r.fault)
        )
    return names


def _in_quantities(name: str, told: Told, units: Mapping[str, str]) -> tuple[Told, Mapping[str, str]]:
    """Return values and units in the quantities of the entry that is named: a factor is a change of the density."""
    if name != "air_density" or "factor" not in told:
        return told, units
    factor, std = told["factor"]
    return {"density_change": (factor - 1, std)}, {"density_change": "1"}


def _hidden(h: Hypothesis, found: Found, explanation: Explanation, context: Mapping[str, Any]) -> list[Name]:
    """Return the modes in the rotor's plane that no output shows, where a drive of the torque explains little.

    The torque moves them, and the speed is what is left to show them: without its side-side mode a simulated tower was
    a second-order drive of the torque, 59 of 293 nats, seen in the speed. Drives that were there explained 89 % and
    more.
    """
    assert found.scored is not None
    torque = h.place.startswith("input:") and not _is_angle(h) and h.entry in _DRIVES
    if not (torque and is_turbine(context)) or found.scored.nats >= _explained(explanation):
        return []
    unseen = [
        k for k in KINDS if k.entry in _IN_PLANE and not any(re.search(k.pattern, n.lower()) for n in explanation.moved)
    ]
    place = max(explanation.moved, key=lambda n: explanation.moved[n])
    words = "the torque's effect on {0} differs as where {1}, which no output shows, is missing or another"
    return [Name(k.entry, f"output:{place}", {}, {}, 0.6 / len(unseen), words.format(place, k.words)) for k in unseen]


def _explained(explanation: Explanation) -> float:
    return in_force().run_prior.explained_share * explanation.lost


def _moved_names(h: Hypothesis, found: Found, told: Told, explanation: Explanation) -> list[Name]:
    """Return what moves a mode: a stiffness or a mass; its damping alone where its frequency stays.

    Both, where most of what separates the sides is left: then it may as well be a mode beside it.
    """
    (f, _), (zeta, _) = told["frequency_hz"], told["damping"]
    what = next((k.words for k in KINDS if re.search(k.pattern, h.place.lower())), "a mode")
    now = f"{what} of {h.of[0]:.3g} Hz and damping {h.of[1]:.2g} in the simulation is at {f:.3g} Hz with {zeta:.2g}"
    still = abs(f / h.of[0] - 1) < in_force().hypotheses.same_frequency
    names = ["damping_change"] if still else [h.entry, *(r.hypothesis.entry for r in found.rivals if r.hypothesis.of)]
    assert found.scored is not None
    if not still and found.scored.nats < _explained(explanation):
        names = list(dict.fromkeys([*names, "stiffness_change", "added_mass"]))
    why = {"damping_change": "it is damped otherwise", "stiffness_change": "its stiffness differs",
           "added_mass": "its mass differs"}  # fmt: skip
    words = {n: f"{now} in the recording: {why[n]}" for n in names}
    weights = [1.0] if len(words) == 1 else [0.6, *[0.4 / (len(words) - 1)] * (len(words) - 1)]
    return [Name(n, h.place, told, _MODE_UNITS, w, words[n]) for n, w in zip(words, weights, strict=True)]


def _standing_names(s: Standing) -> list[Name]:
    weights = [1.0] if len(s.entries) == 1 else [0.6, *[0.4 / (len(s.entries) - 1)] * (len(s.entries) - 1)]
    return [
        Name(
            e, s.place[e], dict(s.told.get(e, {})), {n: s.units.get(n, "1") for n in s.told.get(e, {})}, w, s.words[e],
            s.fault,
        )
        for e, w in zip(s.entries, weights, strict=True)
    ]  # fmt: skip


_MODE_UNITS = {"frequency_hz": "Hz", "damping": "1"}


def _mode_name(found: Found, context: Mapping[str, Any]) -> str:
    assert found.mode is not None
    if not is_turbine(context):
        return "structural_mode"
    if found.edge:
        return "blade_edge"
    return found.mode.kind or "structural_mode"


def _physical(h: Hypothesis, found: Found, explanation: Explanation, context: Mapping[str, Any]) -> list[str]:
    """Return what an operator may stand for: a factor on a turbine's pitch is aerodynamic, on its tower a mass."""
    if h.entry == "mass_imbalance":
        return _imbalance(explanation)
    if h.entry == "rotational_sampling":  # of a shadow, too, the first order may be all that shows
        return ["tower_shadow", "rotational_sampling"]
    if h.entry == "sensor_scale" and not h.fault and is_turbine(context) and _is_of_tower(h):
        assert found.scored is not None
        most = in_force().run_prior.mass_factor
        return ["sensor_scale", "added_mass"] if 1 / most < found.scored.values[0] < most else ["sensor_scale"]
    if h.entry != "parameter_error" or not is_turbine(context) or not h.place.startswith("input:"):
        return [h.entry]
    if not _is_angle(h):
        return ["parameter_error"]
    return ["air_density", "parameter_error"]


def _is_of_tower(h: Hypothesis) -> bool:
    """Tell whether an output shows how the tower swings: a heavier nacelle swings less under the same loads."""
    return any(k.place == "tower" and re.search(k.pattern, h.place.lower()) for k in KINDS)


def _is_angle(h: Hypothesis) -> bool:
    return bool(re.search(r"pitch|blpit|beta", h.place.lower()))


def _imbalance(explanation: Explanation) -> list[str]:
    """Return which imbalance a load once a revolution is, likeliest first.

    A heavy blade pulls the tower sideways and leaves the blades' own loads; one that is pitched otherwise has another
    mean load, which turns: tilt and yaw moments have it once a revolution.
    """
    once = explanation.once
    sideways = max((v for n, v in once.items() if re.search(_LATERAL, n.lower())), default=None)
    turning = max((v for n, v in once.items() if n.endswith(("_cosine", "_sine"))), default=None)
    if sideways is not None and turning is not None and abs(sideways - turning) > in_force().run_prior.line_log:
        return ["mass_imbalance"] if sideways > turning else ["aero_imbalance"]
    return ["mass_imbalance", "aero_imbalance"]


def without_mean_offset(x: Explanation, context: Mapping[str, Any]) -> Explanation:
    """Return an explanation without an offset of all blades' angle beside one blade that is pitched otherwise.

    The mean angle of a rotor one of whose blades is off by an angle is off by its third: one fault, told once.
    """
    loads = [f for f in x.found if f.scored is not None and f.scored.hypothesis.entry == "mass_imbalance"]
    if not any(names_of(f, {}, x, context)[0].entry == "aero_imbalance" for f in loads):
        return x
    return replace(x, found=tuple(f for f in x.found if f.standing is None or not _is_offset(f.standing)))


def _is_offset(s: Standing) -> bool:
    return s.entries[0] == "sensor_bias" and s.place["sensor_bias"].startswith("input:")


def statement(name: Name, units: Mapping[str, str], blades: int = 3) -> str:
    """Return one plain sentence; blades: of the rotor."""
    if name.words:
        return name.words
    channel = name.place.partition(":")[2] or name.place
    values = {k: v for k, (v, _) in name.told.items()}
    unit = name.units.get("width") or name.units.get("rate_per_s") or units.get(channel, "")
    if "frequency_hz" in values:
        what = next((k.words for k in KINDS if k.entry == name.entry), "a mode")
        return (
            f"{what} at {values['frequency_hz']:.3g} Hz with damping {values['damping']:.2g} is in the recording and"
            f" not in the simulation, seen most in {channel}"
        )
    try:
        return _WORDS[name.entry].format(name=channel, unit=unit, times=_times(blades), **values)
    except KeyError:
        return f"{entry(name.entry).name} at {name.place}"


def _times(count: int) -> str:
    return {1: "once", 2: "twice", 3: "three times"}.get(count, f"{count} times")


def effect_of(name: Name, units: Mapping[str, str], rivals: list[Name], blades: int = 3) -> dict[str, Any]:
    """Return an effect as diagnosis.json holds it; blades: of the rotor."""
    kind, channel = entry(name.entry), name.place.partition(":")[2]
    inputs = (channel,) if name.place.startswith("input:") else ()
    outputs = (channel,) if name.place.startswith("output:") else ()
    where = location(name.place, outputs=outputs, inputs=inputs)
    if "frequency_hz" in name.told:
        where["entry"] = next((k.place for k in KINDS if k.entry == name.entry), name.place)  # as the catalogue has it
        f, std = name.told["frequency_hz"]
        where["frequency_hz"] = [max(f - max(0.1 * f, 2 * std), 0.0), f + max(0.1 * f, 2 * std)]
    if name.place == "rotor" and kind.family in ("rotor_1p", "rotor_3p"):
        where["azimuth_order"] = blades if kind.family == "rotor_3p" else 1
    return {
        "id": name.entry, "family": kind.family, "statement": statement(name, units, blades), "location": where,
        "equation": kind.equation,
        "settings": [
            {"simulator": simulator, "set": text}
            for simulator, text in settings(name.entry, name.place, {k: v for k, (v, _) in name.told.items()})
        ],
        "parameters": {
            k: {"value": _finite(v), "std": _finite(s), "unit": name.units.get(k, "")}
            for k, (v, s) in name.told.items()
        },
        "rivals": [{"id": r.entry, "entry": r.place, "weight": r.weight} for r in rivals],
        "weight": name.weight,
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
