"""Write cases as a user would hand them in, and their answers under a seal."""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import re
import zlib
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from aeolid import output
from aeolid.challenge import engine, foreign, foreign_files
from aeolid.challenge.chain import NONE, kept
from aeolid.challenge.draw import DECIDABLE, Draw, build, draw_all, place
from aeolid.challenge.families import family_of
from aeolid.challenge.items import WAYS
from aeolid.challenge.plants import Plant, Setup, simulate
from aeolid.challenge.tables import names_of, write_file, write_roles, write_table
from aeolid.challenge.worth import core_of, discrete, linearise
from aeolid.errors import DataError, UsageError
from aeolid.inputs import read_bounded
from aeolid.text_files import MOST_JSON, load_json, parse_json

ANSWERS, SEAL = "answers.json.gz", "seal.json"
VERSION = 8  # of the generator: the same seed makes the same bytes within one version
Notice = Callable[[int, int], None]
Facts = dict[str, Any]
Plan = Iterator[tuple[Callable[[Path], None], Callable[[], Facts]]]  # what writes a case, and what tells its answer
TITLES = {"spring": "mass on a spring", "shaft": "motor and load", "tanks": "two tanks", "heater": "heated block",
          "turbine": "turbine above rated"}  # fmt: skip


def make(
    folder: Path, *, cases: int, seed: int, samples: int, physics: str = "own", chained: bool = True,
    notice: Notice | None = None
) -> Facts:  # fmt: skip
    """Write case directories, answers and seal; returns the seal.

    chained: recorded through a measurement chain, with small imperfections (foreign rigs always are);
    physics: of our plants ("own") or of rigs that another maker's engine simulates ("foreign"). The same arguments
    write the same bytes. Raises UsageError where the folder holds anything already, or the engine is not installed.
    """
    tell = notice or (lambda done, of: None)
    plan = PLANS[physics](cases, seed, samples, chained)
    try:
        output.make_folder(folder)
        if any(folder.iterdir()):
            raise UsageError(f"{folder}: is not empty; name a new folder")
        answers: dict[str, Facts] = {}
        hashes: dict[str, str] = {}
        tell(0, cases)
        for number, (put, answer) in enumerate(plan, 1):
            name = f"case-{number:04d}"
            put(folder / name)
            answers[name], hashes[name] = answer(), hash_of(folder / name)
            tell(number, cases)
        settings = {
            "version": VERSION,
            "physics": physics,
            "chain": chained or physics == "foreign",
            "seed": seed,
            "samples": samples,
            "cases": cases,
        }
        text = json.dumps({"settings": settings, "answers": answers}, indent=1, sort_keys=True)
        with output.replacing(folder / ANSWERS, own=True) as handle:
            handle.write(gzip.compress(text.encode(), mtime=0))
        seal = {"schema": 1, "answers": ANSWERS, "sha256": sha256(folder / ANSWERS), "cases": hashes}
        output.write_json(folder / SEAL, seal, own=True)
    except OSError as error:
        raise UsageError(f"{error.filename or folder}: cannot be written ({error.strerror or error})") from None
    return seal


def _own(cases: int, seed: int, samples: int, chained: bool) -> Plan:
    for sort, items, own in draw_all(cases, seed):
        draw = build(sort, items, own, samples, chained)
        yield partial(write_case, draw=draw, samples=samples), partial(answer_of, draw, samples)


def _foreign(cases: int, seed: int, samples: int, chained: bool) -> Plan:
    engine.require_engine()

    def plan() -> Plan:
        for case in foreign.draw_cases(cases, seed, samples):
            yield (partial(foreign_files.write_case, case=case, samples=samples),
                   partial(foreign_files.answer_of, case, samples))  # fmt: skip

    return plan()


PLANS: dict[str, Callable[[int, int, int, bool], Plan]] = {"own": _own, "foreign": _foreign}


def sha256(path: Path) -> str:
    """Return the digest of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def hash_of(case: Path) -> str:
    """Return one digest of all files of a case, names included."""
    total = hashlib.sha256()
    for path in sorted(p for p in case.rglob("*") if p.is_file()):
        total.update(f"{path.relative_to(case)} {sha256(path)}\n".encode())
    return total.hexdigest()


def read_seal(folder: Path) -> Facts:
    """Return seal.json; raises DataError where it is missing or is none."""
    path = folder / SEAL
    if not path.exists():
        raise DataError(f"{path}: no such file; `aeolid challenge make {folder}` writes a challenge")
    seal = load_json(path)
    if not isinstance(seal, dict) or seal.get("schema") != 1 or not isinstance(seal.get("cases"), dict):
        raise DataError(f"{path}: is not a seal of this version; make the challenge anew")
    digests = [seal.get("sha256"), *seal["cases"].values()]
    if not all(re.fullmatch(r"case-\d{4,}", n) for n in seal["cases"]) or not all(isinstance(d, str) for d in digests):
        raise DataError(f"{path}: is not a seal of this version; make the challenge anew")
    return seal


def open_answers(folder: Path) -> Facts:
    """Return the answers; raises DataError where they are not those that were sealed."""
    seal, path = read_seal(folder), folder / ANSWERS
    if not path.exists():
        raise DataError(f"{path}: no such file; the answers of this challenge are lost")
    packed = read_bounded(path, MOST_JSON)
    found = hashlib.sha256(packed).hexdigest()
    if found != seal["sha256"]:
        raise DataError(f"{path}: the seal is broken: its SHA-256 is {found[:12]}…, sealed was {seal['sha256'][:12]}…")
    try:
        with gzip.open(io.BytesIO(packed)) as handle:
            text = handle.read(MOST_JSON + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise DataError(f"{path}: is not packed by gzip ({error})") from None
    if len(text) > MOST_JSON:
        raise DataError(f"{path}: unpacks to more than {MOST_JSON} bytes")
    content: Facts = parse_json(text.decode("utf-8", "replace"), str(path))
    return content


def write_case(case: Path, draw: Draw, samples: int) -> None:
    """Write recording, roles, baseline and case.toml; nothing in them tells what is hidden."""
    output.make_folder(case)
    setup = place(draw, draw.strength)
    channels = _channels(setup)
    files = names_of(draw.runs)
    for number, name in enumerate(files):
        own = draw.seed + 1_000_003 * number
        columns = simulate(setup, samples // draw.runs, own)
        rows = kept(setup.chain, samples // draw.runs, np.random.default_rng([own, 8]))
        write_table(case / name, {k: v[rows] for k, v in columns.items()}, channels)
    write_roles(case / "roles.toml", channels)
    context = dict(setup.plant.context)
    if any(c[0] == "wave" for c in channels):
        context["offshore"] = True
    file = _write_baseline(case, draw, setup, channels, samples)
    lines = ["[case]", f'title = "{TITLES[setup.plant.name]}"', "[recordings]", f"files = {json.dumps(files)}"]
    lines += ['roles = "roles.toml"', "[baseline]", f'kind = "{draw.kind}"', f'file = "{file}"']
    lines += ["same_inputs = false"] if draw.kind == "run" else []
    lines += ["[context]", *(f"{k} = {json.dumps(v)}" for k, v in context.items())]
    write_file(case / "case.toml", "\n".join(lines) + "\n")


def _channels(setup: Setup) -> list[tuple[str, str, str, str]]:
    """List name, column of the simulation, unit and role of what is recorded."""
    plant = setup.plant
    found = [(c.name, c.name, c.unit, c.role) for c in plant.inputs]
    units = {c.name: c.unit for c in plant.outputs}
    found += [(o, o, units[o], "output") for o in setup.outputs]
    other = {"azimuth": ("azimuth", "azimuth", "deg", "azimuth"), "wind": ("wind", "wind", "m/s", "scheduling"),
             "warmth": ("temperature", "warmth", "degC", "disturbance"), "wave": ("wave", "wave", "m", "disturbance"),
             "seen": (plant.seen.name, "seen", plant.seen.unit, plant.seen.role)}  # fmt: skip
    return found + [other[r] for r in setup.roles]


def _write_baseline(
    case: Path, draw: Draw, setup: Setup, channels: list[tuple[str, str, str, str]], samples: int
) -> str:  # fmt: skip
    if draw.kind == "run":  # the same machine without what is hidden, in another wind
        write_table(
            case / "simulation.csv",
            simulate(replace(setup.believed, chain=NONE), samples, draw.seed + 50_000_017),
            channels,
        )
        return "simulation.csv"
    if draw.kind == "equations":
        write_file(
            case / "model.toml", setup.plant.model(setup.believed.base, setup.outputs, setup.declared, setup.memory)
        )
        return "model.toml"
    write_file(case / "model.json", json.dumps(state_space(setup.believed), indent=1) + "\n")
    return "model.json"


def state_space(setup: Setup) -> Facts:
    """Return the plant without the effect as a discrete linear model; on a turbine the wind is a state."""
    plant, bare = setup.plant, setup.bare
    model = linearise(bare, bare.base)
    names = [plant.state_names[plant.core.index(i)] for i in core_of(bare)]
    kept = len(names)
    if plant.name == "turbine":
        kept += 1
        names = [*names, ("gust", "m/s")]
    A, B, _ = discrete(model, plant.step_s)
    A, B, C = A[:kept, :kept], B[:kept], model.C[:, :kept]
    units = {c.name: c.unit for c in plant.outputs}
    inputs = [{"name": c.name, "unit": c.unit, "offset": o} for c, o in zip(plant.inputs, plant.rest, strict=True)]
    outputs = [{"name": o, "unit": units[o], "offset": float(y)} for o, y in zip(setup.outputs, model.y0, strict=True)]
    return {
        "kind": "state_space", "sample_time_s": plant.step_s, "inputs": inputs, "outputs": outputs,
        "states": [{"name": n, "unit": u} for n, u in names], "A": A.tolist(), "B": B.tolist(), "C": C.tolist(),
        "D": model.D.tolist(), "K": None, "x0": [0.0] * kept, "innovation_covariance": None, "scheduling": None,
    }  # fmt: skip


def answer_of(draw: Draw, samples: int) -> Facts:
    """Return what is sealed about a case."""
    setup = place(draw, draw.strength)
    hides = sorted({h for i in draw.items for h in i.hides} | _ways(draw, setup, setup.plant))
    value = draw.value
    worthy = None if value is None or not np.isfinite(value.nats) else round(value.nats, 2)
    return {
        "class": draw.sort, "plant": setup.plant.name, "baseline": draw.kind, "form": draw.form,
        "effects": [_effect(draw, i, k, setup) for k, i in enumerate(draw.items)],
        "hides": [{"way": h, "what": WAYS[h]} for h in hides],
        "nats": worthy, "vaf_points": None if value is None else round(value.vaf_points, 4),
        "decidable": draw.sort != "impossible" and (worthy is None or worthy >= DECIDABLE),
        "declared": {k: round(v, 6) for k, v in setup.declared.items()}, "closed_loop": setup.closed
        or setup.plant.always_closed, "seconds": samples * setup.plant.step_s,
        **(_chained(draw, setup) if setup.chain is not NONE else {}),
    }  # fmt: skip


def _chained(draw: Draw, setup: Setup) -> Facts:
    """Return what matters, and the small imperfections that do not."""
    return {
        "matters": [i.what for i in draw.items] or (["declared values"] if draw.sort == "parameter" else []),
        "chain": asdict(setup.chain), "recordings": draw.runs,
        "imperfections": {"dry": setup.weak, "declared": {k: round(v, 6) for k, v in setup.off.items()}},
    }  # fmt: skip


def _effect(draw: Draw, item: Any, number: int, setup: Setup) -> Facts:
    alone = place(replace(draw, items=(item,)), draw.strength[number : number + 1])
    quantity = None
    if item.quantity is not None and draw.form == 0 and draw.kind == "equations":
        quantity = {"label": item.quantity[0], "value": float(item.quantity[1](alone))}
    return {
        "what": item.what, "accepted": list(item.accepted), "strength": draw.strength[number], "quantity": quantity,
        "family": family_of(item.accepted[0]) if item.accepted else None, "random": item.random,
    }  # fmt: skip


def _ways(draw: Draw, setup: Setup, plant: Plant) -> set[int]:
    found = {14} if len(draw.items) > 1 else set()
    if draw.items and (setup.closed or plant.always_closed):
        found |= {1, 18}
    if draw.items and draw.kind == "run":
        found.add(8)
    return found | ({7} if draw.sort == "impossible" else set())
