"""What to set in a simulator: of the drive that an effect sits at, with the values under the catalogue's own names."""

from __future__ import annotations

import re

import pytest
from test_run_standing import CONTEXT, turbine

from aeolid.diagnose.hypotheses.catalogue import ENTRIES, entry
from aeolid.diagnose.hypotheses.parts.settings import DERIVED, DRIVES_ELSE, DRIVES_PITCH, DRIVES_TORQUE
from aeolid.diagnose.hypotheses.simulators import settings
from aeolid.diagnose.run_prior.build import pair_of
from aeolid.diagnose.run_prior.hypotheses import all_hypotheses
from aeolid.formats.meanings import meaning_of

CLASSES = {"pitch": DRIVES_PITCH, "torque": DRIVES_TORQUE, "else": DRIVES_ELSE}
NAMES = {
    "pitch": ("pitch", "pitch_demand", "BldPitch1", "BlPitchC2", "PtchPMzc1", "PitCom1", "beta", "Pitch angle demand"),
    "torque": ("torque", "torque_demand", "GenTq", "gen_torque", "VS_LastGenTrq", "generator torque demand"),
    "else": ("wind", "wind_speed", "Wind1VelX", "HorWindV", "WE_Vw", "rotor_torque", "RotTorq", "LSShftTq", "u"),
}
KEYS = {  # words that belong to one drive alone
    "pitch": r"\b(PC|PA)_|BPCutoff|PitchDOF|Ptch|[Pp]itch",
    "torque": r"\bVS_|[Tt]orque|[Gg]enerator",
    "else": r"WindType",
}
AT_INPUTS = ("actuator_lag", "transport_delay", "actuator_second_order", "rate_limit", "input_saturation", "deadband",
             "backlash", "controller_state")  # fmt: skip
VALUES = {"tau_s": 0.4, "delay_s": 0.2, "omega_rad_s": 7.0, "damping": 0.7, "rate_per_s": 3.0, "width": 1.5,
          "low": -1.0, "high": 2.0, "gain": 0.3}  # fmt: skip


@pytest.mark.parametrize("kind", NAMES)
def test_every_input_is_at_one_kind_of_drive(kind: str) -> None:
    for name in NAMES[kind]:
        place = f"input:{name}".lower()
        assert [k for k, at in CLASSES.items() if re.search(at, place)] == [kind], name
        meant = meaning_of(name)
        if meant is not None and name != "beta":
            assert (meant.kind if meant.kind in CLASSES else "else") == kind, name


@pytest.mark.parametrize("name", AT_INPUTS)
def test_what_to_set_is_of_the_drive_that_the_effect_sits_at(name: str) -> None:
    """A rate limit of the torque was PC_MaxRat, a second-order drive of it PA_Mode, a lag of the wind a torque's."""
    said = {k: {t for p in NAMES[k] for _, t in settings(name, f"input:{p}", VALUES)} for k in CLASSES}
    for kind, texts in said.items():
        assert texts or (name, kind) == ("controller_state", "else")
        for other in CLASSES:
            own = re.compile(KEYS[other])
            assert other == kind or not any(own.search(t) for t in texts), (kind, other, texts)
    if name not in ("transport_delay", "controller_state"):
        assert not (said["pitch"] & said["torque"]) or name in ("deadband", "backlash")


def test_keys_are_those_of_the_drive() -> None:
    def text(name: str, place: str, simulator: str) -> str:
        return " ".join(t for s, t in settings(name, place, VALUES) if s == simulator)

    assert text("rate_limit", "input:gen_torque", "ROSCO").startswith("VS_MaxRat (N m/s) = 3 ")
    assert text("rate_limit", "input:pitch", "ROSCO").startswith("PC_MaxRat and PC_MinRat (rad/s) = ± 3 ")
    assert (
        text("actuator_second_order", "input:pitch", "ROSCO")
        == "PA_Mode = 2, PA_CornerFreq = 7 rad/s, PA_Damping = 0.7"
    )
    assert text("actuator_second_order", "input:torque", "ROSCO") == ""
    assert text("actuator_lag", "input:torque", "Bladed") == "Generator: torque time constant 0.4 s"
    assert "BPCutoff = 0.398 Hz" in text("actuator_lag", "input:pitch", "OpenFAST")  # 1/(2 pi 0.4 s)
    assert text("input_saturation", "input:gentq", "ROSCO") == "VS_MinTq, VS_MaxTq"


def test_a_row_names_quantities_of_its_own_entry_and_is_filled_with_their_values() -> None:
    for e in ENTRIES:
        own = {q.symbol: 0.5 for q in e.quantities}
        may = own.keys() | {name for name, (source, _) in DERIVED.items() if source in own}
        for row in e.settings:
            fields = set(re.findall(r"\{(\w+)", row.valued))
            assert fields <= may, (e.id, row)
            assert bool(fields) >= bool(row.general) and "{" not in row.general
            if fields:
                place = next((f"input:{n[0]}" for k, n in NAMES.items() if row.at == CLASSES[k]), "input:pitch")
                place = place if re.search(row.at, place) else "output:tower_acc_side_side"
                place = place if re.search(row.at, place) else "output:tower_acc_fore_aft"
                assert (row.simulator, row.general) not in settings(e.id, place, own), (e.id, row)


def test_what_is_told_against_a_run_has_the_names_of_the_catalogue() -> None:
    pair = pair_of([turbine(11)], [turbine(0)], CONTEXT)
    found = all_hypotheses(pair, {})
    assert {"rate_limit", "actuator_second_order", "dynamic_inflow", "sensor_scale"} <= {h.entry for h in found}
    for h in found:
        assert set(h.names) <= {q.symbol for q in entry(h.entry).quantities}, h.key
