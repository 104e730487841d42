"""Prove that the gates and the tests can fail: seed a defect in a copy of the sources and demand that it is found.

python selftest.py UNITY_DIR [all]; UNITY_DIR holds unity.c. One defect for each gate but the dear ones; or all of them
and those of the tests, which the nightly tests ask for: by day the mutants of gate_mutants show that tests can fail.
Exit code 0 when every defect was found, for the reason expected.
That gates and tests are content with the unharmed sources is for themselves to show, in the same run of ctest.
"""

import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from threading import Lock

sys.path.insert(0, str(Path(__file__).parent))
import gate

REPOSITORY = Path(__file__).resolve().parents[2]
GATES = Path(__file__).resolve().parent
FAST_MATH = ["-O3", "-ffast-math"]
SKIPPED = 77  # exit code of a gate whose tool is missing
# By night: gates that take 15 to 40 s to object, and all headers but one, which the same gate objects to.
DEAR = {"targets powerpc", "stack", "memory", "fuzz", "costs", "proof rls restore"}
DEAR |= {"headers rls.h", "headers markov.h", "headers status.h"}


@dataclass(frozen=True)
class Defect:
    """One change of one file, the gate or test that must object, and a word of its objection.

    flags: what the defect needs to show; a source is compiled with them alone, for a header all sources are.
    """

    finder: str
    file: str
    old: str
    new: str
    objection: str
    flags: tuple[str, ...] = ()


GATE_DEFECTS = [
    Defect("symbols", "src/status.c", '    return "unknown', '    puts("?");\n    return "unknown', "calls puts"),
    Defect(
        "symbols",
        "src/rls.c",
        "static void derive_from_forgetting(aeo_rls_t *self)",
        "int aeo_calls = 3;\nstatic void derive_from_forgetting(aeo_rls_t *self)",
        "keeps state",
    ),
    Defect(
        "symbols",
        "src/rls.c",
        "static void derive_from_forgetting(aeo_rls_t *self)",
        "int spare(void);\nint spare(void) { return 1; }\nstatic void derive_from_forgetting(aeo_rls_t *self)",
        "no aeo_",
    ),
    Defect("symbols", "include/aeolid/rls.h", "#define aeo_rls_theta ", "#define aeo_rls_beta ", "keeps its name"),
    Defect("headers watch.h", "include/aeolid/watch.h", '#include "aeolid/config.h"\n', "", "watch.h, gcc"),
    Defect("headers rls.h", "include/aeolid/rls.h", "    uint32_t health;", "    uint32_t class;", "c++"),
    Defect("headers markov.h", "include/aeolid/markov.h", " * CONTRACT", " * TERMS", "no CONTRACT"),
    Defect("headers status.h", "include/aeolid/status.h", "#ifndef AEOLID_STATUS_H", "#ifndef STATUS_H", "no guard"),
    Defect(
        "compilers gcc",
        "src/rls.c",
        "    const aeo_status_t status = aeo_rls_judge_config(config);",
        "    int n_unused;\n    const aeo_status_t status = aeo_rls_judge_config(config);",
        "unused",
    ),
    Defect(
        "compilers gcc",
        "src/triangle.c",
        "aeo_real_t sum = AEO_REAL(0);",
        "float part = AEO_REAL(0.1) * (aeo_real_t)n;\n    aeo_real_t sum = (aeo_real_t)part - (aeo_real_t)part;",
        "onver",
    ),
    Defect(
        "stack",
        "src/rls.c",
        "    const size_t n = self->config.regressors;\n    for",
        "    const size_t n = self->config.regressors;\n"
        "    volatile aeo_real_t copy[80];\n    copy[n % 80u] = self->gate;\n    for",
        "bytes",
    ),
    Defect(
        "memory",
        "src/rls.c",
        "    self->config = *config;",
        "    static volatile aeo_real_t spare[64];\n"
        "    spare[config->outputs] = config->forgetting;\n    self->config = *config;",
        "beyond the formula",
    ),
    Defect(
        "memory",
        "include/aeolid/rls.h",
        "(AEO_RLS_KEPT_WORDS(n, l) + AEO_RLS_WORK_WORDS(n))",
        "(AEO_RLS_KEPT_WORDS(n, l) + AEO_RLS_WORK_WORDS(n) + 1u)",
        "refused",
    ),
    Defect(
        "shape",
        "src/rls.c",
        "    return self != NULL ? self->health : 0u;",
        "    int k = 0;\n" + "    k++;\n" * 75 + "    return self != NULL ? self->health : 0u;",
        "lines",
    ),
    Defect("shape", "src/rls.c", "#include <string.h>", "#include <string.h>\n#include <stdlib.h>", "heap"),
    Defect(
        "size",
        "src/status.c",
        '    return "unknown status";',
        '    return "unknown status' + " and a sentence that takes its place in flash" * 40 + '";',
        "at most",
    ),
    Defect(
        "size",
        "src/rls.c",
        "static void derive_from_forgetting(aeo_rls_t *self)",
        "int aeo_calls = 3;\nstatic void derive_from_forgetting(aeo_rls_t *self)",
        "of data",
    ),
    Defect(
        "size",
        "src/rls.c",
        "static void derive_from_forgetting(aeo_rls_t *self)",
        'const char aeo_text[] = "'
        + "sixteen letters." * 60
        + '";\nstatic void derive_from_forgetting(aeo_rls_t *self)',
        "as linked",
    ),
    Defect("memory", "include/aeolid/els.h", "4,030 words", "4,300 words", "does not say"),
    Defect("memory", "include/aeolid/fast_rls.h", "+ 3u * (size_t)(m))", "+ 4u * (size_t)(m))", "refused"),
    Defect(
        "targets powerpc",
        "src/saved.c",
        "    to[0] = (aeo_real_t)(value >> 16);\n    to[1] = (aeo_real_t)(value & 0xFFFFu);",
        "    const uint16_t *half = (const void *)&value;\n    to[0] = half[1];\n    to[1] = half[0];",
        "powerpc float",
    ),
    Defect(
        "costs board",
        "src/rls.c",
        "    aeo_count_up(&self->count.updates);",
        "    find_innovation(self, z, y);\n    aeo_count_up(&self->count.updates);",
        "cortex_m4f is",
    ),
    Defect("costs", "docs/results/costs.md", "1,491 words", "1,191 words", "costs.md is not"),
    Defect(
        "fuzz",
        "src/rls_saved.c",
        "if (!body_holds(self, numbers, body))",
        "if (numbers[0] > 0xFFFFFFFEu)",
        "breaks the invariants",
    ),
    Defect(
        "proof rls restore",
        "src/rls_saved.c",
        "memcpy(self->factor, body, count_kept(self)",
        "memcpy(self->factor, body, (count_kept(self) + 3)",
        "FAILURE",
    ),
    Defect(
        "soak",
        "src/rls.c",
        "    const int quiet = news < self->gate;",
        "    const int quiet = news < self->gate || self->count.withheld > 0u;",
        "does not recover",
    ),
    Defect("soak", "src/linalg.c", "status = aeo_linalg_judge(y,", "status = aeo_linalg_judge(z,", "not finite"),
]

TEST_DEFECTS = [
    Defect(
        "rls",
        "src/strips.c",
        "(next > last) {\n            root_new = AEO_SQRT(next);\n            sums[j] = root / root_new * scale;",
        "(1) {\n            root_new = AEO_SQRT(next);\n            sums[j] = last / (root * root_new) * scale;",
        "inflate",
        ("-O2", "-DAEO_NO_VECTORS"),
    ),
    Defect(
        "rls",
        "src/settings.h",
        "lambda < AEO_REAL(1) ? AEO_REAL(1) / AEO_SQRT(lambda) : AEO_REAL(1);",
        "AEO_REAL(1) / AEO_SQRT(lambda);",
        "inflate",
        ("-O2", '-DAEO_CONFIG_HEADER="coarse_config.h"'),
    ),
    Defect("contract_rls", "src/strips.c", "c *old - k * (part)", "c *old + k * (part)", "law_equals_batch"),
    Defect(
        "contract_rls",
        "src/rls.c",
        "quiet ? AEO_REAL(1) : self->inverse_root_forgetting);",
        "AEO_REAL(1));",
        "law_equals_batch",
    ),
    Defect(
        "contract_rls",
        "src/rls.c",
        "aeo_linalg_scale(lambda * inverse, self->innovation",
        "aeo_linalg_scale(inverse, self->innovation",
        "law_residuals",
    ),
    Defect(
        "contract_rls",
        "src/linalg.c",
        "    return aeo_linalg_all_within(x, count, REAL_MAX);",
        "    while (count > 0 && !(x[count - 1] != x[count - 1])) {\n        count--;\n    }\n    return count == 0;",
        "restore_survives",
        tuple(FAST_MATH),
    ),
    Defect("contract_rls", "src/linalg.c", "        aeo_count_up(rejected);\n", "", "refusal"),
    Defect("contract_rls", "src/rls.c", "words < AEO_RLS_WORDS(n, l)", "words + 1 < AEO_RLS_WORDS(n, l)", "memory"),
    Defect(
        "contract_rls",
        "src/rls_saved.c",
        "self->factor, count_kept(self) * sizeof *saved",
        "self->factor, (count_kept(self) - 1) * sizeof *saved",
        "restore",
    ),
    Defect(
        "contract_rls",
        "src/rls.c",
        "memset(self->theta, 0, (size_t)(self->work - self->theta) * sizeof *self->theta);",
        "memset(self->innovation, 0, (size_t)(self->work - self->innovation) * sizeof *self->theta);",
        "law_reset",
    ),
    Defect("rls", "src/rls.c", "quiet = news < self->gate;", "quiet = news < AEO_REAL(0);", "quiet"),
    Defect("watch", "src/watch.c", "withheld > 1 ? 1u : 0u", "withheld > 2 ? 1u : 0u", "stop_learning"),
    Defect(
        "watch",
        "src/watch.c",
        "words[BROUGHT];\n    const int suspect",
        "AEO_REAL(1e9) * words[BROUGHT];\n    const int suspect",
        "million",
    ),
    Defect("watch", "src/watch.c", "suspect = lively && ", "suspect = ", "calm"),
    Defect("reboot", "src/regressor_saved.c", "    self->filled = (uint16_t)numbers[FILLED];\n", "", "no_mark"),
    Defect("reboot", "src/saved.c", "&& crc == find_crc(start, sealed)", "&& crc != 1u", "flipped"),
    Defect("lattice_life", "src/lattice_saved.c", "stages_hold(self, state)", "1", "names_what"),
    Defect(
        "rls", "src/rls.c", "        if (variance <= self->variance_max) {", "        if (variance >= 0) {", "bounded"
    ),
    Defect(
        "rls",
        "src/rls_saved.c",
        "memcpy(saved + AEO_RLS_SAVED_HEAD, self->factor",
        "memcpy(saved + AEO_RLS_SAVED_HEAD - 2, self->factor",
        "saved_head",
    ),
    Defect(
        "rls",
        "src/rls.c",
        "if (!find_innovation(self, z, y)) {",
        "if (find_innovation(self, z, y) > 1) {",
        "runaway",
    ),
    Defect("regressor", "src/regressor.c", "self->z[i] = self->z[i + m];", "self->z[i] = self->z[i + m - 1];", "order"),
    Defect("regressor", "src/regressor.c", "        self->filled = 0;\n    } else", "    } else", "hole"),
    Defect("regressor", "src/regressor.c", "if (step < half)", "if (step <= half)", "time"),
    Defect(
        "regressor",
        "src/regressor.c",
        "self->feedthrough >> i & 1u) != 0u",
        "self->feedthrough >> i & 2u) != 0u",
        "order",
    ),
    Defect(
        "markov",
        "src/markov.c",
        "/ layout->inverse[layout->inputs + i]",
        "* layout->inverse[layout->inputs + i]",
        "units_law",
    ),
    Defect("status", "src/status.c", '"a number is NaN or infinite"', '"done"', "own_sentence"),
    Defect("els", "src/els.c", "e = self->rls.residual[i];", "e = self->rls.innovation[i];", "bursts"),
    Defect("els", "src/guard.c", "return levels[POWER] > limit;", "return 0;", "divergence"),
    Defect("els", "src/guard.c", "OUTLIER_MAX * limit", "AEO_REAL(1e6) * limit", "outliers"),
    Defect(
        "els_life",
        "src/els.c",
        "(unsigned)regressor->block_length + self->config.present != self->config.regressors",
        "(unsigned)regressor->block_length > self->config.regressors",
        "does_not_fit",
    ),
    Defect(
        "contract_fast_rls",
        "src/fast_array.c",
        "aeo_linalg_scale(AEO_REAL(1) / lambda, f",
        "aeo_linalg_scale(AEO_REAL(-1) / lambda, f",
        "law_equals_batch",
    ),
    Defect("fast_rls", "src/fast_array.c", "r[c] += self->feedback * difference[c];", "", "errors_die_out"),
    Defect("fast_rls", "src/fast_array.c", "rest) = move - (after - before);", "rest) = 0 * move;", "small_residuals"),
    Defect("fast_rls", "src/fast_rls.c", "self->window[n + c] += draw_disturbance(self);", "", "collinear"),
    Defect("fast_rls", "src/fast_array.c", "*sum < NEWS_LEAST", "*sum < -GAIN_MAX", "without_sense"),
    Defect("fast_rls_saved", "src/saved.c", "(found < expected ||", "(i < 5u && found < expected ||", "names"),
    Defect("contract_lattice", "src/lattice.c", "        explain_present(self);\n", "", "law_equals_batch"),
    Defect(
        "contract_lattice",
        "src/lattice_read.c",
        "aeo_linalg_move_rows(older, &before, error, m, 1);",
        "",
        "law_residuals",
    ),
    Defect("lattice", "src/lattice.c", "self->following = self->orders < p;", "self->following = 0;", "new_window"),
    Defect("lattice", "src/settings.c", "shrink * lambda >= AEO_REAL(0.5)", "shrink >= AEO_REAL(0.5)", "in_time"),
    Defect(
        "lattice_life",
        "src/lattice.c",
        "return aeo_linalg_all_within(self->forward, m, AEO_LATTICE_ERROR_MAX) &&",
        "return 1 ||",
        "no_target_shows",
    ),
    Defect("frame", "src/frame.c", "if (i != FD_CHECK) {", "if (i != FD_CHECK && i != 0u) {", "golden"),
    Defect(
        "stream_values", "src/stream_values.c", "*crc = aeo_frame_crc32(*crc, message->value[i]);", "", "a_seal_follows"
    ),
    Defect("stream_snapshots", "src/spread.c", "i < left; i++", "i + 1u < left; i++", "repair_restores"),
    Defect("stream_snapshots", "src/stream.c", "crc = aeo_frame_crc32(crc, index);", "", "theta_arrives"),
    Defect(
        "stream_pacing",
        "src/stream_send.c",
        "? aeo_stream_cost_us(&self->config, self->frame.length)",
        "? self->frame_us",
        "can_fd_bus",
    ),
]


def copy_sources() -> Path:
    """Copy what a defect may touch into a directory of its own."""
    directory = Path(tempfile.mkdtemp(prefix="aeolid-selftest-"))
    for name in ("src", "include"):
        shutil.copytree(REPOSITORY / name, directory / name)
    (directory / "docs/results").mkdir(parents=True)
    shutil.copy(REPOSITORY / "docs/results/costs.md", directory / "docs/results")
    return directory


def run_gate(name: str, root: Path) -> tuple[bool, str]:
    """Return whether a gate, named with what follows its ROOT, was content, and what it said."""
    gate, *arguments = name.split()
    command = [sys.executable, GATES / f"{gate}.py", root, *arguments]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    return done.returncode in (0, SKIPPED), done.stdout + done.stderr


class Objects:
    """Compiled objects, each made once for the same text, headers and flags: most defects change one file of many."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.made: dict[str, Lock] = {}
        self.lock = Lock()

    def compile(self, source: Path, flags: list[str], include: list[Path]) -> tuple[Path, str]:
        """Return the object of a source, and the compiler's messages, empty when it compiled."""
        key = gate.digest(source, flags, include)
        with self.lock:
            own = self.made.setdefault(key, Lock())
        path = self.directory / f"{source.stem}-{key}.o"
        with own:  # the other worker may be making it
            if path.exists():
                return path, ""
            command = ["gcc", "-std=c99", *flags, *(f"-I{d}" for d in include), "-c", str(source), "-o", str(path)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            return path, "" if done.returncode == 0 else done.stderr or "compiler failed"

    def link(self, sources: dict[Path, list[str]], flags: list[str], include: list[Path], program: Path) -> str:
        """Compile sources, each with flags of its own, and link a program; returns the messages, empty when built."""
        made = [self.compile(source, own, include) for source, own in sources.items()]
        messages = "".join(told for _, told in made)
        if messages:
            return messages
        command = ["gcc", *flags, *(str(path) for path, _ in made), "-lm", "-o", str(program)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        return "" if done.returncode == 0 else done.stderr or "linker failed"


def run_program(defect: Defect, root: Path, unity: Path, objects: Objects) -> tuple[bool, str]:
    """Build a unit test, or the soak, over the sources in `root`; return whether it passed, and what it said."""
    unit, family = REPOSITORY / "tests/unity", REPOSITORY / "tests/family"
    include = [root / "include", root / "src"]
    sources = sorted((root / "src").glob("*.c"))
    if defect.finder == "soak":
        sources += [REPOSITORY / "tests/soak/soak.c", family / "family.c"]
        flags, arguments = ["-O2"], ["6e5"]
        include.append(family)
    else:
        sources += [*sorted((unit / "support").glob("*.c")), unit / f"test_{defect.finder}.c", unity / "unity.c"]
        flags, arguments = ["-DUNITY_INCLUDE_DOUBLE", *(defect.flags or ("-O1",))], []
        include += [unit / "support", unity]
    usual = flags if defect.finder == "soak" or defect.file.endswith(".h") else ["-DUNITY_INCLUDE_DOUBLE", "-O1"]
    each = {source: flags if source == root / defect.file else usual for source in sources}
    messages = objects.link(each, flags, include, root / "t")
    if messages:
        return True, "does not even compile: " + messages  # a defect that cannot be built proves nothing
    done = subprocess.run([root / "t", *arguments], capture_output=True, text=True, check=False, timeout=3600)
    failed = [line for line in done.stdout.splitlines() if ":FAIL" in line]
    return done.returncode == 0, "\n".join(failed) or done.stdout


def seed_defect(defect: Defect, unity: Path, objects: Objects) -> str:
    """Return what is wrong with the proof of one defect, empty when it was found."""
    root = copy_sources()
    try:
        path = root / defect.file
        text = path.read_text()
        if text.count(defect.old) < 1:
            return f"{defect.file}: nothing to seed, {defect.old!r} is not there"
        path.write_text(text.replace(defect.old, defect.new, 1))
        if (GATES / f"{defect.finder.split()[0]}.py").exists():
            content, said = run_gate(defect.finder, root)
            if content and "skipped" in said:
                return ""  # no tool, no proof: the gate's own test is skipped by name too
        else:
            content, said = run_program(defect, root, unity, objects)
        if content:
            return f"{defect.finder} did not object to {defect.new.strip()[:60]!r} in {defect.file}: {said[:300]}"
        if defect.objection not in said:
            return f"{defect.finder} objected to {defect.new.strip()[:60]!r} for another reason: {said[:300]}"
        return ""
    finally:
        shutil.rmtree(root, ignore_errors=True)


def main() -> None:
    unity = Path(sys.argv[1])
    defects = list(GATE_DEFECTS + TEST_DEFECTS)
    if sys.argv[2:] != ["all"]:
        defects = [d for d in {d.finder: d for d in reversed(GATE_DEFECTS)}.values() if d.finder not in DEAR]
    with tempfile.TemporaryDirectory(prefix="aeolid-objects-") as folder, ThreadPoolExecutor(2) as pool:
        objects = Objects(Path(folder))
        findings = [f for f in pool.map(lambda d: seed_defect(d, unity, objects), defects) if f]
    print("\n".join(findings) if findings else f"{len(defects)} seeded defects, every one found")
    sys.exit(1 if findings else 0)


if __name__ == "__main__":
    main()
