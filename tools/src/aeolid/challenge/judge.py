"""Hold one answer against the truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from aeolid.challenge.families import QUIET, family_of

Facts = dict[str, Any]
Z90 = 1.6449  # of a 90 % interval
CONFIDENT = ("named", "multiple", "parameter", "data_fault")


@dataclass(frozen=True)
class Judged:
    """Hold what became of one case.

    truth: accepted ids of every hidden effect; said: ids in the order of the answer; offered: the whole set that the
    answer leaves open; errors: relative error of each compared parameter, and whether its 90 % interval holds the
    truth.
    """

    case: str
    sort: str
    plant: str
    baseline: str
    what: tuple[str, ...]
    truth: tuple[tuple[str, ...], ...]
    decidable: bool
    nats: float | None
    outcome: str
    verdict: str
    said: tuple[str, ...]
    offered: tuple[str, ...]
    errors: tuple[tuple[float, bool | None], ...]
    recovered: float | None
    seconds: float
    statement: str

    @property
    def hidden(self) -> bool:
        """Tell whether the case conceals an effect or fault that the catalogue knows."""
        return self.sort in ("single", "double", "fault")

    @property
    def detected(self) -> bool:
        """Tell whether the answer claims any mismatch."""
        return self.outcome == "done" and self.verdict not in QUIET

    @property
    def first(self) -> str:
        """Return the first name, or the verdict where none is given."""
        return self.said[0] if self.said else self.verdict

    @property
    def all_accepted(self) -> tuple[str, ...]:
        """Return every id that is right for some hidden effect."""
        return tuple(i for ids in self.truth for i in ids)

    @property
    def right(self) -> bool:
        """Tell whether the first name is right."""
        return self.first in self.all_accepted

    @property
    def right_family(self) -> bool:
        """Tell whether the first name is of the family of a hidden effect."""
        return self.right or family_of(self.first) in {family_of(i) for i in self.all_accepted}

    @property
    def in_set(self) -> bool:
        """Tell whether the set that the answer leaves open holds a right name."""
        return bool(set(self.offered) & set(self.all_accepted))

    @property
    def every_in_set(self) -> bool:
        """Tell whether every hidden effect has a right name in the set."""
        return all(set(self.offered) & set(ids) for ids in self.truth)

    @property
    def false_name(self) -> bool:
        """Tell whether a name was given where nothing is hidden; a wrong declared value may be called one."""
        allowed = {"parameter_error"} if self.sort == "parameter" else set()
        return self.outcome == "done" and (bool(set(self.said) - allowed) or self._false_verdict)

    @property
    def _false_verdict(self) -> bool:
        return self.verdict == "data_fault" or (self.verdict == "parameter" and self.sort != "parameter")

    @property
    def wrong_but_confident(self) -> bool:
        """Tell whether one answer was given as the answer, and it is not so."""
        if self.outcome != "done" or self.verdict not in CONFIDENT:
            return False
        if self.sort == "parameter":
            return self.false_name
        return not self.right


def judge(name: str, answer: Facts, result: Facts) -> Judged:
    """Compare a result with the sealed answer."""
    found = result["diagnosis"] or {}
    effects = found.get("effects", [])
    said = tuple(e["id"] for e in effects)
    offered = [*said, *(r["id"] for e in effects for r in e["rivals"])] if found.get("verdict") == "ambiguous" else said
    verdict = str(found.get("verdict", result["outcome"]))
    if verdict == "data_fault" and not said:
        offered = ("data_fault",)
    truth = tuple(tuple(e["accepted"]) for e in answer["effects"] if e["accepted"])
    return Judged(
        name, answer["class"], answer["plant"], answer["baseline"], tuple(e["what"] for e in answer["effects"]), truth,
        answer["decidable"], answer["nats"], result["outcome"], verdict, said, tuple(dict.fromkeys(offered)),
        tuple(_errors(answer, effects)), _recovered(found), result["seconds"],
        str(found.get("statement", result["reason"])),
    )  # fmt: skip


def _errors(answer: Facts, effects: list[Facts]) -> list[tuple[float, bool | None]]:
    """Return relative error and coverage of every parameter that truth and answer share."""
    found: list[tuple[float, bool | None]] = []
    for hidden in answer["effects"]:
        quantity = hidden["quantity"]
        match = next((e for e in effects if e["id"] in hidden["accepted"]), None)
        if quantity is None or match is None or quantity["label"] not in match["parameters"]:
            continue
        told, true = match["parameters"][quantity["label"]], quantity["value"]
        if not isinstance(told["value"], int | float) or not true:
            continue
        away = abs(told["value"] - true)
        given = quantity.get("tolerance", 0.0) * abs(true)  # of a machine and a chain that are not quite as declared
        inside = None if told["std"] is None else bool(away <= Z90 * told["std"] + given)
        found.append((away / abs(true), inside))
    return found


def _recovered(found: Facts) -> float | None:
    value = found.get("sealed", {}).get("recovered_fraction")
    return float(value) if isinstance(value, int | float) else None
