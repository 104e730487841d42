"""Write equations as a functional mock-up unit: FMI 2.0, co-simulation, its sources and a library for this machine."""

from __future__ import annotations

import hashlib
import math
import os
import platform
import shutil
import subprocess
import tempfile
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from aeolid.errors import DataError
from aeolid.models.equations import TIME, Equations, Output, Parameter, State
from aeolid.models.exchange.c_simulation import c_simulation, checked_step, longest_dead_times, row_of
from aeolid.models.exchange.fmu_template import TEMPLATE
from aeolid.models.model_file import Signal
from aeolid.output import replacing

_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fvisibility=hidden", "-shared", "-fPIC")
_FOLDERS = {("Linux", "x86_64"): ("linux64", ".so"), ("Darwin", "x86_64"): ("darwin64", ".dylib"),
            ("Darwin", "arm64"): ("darwin64", ".dylib")}  # fmt: skip
_PATIENCE_S = 600.0  # of the compiler
_WHEN = (1980, 1, 1, 0, 0, 0)  # of all members: the same model gives the same bytes


def write_fmu(path: Path, model: Equations, step_s: float, *, name: str, source: str) -> tuple[str, ...]:
    """Write a unit with the equations' inputs, outputs, states, first states ("start of …") and parameters.

    step_s: time between two samples, s (see `c_simulation`). It has a library where a C compiler of this machine ($CC,
    cc, gcc or clang) makes one of a platform that FMI 2.0 names; the sources always, of which importers build their
    own. Returns notes on what it leaves out. Raises UsageError and DataError as `c_simulation` does, UsageError where
    the file cannot be written.
    """
    model = model.pruned()
    simulation, notes = c_simulation(model, step_s, name=name, source=source)
    identity = hashlib.sha256(simulation.encode()).hexdigest()[:32]
    unit = _unit(model, simulation, name, checked_step(model, step_s), identity)
    members = {
        "modelDescription.xml": _description(model, name, checked_step(model, step_s), identity),
        f"sources/{name}.h": simulation.encode(),
        f"sources/{name}_fmu.c": unit.encode(),
    }
    library, why = _library(name, members)
    if library is None:
        notes = (*notes, f"no library: {why}; importers build the unit from its sources")
    with replacing(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for member, content in sorted((members | (library or {})).items()):
            archive.writestr(zipfile.ZipInfo(member, _WHEN), content, zipfile.ZIP_DEFLATED)
    return notes


def _unit(model: Equations, simulation: str, name: str, step_s: float, identity: str) -> str:
    sizes = {"@R@": model.inputs, "@L@": model.outputs, "@N@": model.states, "@P@": model.parameters}
    words = {mark: str(len(having)) for mark, having in sizes.items()}
    words |= {"@INPUTS@": row_of(s.offset for s in model.inputs), "@GUID@": identity, "@STEP@": f"{step_s:g}"}
    words |= {"@UPPER@": name.upper(), "@name@": name}
    text = TEMPLATE
    for mark, word in words.items():
        text = text.replace(mark, word)
    return text


def _description(model: Equations, name: str, step_s: float, identity: str) -> bytes:
    """Return modelDescription.xml, FMI 2.0 sections 2.2 and 4.3."""
    root = ET.Element(
        "fmiModelDescription", fmiVersion="2.0", modelName=model.name or name, guid=identity,
        generationTool="aeolid", variableNamingConvention="flat", numberOfEventIndicators="0",
    )  # fmt: skip
    unit = ET.SubElement(
        root, "CoSimulation", modelIdentifier=name, canHandleVariableCommunicationStepSize=_truth(
            not model.sample_time_s
        ), canNotUseMemoryManagementFunctions="true", canGetAndSetFMUstate="true", canSerializeFMUstate="true",
    )  # fmt: skip
    ET.SubElement(ET.SubElement(unit, "SourceFiles"), "File", name=f"{name}_fmu.c")
    groups: Sequence[Sequence[Signal | Output | State | Parameter]] = (
        model.inputs, model.outputs, model.states, model.parameters,
    )  # fmt: skip
    units = sorted({s.unit for group in groups for s in group if s.unit})
    if units:
        defined = ET.SubElement(root, "UnitDefinitions")
        for text in units:
            ET.SubElement(defined, "Unit", name=text)
    ET.SubElement(root, "DefaultExperiment", startTime="0", stepSize=repr(step_s))
    variables = ET.SubElement(root, "ModelVariables")
    for index, (attributes, real) in enumerate(_variables(model, longest_dead_times(model, step_s))):
        scalar = ET.SubElement(variables, "ScalarVariable", {"valueReference": str(index)} | attributes)
        ET.SubElement(scalar, "Real", real)
    structure, first = ET.SubElement(root, "ModelStructure"), len(model.inputs) + 1
    for kind in ("Outputs", "InitialUnknowns"):
        listed = ET.SubElement(structure, kind)
        for index in range(first, first + len(model.outputs)):
            ET.SubElement(listed, "Unknown", index=str(index))
    ET.indent(root)
    written: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return written + b"\n"


def _variables(model: Equations, longest: Mapping[str, float]) -> list[tuple[dict[str, str], dict[str, str]]]:
    """Return the attributes of each variable and of its real, in the order of the value references.

    longest: of parameters that are dead times, up to what the unit has room for them, s.
    """
    found: list[tuple[dict[str, str], dict[str, str]]] = []
    for s in model.inputs:
        role = {"name": s.name, "causality": "input", "variability": "continuous"}
        if s.name == TIME:
            role["description"] = "set by the unit itself"
        found.append((role, _unit_of(s.unit) | {"start": repr(float(s.offset))}))
    for o in model.outputs:
        found.append(({"name": o.name, "causality": "output", "variability": "continuous"}, _unit_of(o.unit)))
    for x in model.states:
        found.append((_named(f"state {x.name}", model) | {"causality": "local", "variability": "continuous"},
                      _unit_of(x.unit)))  # fmt: skip
    for x in model.states:
        role = _named(f"start of {x.name}", model) | {"causality": "parameter", "variability": "fixed"}
        found.append((role, _unit_of(x.unit) | {"start": repr(float(x.initial))}))
    for p in model.parameters:
        limits = {"min": p.minimum, "max": p.maximum}
        if p.name in longest:
            limits = {"min": max(p.minimum, 0.0), "max": min(p.maximum, longest[p.name])}
        real = _unit_of(p.unit) | {"start": repr(float(p.value))}
        real |= {key: repr(float(v)) for key, v in limits.items() if math.isfinite(v)}
        found.append((_named(p.name, model) | {"causality": "parameter", "variability": "tunable"}, real))
    return found


def _named(name: str, model: Equations) -> dict[str, str]:
    """Return the name of what is no channel: with "parameter" before it where a channel has it already."""
    taken = {*(s.name for s in model.inputs), *(o.name for o in model.outputs)}
    return {"name": f"parameter {name}" if name in taken else name}


def _unit_of(unit: str) -> dict[str, str]:
    return {"unit": unit} if unit else {}


def _truth(value: bool) -> str:
    return "true" if value else "false"


def _library(name: str, members: Mapping[str, bytes]) -> tuple[dict[str, bytes] | None, str]:
    """Compile the unit; returns the member of the archive that holds it, or None and why not."""
    place = _FOLDERS.get((platform.system(), platform.machine()))
    if place is None:
        return None, f"FMI 2.0 has no name for {platform.system()} on {platform.machine()}"
    compiler = _compiler()
    if compiler is None:
        return None, "there is no C compiler here ($CC, cc, gcc or clang)"
    folder_name, suffix = place
    with tempfile.TemporaryDirectory(prefix="aeolid-fmu-") as folder:
        for member, content in members.items():
            target = Path(folder) / Path(member).name
            target.write_bytes(content)
        out = Path(folder) / f"{name}{suffix}"
        command = [compiler, *_FLAGS, "-o", str(out), str(Path(folder) / f"{name}_fmu.c"), "-lm"]
        _compile(command, folder)
        return {f"binaries/{folder_name}/{name}{suffix}": out.read_bytes()}, ""


def _compiler() -> str | None:
    found = (shutil.which(word) for word in (os.environ.get("CC", ""), "cc", "gcc", "clang") if word)
    return next((f for f in found if f), None)


def _compile(command: Sequence[str], folder: str) -> None:
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=_PATIENCE_S)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise DataError(f"{command[0]}: the unit could not be compiled ({error})") from None
    if done.returncode:
        raise DataError(f"{command[0]}: the unit could not be compiled: {' '.join(done.stderr.split())[:400]}")
