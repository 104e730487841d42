"""Write a bill of materials (CycloneDX 1.6, JSON): the C library and every Python package of tools/constraints.txt.

python tools/supply/sbom.py [FILE]   default build/sbom.json; needs the extra sbom (sh tools/setup tests has it)

The same tree gives the same components; serial number and time are the run's own.
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path

from cyclonedx.model import HashAlgorithm, HashType, Property
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentScope, ComponentType
from cyclonedx.model.license import LicenseExpression
from cyclonedx.output.json import JsonV1Dot6
from packageurl import PackageURL

sys.path.insert(0, str(Path(__file__).resolve().parent))
from licences import table
from lock import ROOT, read_lock

from aeolid import __version__


def source_hash() -> str:
    """Return the SHA-256 over the names and contents of the C library's sources and headers."""
    digest = hashlib.sha256()
    for path in sorted([*ROOT.glob("src/*.[ch]"), *ROOT.glob("include/aeolid/*.h")]):
        content = hashlib.sha256(path.read_bytes()).hexdigest()
        digest.update(f"{content}  {path.relative_to(ROOT).as_posix()}\n".encode())
    return digest.hexdigest()


def make_bom() -> Bom:
    """Return the bill: the tool as its subject, the library and the packages as its parts."""
    mit = [LicenseExpression("MIT")]
    tool = Component(name="aeolid", version=__version__, type=ComponentType.APPLICATION, bom_ref="aeolid", licenses=mit,
                     purl=PackageURL("pypi", name="aeolid", version=__version__))  # fmt: skip
    library = Component(
        name="libaeolid", version=__version__, type=ComponentType.LIBRARY, bom_ref="libaeolid", licenses=mit,
        description="the filters in C99, without dependencies; linked into the tool, the node and firmware",
        hashes=[HashType(alg=HashAlgorithm.SHA_256, content=source_hash())],
        properties=[Property(name="aeolid:hash-of", value="sha256sum src/*.[ch] include/aeolid/*.h, sorted by name")],
    )  # fmt: skip
    bom = Bom(components=[library])
    bom.metadata.component = tool
    used, lock = [library], read_lock()
    for name, version, licence, needed in table():
        package = Component(
            name=name, version=version, type=ComponentType.LIBRARY, bom_ref=f"{name}=={version}",
            scope=ComponentScope.REQUIRED if needed == "use" else ComponentScope.EXCLUDED,
            licenses=[LicenseExpression(licence)], purl=PackageURL("pypi", name=name, version=version),
            hashes=[HashType(alg=HashAlgorithm.SHA_256, content=lock[name][1])],
            properties=[Property(name="aeolid:needed-for", value=needed)],
        )  # fmt: skip
        bom.components.add(package)
        used += [package] if needed == "use" else []
    bom.register_dependency(tool, used)
    return bom


def main(target: Path) -> None:
    """Write the file."""
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(JsonV1Dot6(make_bom()).output_as_string(indent=1) + "\n", encoding="utf-8")
    print(target)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build/sbom.json")
