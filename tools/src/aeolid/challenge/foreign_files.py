"""Write the cases of foreign rigs, and what is sealed about them."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from aeolid import output
from aeolid.challenge.families import family_of
from aeolid.challenge.foreign import Case, record
from aeolid.challenge.tables import names_of, write_file, write_roles, write_table

Facts = dict[str, Any]


def write_case(folder: Path, case: Case, samples: int) -> None:
    """Write recordings, roles, baseline and case.toml; nothing in them tells what is hidden."""
    output.make_folder(folder)
    rig = case.rig
    channels = [(c.name, c.name, c.unit, c.role) for c in (*(() if rig.servo else (rig.drive,)), *rig.outputs)]
    files = names_of(case.runs)
    for number, file in enumerate(files):
        write_table(folder / file, record(case, samples // case.runs, number), channels)
    write_roles(folder / "roles.toml", channels)
    baseline = "model.toml" if case.kind == "equations" else "model.json"
    text = case.model() if case.kind == "equations" else json.dumps(case.state_space(), indent=1) + "\n"
    write_file(folder / baseline, text)
    lines = ["[case]", f'title = "{rig.title}"', "[recordings]", f"files = {json.dumps(files)}", 'roles = "roles.toml"']
    lines += ["[baseline]", f'kind = "{case.kind}"', f'file = "{baseline}"', "[context]", 'machine = "rig"']
    write_file(folder / "case.toml", "\n".join(lines) + "\n")


def answer_of(case: Case, samples: int) -> Facts:
    """Return what is sealed about a case: what matters, and the small imperfections that do not."""
    declared = {k: round(v, 6) for k, v in case.declared.items()}
    wrong = {k: round(v, 6) for k, v in case.wrong.items()}
    return {
        "class": case.sort, "plant": case.rig.name, "baseline": case.kind, "form": 0,
        "effects": [_effect(case, k) for k in range(len(case.hidden))], "hides": [], "nats": None, "vaf_points": None,
        "decidable": True, "declared": declared | wrong,
        "closed_loop": False, "seconds": samples * case.rig.step_s, "physics": "foreign", "recordings": case.runs,
        "moved": None if case.moved is None else round(case.moved, 4), "chain": asdict(case.chain),
        "matters": [e.what for e in case.hidden] or (["declared values"] if case.wrong else []),
        "imperfections": {"dry": case.background["dry"], "declared": declared},
    }  # fmt: skip


def _effect(case: Case, number: int) -> Facts:
    effect, quantity = case.hidden[number], None
    if effect.size is not None and case.kind == "equations" and len(effect.label):
        size = float(effect.size(case.truth))
        late = case.rig.step_s / size if effect.label in ("tau_s", "delay_s") else 0.0  # of a chain: within one sample
        quantity = {"label": effect.label, "value": size, "tolerance": effect.tolerance + late}
    return {
        "what": effect.what, "accepted": list(effect.accepted), "strength": case.strength[number], "quantity": quantity,
        "family": family_of(effect.accepted[0]) if effect.accepted else None, "random": False,
    }  # fmt: skip
