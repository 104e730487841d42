"""Build HTML in which every text is escaped unless it was built here."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from aeolid import __version__, output
from aeolid.display import visible_lines
from aeolid.report.script import MARK, script, script_hash

STYLE = """
:root { --ink: #1b1f24; --soft: #5a6470; --line: #d5dae0; --tint: #f4f6f8; --accent: #0072b2; --paper: #fff;
  --grid: #e3e7eb; --grey: #9aa4b0; --before: #d55e00; --after: #0072b2; color-scheme: light; }
@media screen and (prefers-color-scheme: dark) {
  :root { --ink: #e6e9ed; --soft: #a3adb8; --line: #3a424c; --tint: #20262d; --accent: #56b4e9; --paper: #14181d;
    --grid: #2b323a; --grey: #7d8894; --before: #f08a3c; --after: #56b4e9; color-scheme: dark; }
}
* { box-sizing: border-box; }
body { font: 16px/1.5 "Segoe UI", "Helvetica Neue", "DejaVu Sans", Arial, sans-serif; color: var(--ink);
  background: var(--paper); margin: 0 auto; padding: 1.5rem 1.5rem 4rem; max-width: 72rem; overflow-wrap: break-word; }
h1 { font-size: 1.5rem; line-height: 1.25; margin: 0 0 .3rem; }
h2 { font-size: 1.2rem; margin: 2.4rem 0 .5rem; padding-top: .7rem; border-top: 1px solid var(--line); }
h3 { font-size: 1rem; margin: 1.2rem 0 .3rem; }
p { margin: .4rem 0 .7rem; max-width: 62rem; overflow-wrap: anywhere; }
a { color: var(--accent); }
.soft, figcaption, .unit { color: var(--soft); }
.warn { border-left: .3rem solid #e69f00; padding-left: .8rem; }
figcaption { font-size: .875rem; max-width: 60rem; }
figure { margin: .6rem 0 1.2rem; break-inside: avoid; }
figure svg { width: 100%; height: auto; display: block; }
.zoom { display: block; text-align: right; font-size: .8rem; color: var(--soft); cursor: pointer; }
figure:has(> .zoom input:checked) svg { width: 220%; max-width: none; }
.live { display: none; }
@media screen {
  figure.moves > .live { display: block; } figure.moves > .scroll, figure.moves > .zoom { display: none; }
}
.live svg { min-width: 0; font-size: 12px; touch-action: pan-y; cursor: crosshair; user-select: none; }
.live svg:focus-visible { outline: 2px solid var(--accent); } .live text { fill: var(--soft); }
.live path { fill: none; stroke-width: 1.4; vector-effect: non-scaling-stroke; }
.live .grid { stroke: var(--grid); stroke-width: 1; } .live .cursor { stroke: var(--soft); stroke-width: 1; }
.live .mark { fill: var(--accent); opacity: .18; } .live path.ink { stroke: var(--ink); stroke-width: 2; opacity: .6; }
.live path.before { stroke: var(--before); stroke-dasharray: 5 3; } .live path.after { stroke: var(--after); }
.bar { display: flex; flex-wrap: wrap; gap: .25rem; align-items: center; font-size: .85rem; }
.bar button { font: inherit; color: var(--ink); background: var(--tint); border: 1px solid var(--line);
  border-radius: .2rem; min-width: 2.2rem; min-height: 2rem; cursor: pointer; }
.key { margin-left: .8rem; } .key::before { content: ""; display: inline-block; width: 1.6rem; margin-right: .35rem;
  vertical-align: middle; border-top: 2px solid var(--ink); }
.key.ink::before { opacity: .6; } .key.before::before { border-top: 2px dashed var(--before); }
.key.after::before { border-color: var(--after); }
.told { display: block; font-size: .85rem; color: var(--soft); font-variant-numeric: tabular-nums; min-height: 1.4em; }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(26rem, 100%), 1fr)); gap: 0 1.5rem; }
.contents { font-size: .9rem; margin: 1rem 0; columns: 17rem; max-width: 62rem; }
.contents ol { margin: 0; padding-left: 1.5rem; } .contents li { break-inside: avoid; }
details { margin: .5rem 0 .9rem; } summary { cursor: pointer; color: var(--accent); }
.verdict { border-left: .45rem solid var(--accent); background: var(--tint); padding: .9rem 1.2rem; margin: 1rem 0; }
.verdict .word { font-size: .8rem; letter-spacing: .06em; text-transform: uppercase; color: var(--soft); }
.verdict .sentence { font-size: 1.3rem; line-height: 1.35; margin: .15rem 0 .4rem; font-weight: 600; }
.verdict.good { border-color: #009e73; } .verdict.open { border-color: #e69f00; }
.verdict.found { border-color: var(--accent); } .verdict ol { margin: .3rem 0 .5rem; padding-left: 1.6rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; margin: .4rem 0 1rem; font-size: .925rem; break-inside: avoid; }
th, td { text-align: left; padding: .28rem .9rem .28rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
th { font-weight: 600; color: var(--soft); border-bottom: 1.5px solid var(--grey); }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
tr.mark td { font-weight: 600; }
code { font: .9em/1.4 "DejaVu Sans Mono", Consolas, monospace; background: var(--tint); padding: .05rem .3rem;
  overflow-wrap: anywhere; }
footer { margin-top: 3rem; font-size: .8rem; color: var(--soft); border-top: 1px solid var(--line);
  padding-top: .6rem; }
@media screen and (max-width: 720px) {
  body { padding: 1rem 1rem 3rem; } .verdict .sentence { font-size: 1.1rem; } td, th { padding-right: .6rem; }
  figure svg { min-width: 21rem; } figure svg.wide { min-width: 44rem; }
}
@page { margin: 16mm 14mm; }
@media print {
  body { font-size: 10.5pt; padding: 0; max-width: none; }
  table { font-size: 8pt; } th { white-space: normal; } th, td { padding-right: .6rem; }
  .scroll { overflow: visible; } .pair { grid-template-columns: 1fr 1fr; } .zoom { display: none; }
  figure:has(> .zoom input:checked) svg { width: 100%; }
  details::details-content { content-visibility: visible; block-size: auto; } summary { list-style: none; }
  h2, h3, p:has(+ .scroll), p:has(+ figure) { break-after: avoid; }
  .verdict { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
}
"""
CONTENTS = "<!--contents-->"  # where write_page lists a page's parts; no text becomes a comment
_LISTED = 4  # parts from which a page has a list of them


# The browser itself holds us to "no network", and to no script but ours where a page has figures for it.
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"


class Html(str):
    """Mark text that is markup already; any other text is escaped where it enters a page."""

    __slots__ = ()


def tag(name: str, *children: object, **attributes: str) -> Html:
    """Build one element; attribute `class_` stands for class."""
    listed = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escape(visible_lines(value))}"' for key, value in attributes.items()
    )
    return Html(f"<{name}{listed}>{join(children)}</{name}>")


def join(children: Iterable[object]) -> Html:
    """Join parts, escaping those that are not markup and leaving out None."""
    return Html("".join(c if isinstance(c, Html) else escape(visible_lines(str(c))) for c in children if c is not None))


def table(headings: Sequence[str], rows: Iterable[Sequence[object]], *, marked: int | None = None) -> Html:
    """Build a table; a heading that starts with '#' marks a column of numbers, `marked` the row to stress."""
    kinds = ["n" if h.startswith("#") else "t" for h in headings]
    head = tag("tr", *(tag("th", h.removeprefix("#"), class_=k) for h, k in zip(headings, kinds, strict=True)))
    body = [
        tag("tr", *(tag("td", cell, class_=k) for cell, k in zip(row, kinds, strict=True)),
            class_="mark" if i == marked else "row")
        for i, row in enumerate(rows)
    ]  # fmt: skip
    return tag("div", tag("table", tag("thead", head), tag("tbody", *body)), class_="scroll") if body else Html("")


def section(title: str, *parts: object, level: str = "h2") -> Html:
    """Build a titled part; nothing at all where every part is empty."""
    content = join(parts)
    return tag("section", tag(level, title), content) if content else Html("")


def figure(drawing: Html, caption: str, **attributes: str) -> Html:
    """Put a drawing and the sentence that says what to see in it together; a wide one can be made larger."""
    zoom = (
        tag("label", Html('<input type="checkbox">'), " larger", class_="zoom") if 'class="wide"' in drawing else None
    )
    return tag("figure", zoom, tag("div", drawing, class_="scroll"), tag("figcaption", caption), **attributes)


def folded(summary: str, *parts: object) -> Html:
    """Put parts behind a line that opens them; printed they are open. Nothing at all where every part is empty."""
    content = join(parts)
    return tag("details", tag("summary", summary), content) if content else Html("")


def _with_contents(body: Html) -> Html:
    """Number the parts of a page, and list them where the page says so or below its title; few are not listed."""
    titles: list[str] = []

    def numbered(found: re.Match[str]) -> str:
        titles.append(found[1])
        return f'<h2 id="part{len(titles)}">{found[1]}</h2>'

    text = re.sub("<h2>(.*?)</h2>", numbered, body)
    links = (tag("li", tag("a", Html(title), href=f"#part{i}")) for i, title in enumerate(titles, 1))
    listed = tag("nav", tag("ol", *links), class_="contents") if len(titles) >= _LISTED else Html("")
    if CONTENTS in text:
        return Html(text.replace(CONTENTS, listed, 1).replace(CONTENTS, ""))
    return Html(text.replace("</h1>", f"</h1>{listed}", 1))


def write_page(path: str | Path, title: str, *parts: object) -> None:
    """Write one self-contained page; raises UsageError where the file cannot be written."""
    body = join(parts)
    moves = MARK in body
    allowed = f"; script-src '{script_hash()}'" if moves else ""
    head = tag(
        "head",
        Html('<meta charset="utf-8">'),
        Html(f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}{allowed}">'),
        Html('<meta name="viewport" content="width=device-width, initial-scale=1">'),
        tag("title", title), tag("style", Html(STYLE)),
    )  # fmt: skip
    footer = tag("footer", f"aeolid {__version__}. This page holds everything it shows; it needs no network.")
    last = Html(f"<script>{script()}</script>") if moves else None
    page = Html("<!doctype html>\n") + tag("html", head, tag("body", _with_contents(body), footer, last), lang="en")
    output.write_text(path, page + "\n")


def notes_part(notes: list[str]) -> Html | None:
    """Build the section of what is to be noted, None where there is nothing."""
    return section("To be noted", tag("ul", *(tag("li", note) for note in notes))) if notes else None
