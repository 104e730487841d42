"""Hold the one script that a page may run, and the hash by which the page's policy names it."""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from pathlib import Path

MARK = "<!--zoom-->"  # in a page that has a figure for it; no text becomes a comment


@cache
def script() -> str:
    """Return what stands between the tags of the script."""
    return Path(__file__).with_name("zoom.js").read_text(encoding="utf-8")


@cache
def script_hash() -> str:
    """Return the script's SHA-256 as a policy writes it."""
    return "sha256-" + base64.b64encode(hashlib.sha256(script().encode()).digest()).decode()
