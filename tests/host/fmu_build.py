"""Build the functional mock-up unit of fmu_oscillator.c with the machine's compiler."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

import fmpy

SOURCE = Path(__file__).with_name("fmu_oscillator.c")
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="oscillator" guid="{{mass-on-a-spring}}"
    numberOfEventIndicators="{events}">
  {kind}
  <UnitDefinitions><Unit name="V"/><Unit name="m"/><Unit name="m/s"/></UnitDefinitions>
  <ModelVariables>
    <ScalarVariable name="drive" valueReference="0" causality="input" variability="continuous">
      <Real start="0" unit="{drive_unit}"/></ScalarVariable>
    <ScalarVariable name="position" valueReference="1" causality="output" variability="continuous">
      <Real unit="m"/></ScalarVariable>
    <ScalarVariable name="speed" valueReference="2" causality="output" variability="continuous">
      <Real unit="m/s"/></ScalarVariable>
    {rates}
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2"/><Unknown index="3"/></Outputs>{structure}</ModelStructure>
</fmiModelDescription>
"""
CO_SIMULATION = {
    "kind": '<CoSimulation modelIdentifier="oscillator" canHandleVariableCommunicationStepSize="true"/>',
    "events": "0", "rates": "", "structure": "",
}  # fmt: skip
MODEL_EXCHANGE = {
    "kind": '<ModelExchange modelIdentifier="oscillator"/>',
    "events": "1",
    "rates": "".join(
        f'<ScalarVariable name="der({name})" valueReference="{k}" causality="local" variability="continuous">'
        f'<Real derivative="{of}"/></ScalarVariable>'
        for k, (name, of) in enumerate((("position", 2), ("speed", 3)), 3)
    ),
    "structure": '<Derivatives><Unknown index="4"/><Unknown index="5"/></Derivatives>',
}


def build_fmu(folder: Path, drive_unit: str = "V", *, exchange: bool = False) -> Path:
    """Compile and pack the unit, for co-simulation or for model exchange; returns folder/oscillator.fmu."""
    folder.mkdir(parents=True, exist_ok=True)
    library, headers = folder / "oscillator.so", Path(fmpy.__file__).parent / "c-code"
    subprocess.run(
        ["cc", "-shared", "-fPIC", "-O2", f"-I{headers}", str(SOURCE), "-o", str(library)], check=True, timeout=3600
    )
    target, kind = folder / "oscillator.fmu", MODEL_EXCHANGE if exchange else CO_SIMULATION
    with zipfile.ZipFile(target, "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION.format(drive_unit=drive_unit, **kind))
        archive.write(library, "binaries/linux64/oscillator.so")
    return target
