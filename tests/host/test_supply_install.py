"""What uv is told of pip's settings: nothing that pip goes by is lost on the way."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools/supply"))
import install

LISTED = """:env:.cert='/etc/ca.pem'
:env:.default-timeout='180'
global.cert='/other.pem'
global.extra-index-url='\\nhttps://a.example/simple\\nhttps://b.example/simple'
global.index-url='https://c.example/simple'
install.index-url='https://d.example/simple'
install.no-index='false'
download.no-index='true'
"""


def test_settings_have_the_order_that_they_have_for_pip() -> None:
    """The command's own section is above the global one, the environment above both; other commands have no say."""
    found = install.read_settings(LISTED)
    assert found == {
        "cert": "/etc/ca.pem", "default-timeout": "180", "index-url": "https://d.example/simple", "no-index": "false",
        "extra-index-url": "\nhttps://a.example/simple\nhttps://b.example/simple",
    }  # fmt: skip
    options, environment = install.translate(found)
    assert sorted(zip(options[::2], options[1::2], strict=True)) == [
        ("--default-index", "https://d.example/simple"), ("--index", "https://a.example/simple"),
        ("--index", "https://b.example/simple"),
    ]  # fmt: skip
    assert environment == {"SSL_CERT_FILE": "/etc/ca.pem"}
    assert install.translate({"no-index": "True", "find-links": "/a /b"})[0] == [
        "--no-index", "--find-links", "/a", "--find-links", "/b"
    ]  # fmt: skip


def test_a_setting_without_a_word_in_uv_leaves_it_to_pip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A client's certificate: uv is not even started."""
    with pytest.raises(ValueError, match="client-cert"):
        install.translate({"client-cert": "/me.pem"})
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    (tmp_path / "python").write_text("#!/bin/sh\n")  # what pip would list is given below
    (tmp_path / "python").chmod(0o755)
    monkeypatch.setattr(install, "read_settings", lambda told: {"client-cert": "/me.pem"})
    (tmp_path / "uv").write_text("#!/bin/sh\nexit 0\n")
    (tmp_path / "uv").chmod(0o755)
    assert install.main("nothing.txt") == 1
    monkeypatch.setattr(install, "read_settings", lambda told: {})
    assert install.main("nothing.txt") == 0
