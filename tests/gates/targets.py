"""Gate: firmware images and big-endian and RISC-V programs compute the bits that this PC computes.

python targets.py ROOT TARGET [day]; without TARGET all that this machine has tools for; `day`: in one precision, where
another target has the other one. Exit code 77 when a tool is missing, with its name. Every target is built with
-ffp-contract=off, by two compilers, from the same sources; what they print is a CRC-32 over theta and innovations of
every filter at several sizes (tests/firmware/digest.c).
"""

import platform
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

TESTS = Path(__file__).resolve().parents[1]
FIRMWARE = TESTS / "firmware"
COMMON = ["-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno", "-Wall", "-Wextra", "-Werror"]
UNUSED = ["-Wno-unused-command-line-argument"]  # flags of the linker; a compiler without this warning says nothing
BARE = ["-ffreestanding", "-nostdlib", "-static", "-fuse-ld=lld", "-fno-pic", f"-I{FIRMWARE / 'bare'}"]
MPS2 = ["-mthumb", "-mfloat-abi=hard", "-ffunction-sections", "-Wl,--gc-sections", "-nostartfiles"]
MPS2 += [f"-T{FIRMWARE / 'mps2.ld'}"]
WIDE = "-mavx" if platform.machine() in ("x86_64", "AMD64") else "-DNDEBUG"  # vectors of 32 bytes, where there are any
SYSTEM = ["-display", "none", "-serial", "none", "-monitor", "none", "-semihosting-config", "enable=on,target=native"]
COUNTING = ["-icount", "shift=6"]  # every instruction takes 64 ns, so that SysTick counts instructions


@dataclass(frozen=True)
class Target:
    """How to build for a machine and how to run there what was built."""

    compiler: list[str]
    board: str
    runner: list[str]
    precisions: tuple[str, ...]  # by day the first
    libraries: tuple[str, ...] = ()
    tools: tuple[str, ...] = ()
    library: tuple[str, ...] = ()  # how other gates compile the library for it, to the same code: once for all


def arm(machine: str) -> list[str]:
    """Return the command that runs an image on a board, the image's path to follow."""
    return ["qemu-system-arm", "-M", machine, *SYSTEM, *COUNTING, "-kernel"]


def clang(triple: str, *flags: str) -> list[str]:
    """Return clang as a compiler for a processor without any C library."""
    return ["clang", f"--target={triple}", *flags, *BARE]


TARGETS = {
    "pc": Target(["gcc"], "pc.c", [], ("float", "double"), ("-lm",), library=("gcc",)),
    # the same processor in other forms: no vectors, wider ones, another compiler, other levels (the last one counts)
    "pc-scalar": Target(["gcc", "-DAEO_NO_VECTORS"], "pc.c", [], ("float", "double"), ("-lm", "-O0")),
    "pc-small": Target(["gcc", "-DAEO_NO_VECTORS"], "pc.c", [], ("double", "float"), ("-lm", "-Os")),
    "pc-wide": Target(["gcc", WIDE], "pc.c", [], ("double", "float"), ("-lm", "-O3")),
    "pc-clang": Target(["clang"], "pc.c", [], ("float", "double"), ("-lm", "-Os")),
    "pc-clang-wide": Target(["clang", WIDE], "pc.c", [], ("float", "double"), ("-lm", "-O3")),
    "cortex-m4f": Target(
        ["arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", *MPS2],
        "mps2.c",
        arm("mps2-an386"),
        ("float",),
        ("-lm",),
        library=("arm-none-eabi-gcc", *gate.CORTEX_M4F),
    ),
    "cortex-m7": Target(
        ["arm-none-eabi-gcc", "-mcpu=cortex-m7", "-mfpu=fpv5-d16", *MPS2],
        "mps2.c",
        arm("mps2-an500"),
        ("double", "float"),
        ("-lm",),
    ),
    "riscv32": Target(
        clang("riscv32-unknown-elf", "-march=rv32imafc", "-mabi=ilp32f", "-mno-relax"),
        "bare/bare.c",
        ["qemu-riscv32"],
        ("float",),
        tools=("ld.lld",),
    ),
    "riscv64": Target(
        clang("riscv64-unknown-elf", "-march=rv64gc", "-mabi=lp64d", "-mno-relax", "-mcmodel=medany"),
        "bare/bare.c",
        ["qemu-riscv64"],
        ("double", "float"),
        tools=("ld.lld",),
    ),
    "powerpc": Target(
        clang("powerpc-unknown-linux-gnu"), "bare/bare.c", ["qemu-ppc"], ("float", "double"), tools=("ld.lld",)
    ),
}


def missing_tool(target: Target) -> str:
    """Return the first tool of a target that is not installed, empty when all are."""
    tools = (target.compiler[0], *target.runner[:1], *target.tools)
    return next((tool for tool in tools if shutil.which(tool) is None), "")


def compile_program(target: Target, program: str, precision: str, objects: Path, *flags: str) -> str:
    """Compile one of the programs of tests/firmware without the library; returns the messages, empty when compiled."""
    sources = [FIRMWARE / program, FIRMWARE / target.board, FIRMWARE / "text.c", TESTS / "family/family.c"]
    include = [gate.ROOT / "include", gate.ROOT / "src", FIRMWARE, TESTS / "family"]
    return gate.compile_each(target.compiler, [*_flags(target, precision, *flags), *UNUSED], include, sources, objects)


def build(target: Target, program: str, precision: str, path: Path, *flags: str) -> str:
    """Build one of the programs of tests/firmware for a target; returns the compiler's messages, empty when built.

    Args:
        target: the machine.
        program: name of the source.
        precision: `float` or `double`.
        path: of the program.
        flags: of the program; the library has those of the target.
    """
    objects = gate.scratch()
    if target.library:
        command, wanted = list(target.library), [*gate.LIBRARY, *gate.PRECISIONS[precision]]
    else:
        command, wanted = target.compiler, [*_flags(target, precision), *UNUSED]
    messages = compile_program(target, program, precision, objects, *flags)
    messages = messages or gate.compile_sources(command, wanted, objects)
    return messages or link(target, precision, sorted(objects.glob("*.o")), path)


def link(target: Target, precision: str, parts: list[Path], path: Path) -> str:
    """Link objects and archives; returns the linker's messages, empty when linked."""
    command = [*target.compiler, *_flags(target, precision), *map(str, parts), *target.libraries, "-o", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return "" if done.returncode == 0 else done.stderr or "compiler failed"


def _flags(target: Target, precision: str, *flags: str) -> list[str]:
    """Return the flags that a target's sources are compiled and linked with; the last level counts."""
    levels = [word for word in target.libraries if word.startswith("-O")]
    return [*COMMON, *gate.PRECISIONS[precision], *flags, *levels]


def run(target: Target, path: Path) -> tuple[int, list[str]]:
    """Run what was built; returns its exit code and the lines it printed."""
    done = subprocess.run([*target.runner, str(path)], capture_output=True, text=True, check=False, timeout=3600)
    return done.returncode, (done.stdout + done.stderr).splitlines()


def digest(name: str, precision: str, directory: Path) -> tuple[list[str], list[str]]:
    """Return what is wrong with a target, and the lines of its digest."""
    path = directory / f"{name}-{precision}"
    messages = build(TARGETS[name], "digest.c", precision, path)
    if messages:
        return [f"{name} {precision}: {messages}"], []
    code, lines = run(TARGETS[name], path)
    return ([f"{name} {precision}: exit code {code}, {' '.join(lines)[:300]}"] if code else []), lines


def main() -> None:
    words = [word for word in sys.argv[2:] if word != "day"]
    most = 1 if "day" in sys.argv[2:] else len(gate.PRECISIONS)
    wanted = words or [name for name, t in TARGETS.items() if name != "pc" and not missing_tool(t)]
    for name in wanted:
        tool = missing_tool(TARGETS[name])
        if tool:
            print(f"skipped: {name}, {tool} is not installed")
            sys.exit(77)
    findings, figures = [], []
    directory = gate.scratch()
    asked = {precision for name in wanted for precision in TARGETS[name].precisions[:most]}
    reference = {precision: digest("pc", precision, directory) for precision in sorted(asked)}
    for wrong, lines in reference.values():
        findings += wrong if lines else [*wrong, "pc: prints nothing"]
    for name in wanted:
        for precision in TARGETS[name].precisions[:most]:
            wrong, lines = digest(name, precision, directory)
            expected = reference[precision][1]
            findings += wrong
            pairs = zip(lines, expected, strict=False)
            findings += [f"{name} {precision}: {a} where this PC has {b}" for a, b in pairs if a != b]
            if len(lines) != len(expected):
                findings.append(f"{name} {precision}: {len(lines)} lines, this PC prints {len(expected)}")
            figures.append(f"{name} {precision}: {len(lines)} digests as on this PC")
    gate.finish(findings, "; ".join(figures))


if __name__ == "__main__":
    main()
