"""Modes a model does not have: how one enters an output, and which name it gets on a turbine."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.settings import Setting
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.anatomy import ACCELERATION_UNITS, VELOCITY_UNITS
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Parameter, State

_DAMPING_START = 0.03
MOST_DAMPING = 0.7
RINGS = 0.3  # damping of a mode that still rings: a broader response is a lag, or the colour of noise
_EVERYWHERE = (0.0, float("inf"))


@dataclass(frozen=True)
class Kind:
    """Say which outputs show a mode of a turbine (pattern of their names), where it sits, its frequencies in Hz."""

    entry: str
    pattern: str
    place: str
    band_hz: tuple[float, float]
    words: str
    most_damping: float = 0.3  # a tower in the wind has a tenth; more is coloured noise, not a mode


# Frequencies: from multi-megawatt machines on soft towers to 100 kW ones; see each entry's source.
KINDS = (
    Kind("tower_fore_aft", r"fore.?aft|(^|[\W_])fa([\W_]|$)|dspfa|taxp|tax(s|p)?$|twrbsmyt", "tower", (0.08, 1.0),
         "the tower's fore-aft bending mode"),
    Kind("tower_side_side", r"side.?(to.?)?side|(^|[\W_])ss([\W_]|$)|dspss|tayp|tay(s|p)?$|twrbsmxt|lateral", "tower",
         (0.08, 1.0), "the tower's side-side bending mode"),
    Kind("blade_flap", r"flap|out.?of.?plane|(^|[\W_])oop([\W_]|$)|rootmy[bc]", "blade", (0.3, 2.5),
         "a flapwise blade mode", MOST_DAMPING),
    Kind("blade_edge", r"edge|lead.?lag|in.?plane|rootmx[bc]", "blade", (0.5, 4.0), "an edgewise blade mode"),
    Kind("drivetrain_torsion",
         r"gen(erator)?.?(speed|torque)|rot(or)?.?(speed|torque)|shaft|drive.?train|torsion|lss|hss",
         "shaft", (0.5, 6.0), "the drive train's torsion"),
)  # fmt: skip


def most_damping(kind: Kind | None) -> float:
    """Return the highest damping ratio of a mode of this kind; of one without a name where kind is None."""
    return RINGS if kind is None else kind.most_damping


def kind_of(name: str, site: Site) -> Kind | None:
    """Return which mode of a turbine an output of this name shows; None on other machines and for other names."""
    if not is_turbine(site.context):
        return None
    return next((k for k in KINDS if re.search(k.pattern, name.lower())), None)


def attach_named(entry: str, site: Site) -> list[Attachment]:
    """Attach this mode to every output of a turbine that shows it."""
    kinds = [kind_of(name, site) for name in site.output_names]
    found = [mode_at(site, j, k) for j, k in enumerate(kinds) if k is not None and k.entry == entry]
    return [a for a in found if a is not None]


def mode_at(site: Site, j: int, kind: Kind | None) -> Attachment | None:
    """Return the hypothesis of a mode in output j, driven by every input and by noise; None where no band is left."""
    name, tag = site.output_names[j], f"mode{j + 1}"
    w, zeta = f"{tag}_frequency_hz", f"{tag}_damping"
    low, high = _band(site, kind)
    if high < in_force().hypotheses.least_band * low:
        return None
    spread = float(np.nanstd(site.y[:, j])) or 1.0
    sizes = [spread / (float(np.std(site.u[:, i])) or 1.0) for i in range(len(site.input_names))]
    drives = {f"{tag}_b{i + 1}": s for i, s in enumerate(sizes)}
    loads = _loads(site, j, spread) if kind is not None else {}

    def edit(model: Equations) -> Equations:
        return _with_mode(model, tag, name, (low, high, most_damping(kind)), drives, loads, site)

    count = 24 if kind is None else 12
    first = 2 * low if kind is None else low
    slots = [
        Slot(w, "frequency_hz", "Hz", low, low, high, high / 3, local=False),
        Slot(zeta, "damping", "1", _DAMPING_START, 1e-4, most_damping(kind), 0.02, local=False),
    ]
    slots += [Slot(b, None, "", 0.0, -1e4 * s, 1e4 * s, 1e-3 * s) for b, s in drives.items()]
    slots += [Slot(n, None, "", 0.0, -1e4 * g.size, 1e4 * g.size, 1e-3 * g.size, local=False) for n, g in loads.items()]
    entry = kind.entry if kind is not None else "structural_mode"
    where = location(kind.place if kind is not None else f"output:{name}", outputs=(name,))
    return Attachment(
        entry, f"{entry} output:{name}", where, edit, tuple(slots), gain_states=(f"{tag}_q", f"{tag}_v"),
        starts=({}, {zeta: 3 * _DAMPING_START}),
        grid=tuple({w: float(f), zeta: _DAMPING_START} for f in np.geomspace(first, high * (1 - 1e-6), count)),
        equation="q'' + 2*damping*w*q' + w^2*q = w^2*b*u + noise, w = 2*pi*frequency_hz; the output sees"
        f" {_SEEN[derivatives_seen(site, j)]}",
        statement=lambda p: _statement(p, name, kind),
        credible=partial(not_had, own_modes(site, j), highest_hz(site)),
    )  # fmt: skip


@dataclass(frozen=True)
class _Load:
    """Hold what another output shows of the rotor's load: its number, its mean and the size of a gain from it."""

    output: int
    mean: float
    size: float


def _loads(site: Site, j: int, spread: float) -> dict[str, _Load]:
    """Return gains by which the other outputs of a linear model of a turbine may drive a mode.

    Thrust and torque move the structure; they follow wind and rotor as the model's own loads and speed do, not the
    inputs alone. Without them what the wind does to the mode has only the noise to come from (an OpenFAST tower was
    fitted at 0.287 and 0.232 Hz instead of 0.335).
    """
    if site.linear is None:
        return {}
    result = {}
    for k in range(len(site.output_names)):
        size = float(np.nanstd(site.y[:, k]))
        if k != j and size > 0:
            result[f"mode{j + 1}_g{k + 1}"] = _Load(k, float(np.nanmean(site.y[:, k])), spread / size)
    return result


def _band(site: Site, kind: Kind | None) -> tuple[float, float]:
    slowest = 4.0 / (len(site.u) * site.step)
    least, most = kind.band_hz if kind is not None else _EVERYWHERE
    return max(slowest, least), min(highest_hz(site), most)


def highest_hz(site: Site) -> float:
    """Return the highest frequency of a mode that the rows show: 0.4 of their rate."""
    return 0.4 / site.row_step


def beyond_rows(highest: float, p: Mapping[str, float]) -> str:
    """Object to a mode whose upper half-power frequency lies beyond the highest that rows show.

    What is seen of it is a slope, which a filter of the logger has there, too (of an analogue one at 39.3 Hz, rows at
    100 Hz, a mode of 39.6 Hz with damping 0.3).
    """
    upper = p["frequency_hz"] * (1 + p["damping"])
    return (
        f"its half-power band reaches {upper:.4g} Hz, beyond {highest:.4g} Hz that rows show" if upper > highest else ""
    )


def own_modes(site: Site, j: int) -> list[tuple[float, float]]:
    """Return frequency in Hz and damping of the modes of a linear model that show in output j."""
    if site.linear is None:
        return []
    poles, shapes = np.linalg.eig(site.linear.A)
    found = []
    for pole, shape in zip(poles, (site.linear.C @ shapes)[j], strict=True):
        if pole.imag > 0 and abs(shape) > 0:
            s = np.log(pole) / site.linear.sample_time_s if site.linear.sample_time_s else pole
            found.append((float(abs(s) / (2 * np.pi)), float(-s.real / abs(s))))
    return found


def not_had(own: Sequence[tuple[float, float]], highest: float, p: Mapping[str, float]) -> str:
    """Object to a mode that the model has: a second one on top of it stands for another size of the first.

    With its eight values more it took the name from a channel in another unit, by 23 nats of 6,900.
    """
    rules = in_force().hypotheses
    for frequency, damping in own:
        same = abs(p["frequency_hz"] - frequency) < rules.same_frequency * frequency
        if same and abs(p["damping"] - damping) < rules.same_damping * damping:
            return f"the model has this mode, at {frequency:.4g} Hz with damping {damping:.2g}"
    return beyond_rows(highest, p)


def _statement(p: Mapping[str, float], name: str, kind: Kind | None) -> str:
    what = "a mode" if kind is None else kind.words
    return (
        f"{what} at {p['frequency_hz']:.3g} Hz with damping {p['damping']:.2g} shows in {name};"
        " the model does not have it"
    )


_SEEN = ("q", "q'/w", "q''/w^2")


def derivatives_seen(site: Site, j: int) -> int:
    """Return how often an output's unit says that a deflection was differentiated."""
    unit = site.model.outputs[j].unit.replace(" ", "")
    return 1 if unit in VELOCITY_UNITS else 2 if unit in ACCELERATION_UNITS else 0


def _with_mode(
    model: Equations, tag: str, name: str, ranges: tuple[float, float, float], drives: Mapping[str, float],
    loads: Mapping[str, _Load], site: Site,
) -> Equations:  # fmt: skip
    """Add the mode's parameters and states, and what the output sees of it: q, q'/w or q''/w^2 by its unit.

    ranges: lowest and highest frequency in Hz, highest damping ratio.
    """
    q, v, w, zeta = (f"{tag}_{what}" for what in ("q", "v", "frequency_hz", "damping"))
    low, high, most = ranges
    extra = [Parameter(w, low, "Hz", low, high), Parameter(zeta, _DAMPING_START, "1", 1e-4, most)]
    extra += [Parameter(b, 0.0, "", -1e4 * s, 1e4 * s) for b, s in drives.items()]
    extra += [Parameter(n, 0.0, "", -1e4 * g.size, 1e4 * g.size) for n, g in loads.items()]
    terms = [f"{b}*{u}" for b, u in zip(drives, site.symbols, strict=True)]
    terms += [f"{n}*({ex.to_text(model.outputs[g.output].equation)} - {g.mean!r})" for n, g in loads.items()]
    push = " + ".join(terms) or "0"
    seen = (q, v, f"({push}) - {q} - 2*{zeta}*{v}")[derivatives_seen(site, site.output_names.index(name))]
    outputs = tuple(
        replace(o, equation=ex.combine("+", o.equation, ex.parse(seen, "mode"))) if o.name == name else o
        for o in model.outputs
    )
    states = swinging((q, v), w, zeta, push, model.sample_time_s)
    return replace(model, parameters=(*model.parameters, *extra), states=(*model.states, *states), outputs=outputs)


def swinging(pair: tuple[str, str], w: str, zeta: str, push: str, step: float) -> list[State]:
    """Write q̈ = ω²(push − q) − 2ζω q̇, w = ω/2π, exactly sampled (discrete) or as it stands (continuous); v is q̇/ω."""
    q, v = pair
    omega = f"(2*pi*{w})"
    if not step:
        forms = [f"{omega}*{v}", f"{omega}*(({push}) - {q} - 2*{zeta}*{v})"]
    else:
        t = f"({omega}*{step!r})"
        decay, turn = f"exp(-{zeta}*{t})", f"({t}*sqrt(1 - {zeta}**2))"
        ratio = f"({zeta}/sqrt(1 - {zeta}**2))"
        root = f"sqrt(1 - {zeta}**2)"
        x = f"({q} - ({push}))"
        forms = [
            f"({push}) + {decay}*({x}*(cos({turn}) + {ratio}*sin({turn})) + {v}/{root}*sin({turn}))",
            f"{decay}*({v}*(cos({turn}) - {ratio}*sin({turn})) - {x}/{root}*sin({turn}))",
        ]
    return [State(n, "", ex.parse(f, "mode"), 0.0, True) for n, f in zip(pair, forms, strict=True)]


def named_mode(
    entry: str, name: str, source: str, damping: str, rivals: tuple[tuple[str, str], ...], *,
    rank: int, settings: tuple[Setting, ...], bends: bool = False,
) -> Entry:  # fmt: skip
    """Return the entry of a mode of a turbine; damping says what is usual for it."""
    kind = next(k for k in KINDS if k.entry == entry)
    return Entry(
        id=entry,
        family="structural_mode",
        name=name,
        equation="q'' + 2*damping*w*q' + w^2*q = w^2*b*u, w = 2*pi*frequency_hz",
        source=source,
        quantities=(
            Quantity("frequency_hz", "Hz", *kind.band_hz, float("nan"), "natural frequency"),
            Quantity("damping", "1", 1e-4, kind.most_damping, float("nan"), f"damping ratio; {damping}"),
        ),
        attaches_to=f"on a wind turbine: outputs whose name says so ({kind.place})",
        signature="a narrow band in these outputs, phase turning by 180 degrees through it, at every rotor speed",
        confused_with=rivals,
        attach=lambda site: attach_named(entry, site),
        rank=rank,
        bends=bends,
        settings=settings,
    )
