"""Each blade passes the slower wind in front of the tower."""

from __future__ import annotations

from dataclasses import replace

from aeolid.diagnose.catalogue import rotor
from aeolid.diagnose.catalogue.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.models.equations import Equations, Parameter

_RATIO = "tower_shadow_ratio"
_FLOOR = 0.05  # of the typical force: below it the second harmonic fades, so that its score is that of the first


def _attach(site: Site) -> list[Attachment]:
    if not rotor.is_turbine(site):
        return []
    order, places = rotor.blades(site), rotor.hub(site)
    made = rotor.locked(
        site, "tower_shadow", places, order, "F = F*(cos(x) - second_harmonic*cos(2*x)), x = blades*azimuth + phase",
        lambda size, unit, where: (
            f"the blades pass through the tower's shadow: {size:.3g} {unit} at {where}, {order} times a turn,"
            " locked to the rotor; the model leaves it out"
        ),
    )  # fmt: skip
    twice = rotor.angle(site, 2 * order)
    return made if not made or twice is None else [_with_dip(made[0], places, twice)]


def _with_dip(made: Attachment, places: list[tuple[rotor.Place, str]], twice: rotor.Angle) -> Attachment:
    """Add the second harmonic: a dip where A cos(x − φ) = c cos x + s sin x is least, so −cos 2(x − φ)."""
    pairs = [(made.slots[2 * k].name, made.slots[2 * k + 1].name, p) for k, (p, _) in enumerate(places)]
    terms = []
    for k, (c, s, p) in enumerate(pairs):
        held, now = (_second(c, s, x, _FLOOR * p.size) for x in (twice.held, twice.now))
        terms.append(rotor.Term(p, held, now, f"tower_shadow_dip{k}"))

    def edit(model: Equations) -> Equations:
        model = made.edit(model)
        model = replace(model, parameters=(*model.parameters, Parameter(_RATIO, 0.0, "1", 0.0, 1.5)))
        for term in terms:
            model = term.on(model)
        return model

    ratio = Slot(_RATIO, "second_harmonic", "1", 0.0, 0.0, 1.5, 0.3, local=False)
    return replace(made, edit=edit, slots=(*made.slots, ratio), starts=({}, {_RATIO: 0.5}))


def _second(c: str, s: str, twice: str, floor: float) -> str:
    size = f"sqrt({c}**2 + {s}**2 + {floor * floor!r})"
    return f"-{_RATIO}*(({c}**2 - {s}**2)*cos({twice}) + 2*{c}*{s}*sin({twice}))/{size}"


ENTRY = Entry(
    id="tower_shadow",
    family="rotor_3p",
    name="tower shadow",
    equation="F = F*(cos(x) - second_harmonic*cos(2*x)), x = blades*azimuth + phase",
    source="Dolan and Lehn 2006, IEEE Trans. Energy Conversion 21(3): potential flow around the tower",
    quantities=(
        Quantity("force_N_cos", "N", -1e6, 1e6, 0.0, "first harmonic of the dip in thrust, cos part"),
        Quantity("force_N_sin", "N", -1e6, 1e6, 0.0, "sin part"),
        Quantity("second_harmonic", "1", 0.0, 1.5, 0.0, "second harmonic over the first: 0 smooth, towards 1 a dip"),
    ),
    attaches_to="tower fore-aft and rotor speed of a wind turbine whose rotor angle is recorded",
    signature="lines at the blades' multiple and its multiples, phase locked to the angle",
    confused_with=(
        (
            "rotational_sampling",
            "phase: a shadow's mean over turns at one angle stays, sampled turbulence averages out",
        ),
        ("wind_shear", "higher multiples: a shadow is a narrow dip, shear a smooth swing"),
        ("drivetrain_torsion", "another rotor speed: a shadow moves with it, a mode does not"),
    ),
    attach=_attach,
)
