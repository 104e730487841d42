"""Build the functional mock-up unit of fmu_oscillator.c with the machine's compiler."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

import fmpy

SOURCE = Path(__file__).with_name("fmu_oscillator.c")
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="oscillator" guid="{{mass-on-a-spring}}">
  <CoSimulation modelIdentifier="oscillator" canHandleVariableCommunicationStepSize="true"/>
  <UnitDefinitions><Unit name="V"/><Unit name="m"/><Unit name="m/s"/></UnitDefinitions>
  <ModelVariables>
    <ScalarVariable name="drive" valueReference="0" causality="input" variability="continuous">
      <Real start="0" unit="{drive_unit}"/></ScalarVariable>
    <ScalarVariable name="position" valueReference="1" causality="output" variability="continuous">
      <Real unit="m"/></ScalarVariable>
    <ScalarVariable name="speed" valueReference="2" causality="output" variability="continuous">
      <Real unit="m/s"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2"/><Unknown index="3"/></Outputs></ModelStructure>
</fmiModelDescription>
"""


def build_fmu(folder: Path, drive_unit: str = "V") -> Path:
    """Compile and pack the unit; returns folder/oscillator.fmu."""
    folder.mkdir(parents=True, exist_ok=True)
    library, headers = folder / "oscillator.so", Path(fmpy.__file__).parent / "c-code"
    subprocess.run(
        ["cc", "-shared", "-fPIC", "-O2", f"-I{headers}", str(SOURCE), "-o", str(library)], check=True, timeout=60
    )
    target = folder / "oscillator.fmu"
    with zipfile.ZipFile(target, "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION.format(drive_unit=drive_unit))
        archive.write(library, "binaries/linux64/oscillator.so")
    return target
