"""Use the library as somebody else would: installed, as a subdirectory, and with the precisions mixed up.

python check.py SOURCE BUILD WORK {find_package,add_subdirectory,float_program,double_program}
BUILD is the build directory of the library, WORK a directory of this check's own.
"""

import shutil
import subprocess
import sys
from pathlib import Path


def run(*command: object, expect_failure: bool = False) -> str:
    """Run a command and return its output; end the check when it does not end as expected."""
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if (done.returncode != 0) != expect_failure:
        sys.exit(f"{' '.join(map(str, command))}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout + done.stderr


def main() -> None:
    """Configure, build and run the consumer project in one of its four forms."""
    source, build, work, form = Path(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3]), sys.argv[4]
    shutil.rmtree(work, ignore_errors=True)
    mixed = form.endswith("_program")
    how = "add_subdirectory" if form == "add_subdirectory" else "find_package"
    prefix = work / "installed"
    if how == "find_package":
        run("cmake", "--install", build, "--prefix", prefix, "--component", "development")
    run(
        *("cmake", "-S", source / "tests/consumer", "-B", work / "build", "-G", "Ninja", f"-DHOW={how}"),
        *(f"-DCMAKE_PREFIX_PATH={prefix}", f"-DAEOLID_SOURCE={source}", f"-DMIX={form if mixed else ''}"),
    )
    if mixed:
        text = run("cmake", "--build", work / "build", expect_failure=True)
        missing = "aeo_rls_init_f64" if form == "double_program" else "aeo_rls_init'"
        if "undefined reference" not in text or missing not in text:
            sys.exit(f"the mix failed, but not for want of {missing}:\n{text}")
        print(f"{form}: does not link, as it must")
        return
    run("cmake", "--build", work / "build")
    for program in ("use_float", "use_double"):
        print(run(work / "build" / program), end="")


if __name__ == "__main__":
    main()
