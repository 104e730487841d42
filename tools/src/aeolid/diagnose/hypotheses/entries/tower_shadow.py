"""Each blade passes the slower wind in front of the tower."""

from __future__ import annotations

from dataclasses import replace

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts import rotor
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.forces import swing, swings
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting
from aeolid.models.equations import Equations

_SHARPNESS = "tower_shadow_sharpness"
_SHARPEST = 0.95  # a blade 42 m out that passes 0.7 m before the middle of the tower
_HIGHER = (2, 3)  # harmonics of the blades' passing by which the bank hears a narrow dip
_FLOOR = 1e-5  # of the typical force: where there is no swing the dip has no place either
_EQUATION = (
    "F = A*((1 + q^2)*cos(x) + 2*q)/(1 + 2*q*cos(x) + q^2)^2, q = sharpness,"
    f" A*cos(x) = {swing('force_N', 'blades*azimuth')}"
)


def _attach(site: Site) -> list[Attachment]:
    if not is_turbine(site.context):
        return []
    order, places = rotor.blades(site), rotor.hub(site)
    made = rotor.locked(
        site, "tower_shadow", places, order, _EQUATION,
        lambda size, unit, where: (
            f"the blades pass through the tower's shadow: {size:.3g} {unit} at {where}, {order} times a turn,"
            " locked to the rotor; the model leaves it out"
        ),
    )  # fmt: skip
    phase = rotor.angle(site, order)
    higher = [(k, a) for k in _HIGHER if (a := rotor.angle(site, k * order)) is not None]
    return made if not made or phase is None or not higher else [_dip(made[0], places, phase, higher)]


def _dip(
    made: Attachment, places: list[tuple[rotor.Place, str]], phase: rotor.Angle, higher: list[tuple[int, rotor.Angle]]
) -> Attachment:
    """Let all harmonics follow from the first one, A cos x with x = blades·azimuth − φ, and the sharpness q.

    The wind before the tower is that of a dipole: its harmonics are A k (−q)^(k−1) cos kx, q = e^(−blades·distance/arm)
    of a blade's path, and their sum is written in closed form. Where there is no swing yet, its slope knows of the
    first harmonic only; so that the bank hears a narrow dip, it listens to higher ones too, which fits hold at none.
    """
    terms: list[rotor.Term] = []
    heard: list[Slot] = []
    for k, (p, factor) in enumerate(places):
        c, s = made.slots[2 * k].name, made.slots[2 * k + 1].name
        write = _dip_in_speed if not p.is_force and rotor.looks_like("speed", p.output) else _dip_of
        held, now = (f"({write(c, s, x, _FLOOR * p.size)}){factor}" for x in (phase.held, phase.now))
        for n, angle in higher:
            own = [replace(made.slots[2 * k + i], name=f"{made.slots[2 * k + i].name}_{n}", label=None) for i in (0, 1)]
            more = [f"({own[0].name}*cos({x}) + {own[1].name}*sin({x})){factor}" for x in (angle.held, angle.now)]
            held, now, heard = f"{held} + {more[0]}", f"{now} + {more[1]}", heard + own
        terms.append(rotor.Term(p, held, now, f"tower_shadow_force{k + 1}"))
    sharpness = Slot(_SHARPNESS, "sharpness", "1", 0.0, 0.0, _SHARPEST, 0.2, local=False)

    def edit(model: Equations) -> Equations:
        return rotor.add_terms(model, [*made.slots, *heard, sharpness], terms)

    return replace(
        made, edit=edit, slots=(*made.slots, *heard, sharpness), fixed={s.name: 0.0 for s in heard},
        starts=({}, {_SHARPNESS: 0.4}, {_SHARPNESS: 0.7}),
    )  # fmt: skip


def _dip_of(c: str, s: str, x: str, floor: float) -> str:
    size, first = f"sqrt({c}**2 + {s}**2 + {floor * floor!r})", f"({c}*cos({x}) + {s}*sin({x}))"
    q = _SHARPNESS
    return f"((1 + {q}**2)*{first} + 2*{q}*({size} - {floor!r}))/(1 + 2*{q}*{first}/{size} + {q}**2)**2"


def _dip_in_speed(c: str, s: str, x: str, floor: float) -> str:
    """Write what a dip in torque leaves in the speed, its integral: A (−q)^(k−1) sin kx."""
    size, ahead = f"sqrt({c}**2 + {s}**2 + {floor * floor!r})", f"({s}*cos({x}) - {c}*sin({x}))"
    q = _SHARPNESS
    return f"({c}*cos({x}) + {s}*sin({x}))/(1 + 2*{q}*{ahead}/{size} + {q}**2)"


ENTRY = Entry(
    id="tower_shadow",
    family="rotor_3p",
    name="tower shadow",
    equation=_EQUATION,
    source="Dolan and Lehn 2006, IEEE Trans. Energy Conversion 21(3): potential flow around the tower",
    quantities=(
        *swings("first harmonic of the dip in thrust, and in torque"),
        Quantity("sharpness", "1", 0.0, _SHARPEST, 0.0, "0 a smooth swing, towards 1 a dip: e^(-blades*distance/arm)"),
    ),
    attaches_to="tower fore-aft and rotor speed of a wind turbine with a recorded rotor angle or speed",
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
    rank=460,
    settings=(
        Setting(OPENFAST, "AeroDyn: TwrPotent = 1 and TwrShadow = 1 (upwind: potential flow; downwind: wake)"),
        Setting(BLADED, "Aerodynamics: tower shadow, potential flow or empirical"),
    ),
)
