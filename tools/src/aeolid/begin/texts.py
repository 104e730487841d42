"""Write roles.toml and case.toml as a user goes on with them: every guess beside its reason, the rest as comments."""

from __future__ import annotations

import json
from collections.abc import Sequence

from aeolid.begin.context import Fact
from aeolid.begin.guess import Guess, Guesses
from aeolid.begin.survey import Survey
from aeolid.display import visible
from aeolid.formats.meanings import KINDS

_MOST_LISTED = 60  # headings that are not used, in a comment
_MOST_IGNORED = 30  # entries of the role ignore, where nothing was recognised


def text(value: str) -> str:
    r"""Return a text as TOML writes it.

    >>> print(text('a "b"'))
    "a \"b\""
    """
    return json.dumps(value, ensure_ascii=True).replace("\x7f", "\\u007f")


def _comment(words: str) -> str:
    return visible(" ".join(words.split()))[:200]


def roles_text(found: Survey, guesses: Guesses) -> str:
    """Return the text of a roles file."""
    lines = [
        f"# What the channels of {_comment(found.path.name)} are, as aeolid init guessed it: read it, correct it.",
        "# Roles: input (acts on the plant), output, disturbance (measured, nothing feeds it back), scheduling (the",
        "# operating point: wind), azimuth (rotor angle), excitation (the test signal that was added), ignore.",
        "[recording]",
    ]
    lines += [f"# {_comment(note)}" for note in found.notes]
    if found.time is not None:
        lines.append(f"time = {text(found.time)}")
    if found.time_unit is not None:
        lines.append(f"time_unit = {text(found.time_unit)}")
    if found.sample_time_s is not None:
        lines.append(f"sample_time_s = {found.sample_time_s}")
    if found.resample is not None:
        lines.append(f'resample = "{found.resample}"  # or a sample time in seconds')
    for g in guesses.used:
        lines += ["", *_entry(g)]
    if not guesses.used:
        lines += _unknown(found)
    return "\n".join(lines + _left(found, guesses)) + "\n"


def _entry(g: Guess) -> list[str]:
    what = KINDS[g.meaning.kind][2] + (", demanded" if g.meaning.demand else "")
    column = [f"column = {text(g.heading)}"] if g.heading != g.name else []
    unit = f"unit = {text(g.unit)}" + (f"  # guessed {_comment(g.why)}: check it" if g.why else "")
    return [f"[[channel]]  # {what}", f"name = {text(g.name)}", *column, unit, f"role = {text(g.role)}"]


def _unknown(found: Survey) -> list[str]:
    """Return entries of what was not recognised, for the user to give roles to."""
    lines = ["", "# No heading was recognised: give each channel that matters its role and unit."]
    for heading in found.others[:_MOST_IGNORED]:
        lines += [
            "",
            "[[channel]]",
            f"name = {text(heading)}",
            f"unit = {text(found.unit(heading))}",
            'role = "ignore"',
        ]
    return lines


def _left(found: Survey, guesses: Guesses) -> list[str]:
    rows = [f"#   {_comment(heading)}: {_comment(why)}" for heading, why in guesses.left]
    if guesses.used:
        rows += [f"#   {_comment(heading)}" for heading in found.others]
    if not rows:
        return []
    more = [f"#   and {len(rows) - _MOST_LISTED} more"] if len(rows) > _MOST_LISTED else []
    return ["", "# In the file and not used; an entry like those above takes one in:", *rows[:_MOST_LISTED], *more]


def case_text(
    title: str, recording: str, baseline: tuple[str, str] | None, own: str | None, facts: Sequence[Fact]
) -> str:
    """Return the text of a case: baseline is its kind and file, own the roles file of a run."""
    lines = [
        "# A case for aeolid check and aeolid diagnose, as aeolid init guessed it: read it, correct it.",
        "[case]", f"title = {text(title)}", "",
        "[recordings]", f"files = [{text(recording)}]", 'roles = "roles.toml"', "",
        "[baseline]  # what the recording is compared with",
    ]  # fmt: skip
    if baseline is None:
        lines += [
            "# None was given. This one is made by aeolid identify; it should come from another recording, or from",
            "# before a change. Other kinds: run (a simulator's recording), equations (model.toml), fmu.",
        ]
    kind, file = baseline or ("state_space", "model.json")
    lines += [f"kind = {text(kind)}", f"file = {text(file)}"]
    if own is not None:
        lines.append(f"roles = {text(own)}")
    if kind == "run":
        lines.append(
            "same_inputs = false  # true: the simulator was given the recorded inputs and wind, sample by sample"
        )
    lines += ["", "[context]  # facts that make names concrete"]
    lines += [_fact(f) for f in facts]
    return "\n".join(lines) + "\n"


def _fact(f: Fact) -> str:
    value = text(f.value) if isinstance(f.value, str) else f"{f.value}"
    return f"{'' if f.sure else '# '}{f.key} = {value}  # {f.why}"
