"""The documentation builds without a warning, its links lead somewhere, and it leaves nothing out."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from aeolid.cli import reference
from aeolid.diagnose.hypotheses.catalogue import ENTRIES

pytestmark = pytest.mark.slow  # its fixtures are

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS / "_ext"))
equations = importlib.import_module("equations")


class Page(HTMLParser):
    """Collect what a page links to, what it loads and where it can be linked."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.anchors: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.anchors |= {given[key] for key in ("id", "name") if key in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        elif tag == "link" and given.get("rel") in ("stylesheet", "icon", "preload"):
            self.loads.append(given["href"])
        elif tag in ("script", "img", "iframe") and "src" in given:
            self.loads.append(given["src"])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the site as tools/docs does, into a folder of the test."""
    text = (ROOT / "tools/docs").read_text(encoding="utf-8")
    (flags,) = re.findall(r"-m sphinx (.*?) -b html", text)
    assert {"-W", "-n"} <= set(flags.split()), "warnings and dangling references are errors"
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", *flags.split(), "-b", "html", "-d", str(out / "trees"), str(DOCS)]
    done = subprocess.run([*command, str(out / "html")], capture_output=True, text=True, timeout=3600, check=False)
    assert done.returncode == 0, done.stderr[-4000:]
    return out / "html"


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    return {path: Page(path) for path in site.rglob("*.html")}


def dead(pages: dict[Path, Page]) -> list[str]:
    """List links to files or anchors that are not there."""
    found = []
    for path, page in pages.items():
        for link in page.links + page.loads:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path.resolve()
            missing = not target.is_file()
            if not missing and parts.fragment and target in pages:
                missing = unquote(parts.fragment) not in pages[target].anchors
            if missing:
                found.append(f"{path.name}: {link}")
    return found


def test_no_link_is_dead(pages: dict[Path, Page]) -> None:
    assert len(pages) > 20 and sum(len(page.links) for page in pages.values()) > 1000
    assert dead(pages) == []


def test_dead_links_are_found(tmp_path: Path) -> None:
    page = tmp_path.resolve() / "page.html"
    page.write_text('<p id="here"><a href="#here">a</a><a href="#there">b</a><a href="no.html">c</a><img src="x.png">')
    assert dead({page: Page(page)}) == ["page.html: #there", "page.html: no.html", "page.html: x.png"]


def test_pages_load_nothing_from_elsewhere(pages: dict[Path, Page]) -> None:
    """The site is read from a disk, too."""
    for path, page in pages.items():
        assert [link for link in page.loads if urlsplit(link).netloc] == [], path


def test_every_function_of_the_library_is_there(pages: dict[Path, Page], site: Path) -> None:
    for header in sorted((ROOT / "include/aeolid").glob("*.h")):
        declared = set(re.findall(r"^[a-z][\w *]*?\b(aeo_\w+)\(", header.read_text(), re.M))
        anchors = pages[site / "reference/c" / f"{header.stem}.html"].anchors
        assert {f"c.{name}" for name in declared} <= anchors, header.name


def test_every_command_and_effect_is_there(pages: dict[Path, Page], site: Path) -> None:
    commands = pages[site / "reference/cli.html"].anchors
    for command in reference.commands():
        assert f"aeolid-{command.name}" in commands
        for parameter in command.parameters:
            for name in parameter.names:
                assert f"cmdoption-aeolid-{command.name}-{name.split('/')[0].lstrip('-')}" in commands, name
    assert {f"effect-{e.id.replace('_', '-')}" for e in ENTRIES} <= pages[site / "reference/catalogue.html"].anchors


def test_the_map_of_the_papers_names_code_that_exists() -> None:
    places = [p for paper in equations.papers() for e in paper["equation"] for p in e["places"]]
    assert len(places) > 60
    assert [fault for place in places if (fault := equations.fault(place)) is not None] == []


def test_the_map_would_notice_a_name_that_went() -> None:
    for place in ("aeolid.identify.markov.estimate", "aeolid.no.such", "src/rls.c:aeo_rls_downdate", "src/no.c:f"):
        assert equations.fault(place) is not None, place


def test_equations_that_docstrings_cite_are_on_the_map() -> None:
    """Where a module cites an equation of a paper by number, the map has that number."""
    listed = {paper["number"]: " ".join(e["at"] for e in paper["equation"]) for paper in equations.papers()}
    cited = re.compile(r"paper (00[0-3]) eq\. \((\d+)\)")
    found = 0
    for path in sorted((ROOT / "tools/src/aeolid").rglob("*.py")):
        for number, equation in cited.findall(path.read_text(encoding="utf-8")):
            found += 1
            known = {int(n) for n in re.findall(r"\((\d+)", listed[number])}
            ranges = re.findall(r"\((\d+)\) … \((\d+)", listed[number])
            known |= {n for low, high in ranges for n in range(int(low), int(high) + 1)}
            assert int(equation) in known, f"{path.name}: paper {number} eq. ({equation})"
    assert found > 10
