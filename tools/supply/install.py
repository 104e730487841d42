"""Install the packages of a requirements file by uv, with pip's settings: .venv/bin/python tools/supply/install.py FILE

uv takes half a minute for what takes pip two; the files are the same, since each is known by its hash. Exit code 0: all
is installed. Any other: pip is to be asked, which either does it or says why not: a setting of pip that uv has no word
for, an index that only pip can reach, a file that is not the tested one.
"""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

# Settings of pip, and what uv calls them; an environment variable where uv has no option.
OPTIONS = {"index-url": "--default-index", "extra-index-url": "--index", "find-links": "--find-links",
           "trusted-host": "--allow-insecure-host"}  # fmt: skip
VARIABLES = {"cert": "SSL_CERT_FILE", "proxy": "ALL_PROXY"}
SWITCHES = {"no-index": "--no-index", "no-cache-dir": "--no-cache"}
OF_NO_ACCOUNT = {
    *("cache-dir", "default-timeout", "disable-pip-version-check", "no-color", "no-input", "no-python-version-warning"),
    *(
        "prefer-binary",
        "progress-bar",
        "quiet",
        "require-virtualenv",
        "retries",
        "root-user-action",
        "timeout",
        "verbose",
    ),
}
ORDER = ("global", "install", ":env:")  # the later one holds
YES = {"1", "true", "yes", "on"}


def read_settings(told: str) -> dict[str, str]:
    """Return pip's settings from what `pip config list` prints; raises ValueError for lines of another form."""
    found: dict[str, tuple[int, str]] = {}
    for line in told.splitlines():
        place, _, value = line.partition("=")
        section, _, name = place.rpartition(".")
        if section not in ORDER:
            continue  # of another command
        rank = ORDER.index(section)
        text = str(ast.literal_eval(value))
        if rank >= found.get(name, (-1, ""))[0]:
            found[name] = rank, text
    return {name: text for name, (_, text) in found.items()}


def translate(settings: dict[str, str]) -> tuple[list[str], dict[str, str]]:
    """Return uv's options and environment for pip's settings; raises ValueError for one that uv has no word for."""
    options: list[str] = []
    environment: dict[str, str] = {}
    for name, value in settings.items():
        if name in OPTIONS:
            for word in value.split():
                options += [OPTIONS[name], word]
        elif name in SWITCHES:
            options += [SWITCHES[name]] if value.lower() in YES else []
        elif name in VARIABLES:
            environment[VARIABLES[name]] = value
        elif name not in OF_NO_ACCOUNT:
            raise ValueError(f"pip's setting {name} has no word in uv")
    return options, environment


def main(requirements: str) -> int:
    """Read pip's settings and run uv; returns its exit code, 1 where it cannot be asked."""
    uv = Path(sys.executable).with_name("uv")
    told = subprocess.run([sys.executable, "-m", "pip", "config", "list"], capture_output=True, text=True, check=False)
    try:
        options, environment = translate(read_settings(told.stdout))
    except (ValueError, SyntaxError) as error:
        print(error)
        return 1
    # Byte code is written here, as pip does: where it cannot be written later, each process would compile anew.
    command = [
        str(uv),
        "pip",
        "install",
        "--no-config",
        "--no-progress",
        "--compile-bytecode",
        "--python",
        sys.executable,
    ]
    command += ["--require-hashes", "--only-binary", ":all:", *options, "-r", requirements]
    return subprocess.run(command, env=os.environ | environment, check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
