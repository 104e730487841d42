"""Name what makes a rotor answer its pitch angle otherwise: lift that builds up late, a blade that bends, a slow wake.

Between one and six revolutions a late answer is a delay T, told as the angle Ω T that the rotor turns by meanwhile:
circulation takes 3.5 c/(2 V) to build up (Jones 1938: 0.165/0.0455 + 0.335/0.3 half chords), 0.05 to 0.15 rad on
slender to broad blades, a blade's first flapwise mode 2 ζ Ω/ω, 0.2 to 0.4 rad. What is quicker tells them apart: a
pitching profile without unsteady aerodynamics hardly moves the thrust there, a blade that bends takes up what wind
does. A wake in equilibrium takes up a part of every change, one with a time of its own none of the quick ones (Snel,
Schepers 1995), and where all settles nothing has changed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.hypotheses.parts.modes import KINDS
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.pair import Pair
from aeolid.diagnose.run_prior.responses import Answering, Answers, fitted
from aeolid.models.multiblade import without_part

Array = NDArray[np.float64]
ANGLE = r"pitch|blpit|beta"  # of names of inputs that turn the blades
_SLOW, _SWELL, _QUICK, _FALL = (0.0, 6.0), (6.0, 13.0), (8.0, np.inf), (15.0, np.inf)  # bands in orders of the rotor
_SLACK = 0.1  # part of a response that no delay and gain need explain: a resonance beside it


@dataclass(frozen=True)
class Seen:
    """Hold what a part of the recordings shows against the runs, each with its deviation.

    late: Ω T in rad of slow answers; gain: logarithm of the gain of all answers; apart: of an output's over
    that, at most; quick: of that of quick answers of the
    thrust; fall, swell: logarithms of the power of what wind does to the thrust, quick and middling over slow.
    """

    late: float
    late_std: float
    gain: float
    gain_std: float
    apart: float
    quick: float
    quick_std: float
    fall: float
    swell: float
    fall_std: float


@dataclass(frozen=True)
class Answer:
    """Hold entries, likeliest first, the output that shows it, a sentence of each, nats on the sealed part."""

    entries: tuple[str, ...]
    channel: str
    words: Mapping[str, str]
    nats: float


def named(pair: Pair, answering: Answering | None, still: bool | None) -> Answer | None:
    """Return what the answers to the pitch angle tell, None where they tell nothing.

    still: whether the levels of power and thrust are the simulation's; None where they could not be compared.
    """
    if answering is None:
        return None
    angle, thrust = angle_of(pair), _thrust(pair)
    if angle is None or not thrust:
        return None
    outputs = shown_outputs(pair)
    whole, chosen, sealed = (
        _seen(answering, part, angle, thrust[0], outputs)
        for part in (answering.whole, answering.chosen, answering.sealed)
    )
    channel, nats = pair.shown[thrust[0]], replicated(answering, angle, outputs)
    if is_late(whole) and is_late(chosen, 0.5) and sealed.late > 0 and (bent := _bent(whole, channel, nats)):
        return bent
    if is_building_up(whole) and is_building_up(chosen, 0.5) and min(sealed.late, sealed.quick) > 0:
        return _building_up(whole, channel, nats)
    if is_second_bending(whole, bool(pair.blades)) and min(sealed.swell, -sealed.fall) > 0:
        words = (
            f"what wind does to {channel} is {np.exp(whole.swell):.2g} times as strong (in power) about ten times a"
            f" revolution and {np.exp(whole.fall):.2g} times above fifteen, as behind a flexible blade"
        )
        return Answer(("blade_flap",), channel, {"blade_flap": words}, nats)
    if still is not False and is_strong(whole) and sealed.gain > 0:
        return _strong(whole, channel, bool(still), nats)
    return None


def angle_of(pair: Pair) -> int | None:
    """Return the place of the input that turns the blades."""
    return next((i for i, n in enumerate(pair.inputs) if re.search(ANGLE, n.lower())), None)


def shown_outputs(pair: Pair) -> list[int]:
    """Return the places of outputs whose answers are compared: those that go with the thrust, then speeds."""
    return [*_thrust(pair), *_of_kind(pair, "drivetrain_torsion")]


def replicated(a: Answering, angle: int, outputs: Sequence[int]) -> float:
    """Return by how many nats the answers before the sealed part foretell those in it better than the runs' do.

    Outputs hear the same wind, so that they count as one.
    """
    at = list(outputs)
    seen, known = (np.asarray(x[:, angle][:, at]) for x in (a.sealed.H, a.sealed.V))
    nats = np.zeros(len(at))
    for side, sign in ((a.run, 1.0), (a.chosen, -1.0)):
        variance = known + side.V[:, angle][:, at]
        nats += sign * np.sum(np.abs(seen - side.H[:, angle][:, at]) ** 2 / variance + np.log(variance), axis=0)
    return float(nats.mean())


def is_other_rotor(pair: Pair, answering: Answering | None) -> bool:
    """Tell whether the sealed part's answers to the pitch angle are others than the simulation's."""
    angle, outputs = angle_of(pair), shown_outputs(pair)
    if answering is None or angle is None or not outputs:
        return False
    return replicated(answering, angle, outputs) > in_force().run_prior.group_nats


def is_late_rotor(pair: Pair, answering: Answering | None) -> bool:
    """Tell whether the rotor answers its pitch angle late, in the sealed part, too, whatever makes it so."""
    angle, thrust = angle_of(pair), _thrust(pair)
    if answering is None or angle is None or not thrust:
        return False
    outputs = shown_outputs(pair)
    whole, sealed = (_seen(answering, p, angle, thrust[0], outputs) for p in (answering.whole, answering.sealed))
    return is_late(whole) and sealed.late > 0


def left_late(pair: Pair, answering: Answering | None) -> Answer | None:
    """Return that blades bend where a rotor is later than lift can be and no drive of the angle was found to be.

    Full fields of turbulence load a disc through its sampling, so that the wind's loads do not show what blades take
    up. Drives are late, too, and bring the run back; what is asked here is what is left without a name.
    """
    angle, thrust, least = angle_of(pair), _thrust(pair), in_force().run_prior.bending_angle
    if answering is None or angle is None or not thrust:
        return None
    outputs = shown_outputs(pair)
    whole, chosen, sealed = (
        _seen(answering, part, angle, thrust[0], outputs)
        for part in (answering.whole, answering.chosen, answering.sealed)
    )
    if not is_late(whole) or whole.late <= least or min(chosen.late, sealed.late) <= 0.5 * least:
        return None
    words = f"{_late_words(whole)}, and no drive of the angle explains it: the blades bend flapwise"
    return Answer(("blade_flap",), pair.shown[thrust[0]], {"blade_flap": words}, replicated(answering, angle, outputs))


def told_apart(pair: Pair, answering: Answering | None) -> str:
    """Say which inputs are answered otherwise than in the simulation; empty where answers cannot be compared."""
    outputs = shown_outputs(pair)
    if answering is None or not outputs:
        return ""
    least = in_force().run_prior.group_nats
    nats = {n: replicated(answering, i, outputs) for i, n in enumerate(pair.inputs)}
    other = [f"{n} ({v:.0f} nats on the test data)" for n, v in nats.items() if v > least]
    if not other:
        return f"the answers to {' and '.join(nats)} differ by no more than other wind makes them"
    same = [n for n in nats if nats[n] <= least]
    rest = f", those to {' and '.join(same)} by no more than other wind makes them" if same else ""
    return f"the answers to {' and '.join(other)} differ{rest}"


def is_late(s: Seen, share: float = 1.0) -> bool:
    """Tell whether answers come late: far enough for lift or a blade, and surely so."""
    rules = in_force().run_prior
    return s.late > rules.late_angle * share and s.late > rules.late_deviations * share * s.late_std


def is_strong(s: Seen) -> bool:
    """Tell whether the rotor answers more strongly, and not late."""
    rules = in_force().run_prior
    sure = s.gain > rules.strong_deviations * s.gain_std
    alike = s.apart < max(rules.strong_apart * s.gain, rules.late_deviations * s.gain_std)
    return sure and alike and s.quick > 0 and s.late < rules.late_angle and abs(s.swell) < rules.bending_swell


def is_second_bending(s: Seen, has_blades: bool) -> bool:
    """Tell whether wind's loads swell about a blade's second bending mode and fall above it."""
    rules = in_force().run_prior
    return has_blades and s.swell > rules.bending_swell and s.fall < -rules.bending_fall


def is_building_up(s: Seen, share: float = 1.0) -> bool:
    """Tell whether slow answers come late and quick ones are stronger, which together is sure.

    How late lift comes goes with the chord: on slender blades hardly later than other wind makes it look, so that what
    one of both lacks in deviations the other may have, or all answers: lift that builds up is weaker in the whole.
    """
    rules = in_force().run_prior
    late, quick = s.late / s.late_std, s.quick / s.quick_std
    plain = s.late > rules.lift_angle * share and s.quick > rules.quick_gain * share
    sure = min(late, quick) > rules.lift_deviations * share
    whole = np.sqrt(late**2 + quick**2 + max(s.gain / s.gain_std, 0.0) ** 2)
    together = whole > np.hypot(rules.late_deviations, rules.quick_deviations) * share
    return bool(plain and sure and together and s.late < rules.bending_angle)


def _late_words(s: Seen) -> str:
    return f"the rotor answers its pitch angle late, by the time in which it turns by {s.late:.2g} rad"


def _bent(s: Seen, channel: str, nats: float) -> Answer | None:
    """Return a blade that bends: late answers, and quick loads that wind does not make.

    Between a blade's first and second bending mode wind's loads go into its motion; above the second, where that is
    low, too.
    """
    rules = in_force().run_prior
    eased = min(s.fall, s.swell)
    if s.late <= rules.bending_angle or eased >= -rules.late_bending_fall:
        return None
    where = "above fifteen" if s.fall < s.swell else "about ten"
    words = (
        f"{_late_words(s)}, and what wind does to {channel} falls to {np.exp(eased):.2g} times the power {where} times"
        " a revolution: the blades bend flapwise"
    )
    return Answer(("blade_flap",), channel, {"blade_flap": words}, nats)


def _building_up(s: Seen, channel: str, nats: float) -> Answer:
    words = (
        f"{_late_words(s)}, but {np.exp(s.quick):.2g} times as strongly as in the simulation when it turns quickly:"
        " lift builds up with the flow (unsteady aerodynamics)"
    )
    return Answer(("unsteady_aero",), channel, {"unsteady_aero": words}, nats)


def _strong(whole: Seen, channel: str, still: bool, nats: float) -> Answer:
    strength = f"the rotor answers its pitch angle {np.exp(whole.gain):.3g} times as strongly as in the simulation"
    same = ", while its levels are the same" if still else ""
    words = {
        "dynamic_inflow": f"{strength}{same}: the wake takes its time (dynamic inflow)",
        "air_density": f"{strength}: the air is denser",
    }
    names = ("dynamic_inflow",) if still else ("dynamic_inflow", "air_density")
    return Answer(names, channel, {n: words[n] for n in names}, nats)


def _thrust(pair: Pair) -> list[int]:
    """Return places of outputs that go with the thrust: mean flap moments of all blades, then the tower fore-aft."""
    return [*_of_kind(pair, "blade_flap"), *_of_kind(pair, "tower_fore_aft")]


def _of_kind(pair: Pair, entry: str) -> list[int]:
    pattern = next(k.pattern for k in KINDS if k.entry == entry)
    parts = ("collective",) if entry == "blade_flap" else ("",)
    found = [(j, *without_part(n)) for j, n in enumerate(pair.shown)]
    return [j for j, stem, part in found if part in parts and re.search(pattern, stem.lower())]


def _seen(a: Answering, part: Answers, angle: int, thrust: int, outputs: Sequence[int]) -> Seen:
    places, turn = (angle, outputs), 2 * np.pi * a.hz
    slow = fitted(part, a.run, _within(a, _SLOW), a.orders, a.hz, places, _SLACK)
    every = fitted(part, a.run, a.orders > 0, a.orders, a.hz, places, _SLACK)
    weights = every.gain_std**-2
    gain = float(np.sum(weights * every.gain) / weights.sum())
    common = np.sqrt(len(outputs))  # all outputs hear the same wind
    rest = np.log(part.rest[:, thrust] / a.run.rest[:, thrust])
    count = np.minimum(part.count, a.run.count)
    base, base_var = _mean(rest, count, _within(a, _SLOW))
    fall, fall_var = _mean(rest, count, _within(a, _FALL))
    swell, _ = _mean(rest, count, _within(a, _SWELL))
    quick, quick_std = _strength(a, part, angle, thrust)
    return Seen(
        turn * slow.delay_s, turn * slow.delay_std_s * common, gain, float(every.gain_std.mean()),
        float(np.abs(every.gain - gain).max()), quick, quick_std, fall - base, swell - base,
        float(np.hypot(np.sqrt(base_var + fall_var), in_force().run_prior.rest_spread)),
    )  # fmt: skip


def _strength(a: Answering, part: Answers, angle: int, thrust: int) -> tuple[float, float]:
    """Return the logarithm of the size of quick answers of the thrust, a part's over the runs', and its deviation."""
    at, logs, variance = _within(a, _QUICK), [], 0.0
    if not at.any():
        return 0.0, np.inf
    for s in (part, a.run):
        square, V = np.abs(s.H[at, angle, thrust]) ** 2, s.V[at, angle, thrust]
        power = max(float(np.sum(square - V)), float(np.sum(V)), 1e-300)  # no less than what cannot be told from none
        logs.append(0.5 * float(np.log(power)))
        variance += float(np.sum(2 * np.maximum(square - V, 0.0) * V + V**2)) / (2 * power) ** 2
    return logs[0] - logs[1], float(np.sqrt(variance))


def _within(a: Answering, band: tuple[float, float]) -> NDArray[np.bool_]:
    return np.asarray((a.orders > band[0]) & (a.orders < band[1]))


def _mean(values: Array, count: Array, at: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the mean of logarithms of power ratios over bands, and its variance: two sides of so many averages.

    Of no bands, where samples are too rare for them, it is 0 and anything.
    """
    total = float(count[at].sum())
    if total <= 0:
        return 0.0, np.inf
    return float(np.sum(values[at] * count[at]) / total), 2.0 / total
