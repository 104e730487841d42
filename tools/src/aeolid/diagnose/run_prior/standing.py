"""Name what moves levels, answers and unevenness: thinner air, shear, yaw, a wake, late lift, a blade that bends.

All numbers that decide stand in `rules`; a level that moved counts where both parts of the recording show it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts.modes import KINDS
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.answering import Answer, named
from aeolid.diagnose.run_prior.disc import Disc, disc_of
from aeolid.diagnose.run_prior.laws import Shift, shifts_of, wind_of
from aeolid.diagnose.run_prior.offsets import THRUST, Offset, offset_of
from aeolid.diagnose.run_prior.pair import Pair
from aeolid.diagnose.run_prior.responses import Answering
from aeolid.record import Record

_CUBE = 3  # of the wind a power goes with: IEC 61400-12-1 normalises wind speeds by the cube root of the density
_EXPONENT = 0.15  # of a density's change: what Cp and tip speed at a fixed angle make of that
_Z90 = 1.6449  # deviations at the ends of a normal value's 90 % interval
_IN_PLANE = ("drivetrain_torsion", "blade_edge", "tower_side_side")
_RATIOS = {"air_density": -0.6, "sensor_scale": 0.0, "cp_change": 1.0}  # thrust at an angle over wind at an angle


@dataclass(frozen=True)
class Standing:
    """Hold an effect that levels or unevenness tell: entries, likeliest first, with place, values and sentence each.

    nats, interval: what it gains on the sealed part; own: the recordings' own predictor proves it instead; answers: it
    is told by how the rotor answers, which moves the modes that the sides do not share; beside: it is told beside
    what an actuator or a sensor does; fault: the recording is at fault, not the simulation; units: of its
    values, by name, "1" for those that are not listed.
    """

    entries: tuple[str, ...]
    place: Mapping[str, str]
    told: Mapping[str, Mapping[str, tuple[float, float]]]
    words: Mapping[str, str]
    nats: float = 0.0
    interval: tuple[float, float] = (0.0, 0.0)
    own: bool = False
    answers: bool = False
    beside: bool = False
    units: Mapping[str, str] = field(default_factory=dict)
    fault: bool = False

    @property
    def cyclic(self) -> bool:
        """Tell whether tilt or yaw moments tell it."""
        return "wind_shear" in self.entries

    def rivalled(self, other: str, words: str) -> Standing:
        """Return the same with another effect of the rotor that is not excluded."""
        return replace(
            self, entries=(*self.entries, other), place={**self.place, other: "rotor"},
            words={**self.words, other: words},
        )  # fmt: skip


_THIN = "the air's density is another than the simulation's, which a pitch angle that is off looks like"


def standing_of(
    pair: Pair, records: Sequence[Record], runs: Sequence[Record], context: Mapping[str, Any],
    moved: Mapping[str, float], detected: bool, answering: Answering | None = None,
    stronger: Callable[[float], float] = lambda _: 0.0, displaced: Callable[[], Standing | None] = lambda: None,
) -> tuple[Standing, ...]:  # fmt: skip
    """Return what levels, answers and unevenness of a turbine tell, the level of power first; one effect at most.

    stronger: nats that are gained when the pitch angle acts by a factor; displaced: what a mode tells that the sides
    have at two frequencies, which is asked where nothing before it tells anything.
    """
    if not is_turbine(context):
        return ()
    laws = shifts_of(records, runs, context)
    wind = _sure(laws, "wind", in_force().run_prior.wind_shift)
    power = None if wind is None else _power(laws, wind, wind_of(records[0], runs[0]))
    if wind is not None or any(_sure(laws, law, in_force().run_prior.thrust_shift) for law in THRUST):
        sure = power is not None  # what of the wind is not known bears a density out, but refutes none
        acts = stronger if sure else (lambda factor: max(stronger(factor), 0.0))
        power = _of_angle(laws, offset_of(records, runs, context, laws), power or _thrust(laws), acts) or power
    if power is not None and power.interval[0] > in_force().evidence.proven_nats:
        return (power,)
    answer = named(pair, answering, _still(laws))
    found = answered(answer) if answer is not None else _blade(laws, moved) or _inflow(laws, detected)
    if found is not None:
        return (found,)
    disc = disc_of(pair, context)
    if disc is not None and disc.is_sure and (detected or disc.uneven):
        return (_sampled(disc),)
    last = (displaced() or grown(moved)) if detected else _thrust(laws)
    return () if last is None else (last,)


def _sure(laws: Mapping[str, Shift], law: str, least: float) -> Shift | None:
    shift = laws.get(law)
    return shift if shift is not None and shift.is_sure and abs(shift.share) > least else None


def _still(laws: Mapping[str, Shift]) -> bool | None:
    """Tell whether power and thrust at rest are the simulation's; None where no wind tells."""
    rules = in_force().run_prior
    if any(_sure(laws, law, rules.thrust_shift) for law in ("thrust", "thrust without wind")):
        return False
    return True if "wind" in laws else None


def answered(answer: Answer) -> Standing:
    """Return what the rotor's answers tell as what levels tell."""
    nats, interval = proof_of_shift(float(np.sqrt(2 * max(answer.nats, 0.0))), answer.nats)
    where = {n: f"output:{answer.channel}" if n == "blade_flap" else "rotor" for n in answer.entries}
    return Standing(answer.entries, where, {}, answer.words, nats, interval, answers=True)


def proof_of_shift(z: float, nats: float) -> tuple[float, tuple[float, float]]:
    """Return nats with their 90 % interval: z is normal, and nats are half of its square, with its sign."""
    low, middle, high = (0.5 * x * abs(x) for x in (abs(z) - _Z90, abs(z), abs(z) + _Z90))
    return nats, (nats - (middle - low), nats + (high - middle))


def _power(laws: Mapping[str, Shift], wind: Shift, channel: str) -> Standing:
    """Name why another wind goes with the same angle, torque and speed."""
    factor = (1 + wind.share) ** -_CUBE
    std = float(np.hypot(_CUBE * factor * wind.deviation / abs(wind.level), _EXPONENT * (1 - factor)))
    nats, interval = proof_of_shift(wind.sealed / wind.sealed_deviation, wind.nats)
    change = {"air_density": "density_change", "cp_change": "cp_change"}
    told = {e: {n: (factor - 1, std)} for e, n in change.items()}
    reads = 1 + wind.share
    told["sensor_scale"] = {"factor": (reads, wind.deviation / abs(wind.level))}
    where = {"air_density": "rotor", "cp_change": "rotor", "sensor_scale": f"channel:{channel}"}
    same = f"at the same pitch angle, torque and speed {channel} is off by {wind.share:+.1%} from the simulation's"
    words = {
        "air_density": f"the air's density is off by {factor - 1:+.1%} from the simulation's: {same}, and the thrust"
        " follows",
        "cp_change": f"the power coefficient is off by {factor - 1:+.1%} from the simulation's: {same}",
        "sensor_scale": f"{channel} reads {reads:.3g} times the simulation's wind: {same}",
    }
    return Standing(_by_thrust(laws, wind), where, told, words, nats, interval, beside=True)


def _of_angle(
    laws: Mapping[str, Shift], offset: Offset | None, other: Standing | None, stronger: Callable[[float], float]
) -> Standing | None:
    """Name an offset of the pitch angle where one brings wind and thrust back together; None elsewhere.

    Air of another density makes the angle act by as much more; where the recording contradicts that, the offset stands
    alone, and where it neither bears it out nor contradicts it, or the density is not known, both do. So they do where
    the thrust alone moved surely: at 15 MW 8 % less air left 0.1 deviations of an offset of -0.51 degrees, for the wind
    at one point is known to 0.9 %, and the angle acted no less, for a rotor in thin air stands at another one.
    """
    if offset is None or not offset.explains:
        return None
    rules = in_force().run_prior
    change = other.told.get("air_density", {}).get("density_change") if other is not None else None
    acts = 0.0 if change is None else stronger(1.0 + change[0])
    if acts > rules.rival_nats:
        return None
    told_by = max((laws[law] for law in ("wind", *THRUST) if law in laws), key=lambda s: abs(s.z))
    nats, interval = proof_of_shift(told_by.sealed / told_by.sealed_deviation, told_by.nats)
    entries: tuple[str, ...] = ("sensor_bias",)
    where = {"sensor_bias": f"input:{offset.channel}"}
    words = {
        "sensor_bias": f"{offset.channel} reads {offset.value:+.3g} {offset.unit} against the angle at which the"
        " simulation has the recorded power, thrust and wind: its sensor or the setting of all blades is off by as much"
    }
    told: dict[str, Mapping[str, tuple[float, float]]] = {"sensor_bias": {"bias": (offset.value, offset.deviation)}}
    if other is not None and acts > -rules.rival_nats:
        entries, where = (*entries, *other.entries), {**other.place, **where}
        told, words = {**other.told, **told}, {**other.words, **words}
    found = Standing(entries, where, told, words, nats, interval, beside=True, units={"bias": offset.unit})
    return found.rivalled("air_density", _THIN) if other is None else found


def _thrust(laws: Mapping[str, Shift]) -> Standing | None:
    """Name why the thrust alone differs at the same wind, where nothing else does: thinner air, or its gauges.

    The power's law asks the wind at an angle, which a large rotor's wind at one point says with too much noise.
    """
    thrust = _sure(laws, "thrust", in_force().run_prior.thrust_shift)
    if thrust is None:
        return None
    nats, interval = proof_of_shift(thrust.sealed / thrust.sealed_deviation, thrust.nats)
    std = thrust.deviation / abs(thrust.level)
    channel, same = thrust.channel, "at the same wind, pitch angle, torque and speed"
    words = {
        "air_density": f"{same} {channel} is off by {thrust.share:+.1%} from the simulation's: the air's density"
        " differs",
        "sensor_scale": f"{channel} reads {1 + thrust.share:.3g} times the simulation's {same}",
    }
    told = {
        "air_density": {"density_change": (thrust.share, float(np.hypot(std, _EXPONENT * thrust.share)))},
        "sensor_scale": {"factor": (1 + thrust.share, std)},
    }
    where = {"air_density": "rotor", "sensor_scale": f"channel:{channel}"}
    return Standing(("air_density", "sensor_scale"), where, told, words, nats, interval)


def _by_thrust(laws: Mapping[str, Shift], wind: Shift) -> tuple[str, ...]:
    """Return which of density, power coefficient and anemometer the thrust at a given angle allows, nearest first."""
    rules = in_force().run_prior
    thrust = laws.get("thrust without wind")
    if thrust is None:
        return ("air_density", "cp_change")
    ratio = thrust.share / wind.share
    slack = 2 * float(np.hypot(thrust.deviation / abs(thrust.level * wind.share), rules.thrust_ratio_slack))
    order = sorted(_RATIOS, key=lambda e: abs(ratio - _RATIOS[e]))
    return tuple(e for k, e in enumerate(order) if k == 0 or abs(ratio - _RATIOS[e]) < slack)


def _blade(laws: Mapping[str, Shift], moved: Mapping[str, float]) -> Standing | None:
    """Name a blade that bends: level and quick moves of the collective flap moment differ, the power does not."""
    rules = in_force().run_prior
    thrust = _sure(laws, "thrust", rules.thrust_shift) or _sure(laws, "thrust without wind", rules.thrust_shift)
    if thrust is None:
        return None
    channel = f"{thrust.channel}_collective"
    if moved.get(channel, 0.0) < rules.bent_ratio:
        return None
    words = (
        f"the blades bend flapwise otherwise than in the simulation: {channel} stands {thrust.share:+.1%} off, and its"
        f" quick changes are foretold {np.sqrt(moved[channel]):.2g} times worse than they need be, the power as well"
        " as ever"
    )
    return Standing(("blade_flap",), {"blade_flap": f"output:{channel}"}, {}, {"blade_flap": words}, own=True)


def grown(moved: Mapping[str, float]) -> Standing | None:
    """Name what the errors alone tell, one row ahead: which motions the runs no longer foretell. The last resort.

    moved: growth of the errors by output. Blades that bend otherwise spoil all motions out of the rotor's plane, the
    blades' common one more than the tower's, and the cyclic ones; a mode of tower, shaft or blades in that plane spoils
    the speed or the sideways motion and hardly any other. Without flapwise moments nothing is told: a late pitch drive
    spoils the speed, too, and the tower little.
    """
    kinds = {n: next((k.entry for k in KINDS if re.search(k.pattern, n.lower())), "") for n in moved}
    inside = {n: v for n, v in moved.items() if kinds[n] in _IN_PLANE}
    outside = {n: v for n, v in moved.items() if kinds[n] in ("tower_fore_aft", "blade_flap")}
    if "blade_flap" not in (kinds[n] for n in outside):
        return None
    if (common := _bent(kinds, outside)) is not None:
        least, most_grown = (np.sqrt(f(outside.values())) for f in (min, max))
        words = (
            f"the blades bend flapwise otherwise than in the simulation: {common}, the tower's fore-aft motion and"
            f" cyclic moments are foretold {least:.2g} to {most_grown:.2g} times worse than they need be"
        )
        return Standing(("blade_flap",), {"blade_flap": f"output:{common}"}, {}, {"blade_flap": words}, own=True)
    most, rules = max(inside, key=lambda n: inside[n], default=""), in_force()
    if not most or inside[most] < rules.run_modes.shown_growth:
        return None
    if max(outside.values()) - 1 > rules.run_prior.out_of_plane_share * (inside[most] - 1):
        return None
    names = sorted(_IN_PLANE, key=lambda e: e != kinds[most])
    said = (
        f"{most} is foretold {np.sqrt(inside[most]):.2g} times worse than it need be, and what moves out of the rotor's"
        " plane as well as ever: "
    )
    modes = {k.entry: f"{k.words} is missing or another" for k in KINDS if k.entry in names}
    words_of = {e: modes[e] if k else said + modes[e] for k, e in enumerate(names)}
    return Standing(tuple(names), dict.fromkeys(names, f"output:{most}"), {}, words_of, own=True)


def _bent(kinds: Mapping[str, str], outside: Mapping[str, float]) -> str | None:
    """Return the common flap moment where all that moves out of the rotor's plane has grown as behind other blades."""
    common = next((n for n in outside if kinds[n] == "blade_flap" and n.endswith("_collective")), None)
    tower = max((v for n, v in outside.items() if kinds[n] == "tower_fore_aft"), default=0.0)
    cyclic = [v for n, v in outside.items() if kinds[n] == "blade_flap" and n.endswith(("_cosine", "_sine"))]
    if common is None or not cyclic or min(cyclic) < in_force().run_modes.shown_growth:
        return None
    return common if outside[common] > tower > in_force().run_prior.bent_ratio else None


def _inflow(laws: Mapping[str, Shift], detected: bool) -> Standing | None:
    """Name what turns with the blades at the same wind and thrust: shear, yaw, and a wake that lags behind them."""
    rules = in_force().run_prior
    if any(_sure(laws, law, rules.thrust_shift) for law in ("thrust", "thrust without wind")):
        return None
    tilt, yaw = _sure(laws, "tilt", rules.cyclic_shift), _sure(laws, "yaw", rules.cyclic_shift)
    shift = max((s for s in (tilt, yaw) if s is not None), key=lambda s: abs(s.value), default=None)
    if shift is None:
        return None
    sure = [s for s in (tilt, yaw) if s is not None]  # two components of one load: each bears it out by itself
    z = float(np.hypot.reduce([s.sealed / s.sealed_deviation for s in sure]))
    nats, interval = proof_of_shift(z, sum(s.nats for s in sure))
    said = f"the {shift.law} moment of {shift.channel} stands {shift.share:+.1%} off at the same wind and thrust"
    words = {
        "dynamic_inflow": f"{said}, and loads answer otherwise: the wake takes its time (dynamic inflow)",
        "wind_shear": f"{said}: the wind's shear differs from the simulation's",
        "yaw_misalignment": f"{said}: the wind comes from aside",
    }
    if shift is yaw:
        names: tuple[str, ...] = ("yaw_misalignment", "wind_shear")
    elif abs(shift.share) > in_force().run_prior.wake_shift:
        names = ("wind_shear", "yaw_misalignment")
    elif detected:
        names = ("dynamic_inflow", "wind_shear")
    else:
        names = ("wind_shear", "yaw_misalignment", "dynamic_inflow")
    return Standing(names, dict.fromkeys(names, "rotor"), {}, words, nats, interval)


def _sampled(disc: Disc) -> Standing:
    nats, interval = proof_of_shift(disc.z, 0.5 * disc.z**2)
    what = "tilt and yaw moments are" if disc.uneven else "what comes as often as the blades is"
    words = (
        f"{what} {np.exp(disc.value):.2g} times as strong against slow common loads as in the simulation: turbulence"
        " differs over the rotor disc and the blades sample it"
    )
    name = "rotational_sampling"
    return Standing((name,), {name: "rotor"}, {}, {name: words}, nats, interval)
