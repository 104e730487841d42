"""Decide by numbers that stand here and nowhere else: each once, with its unit, its meaning and where it comes from.

A module reads `in_force().selection.vuong_z` when it decides, never on import, so that a study can have the same
recordings decided by other numbers: `with with_rules(load_rules("mine.toml")): …`. Numerical settings (iterations,
tolerances, grids, ranks, bounds on memory) stay where they are used.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from aeolid.diagnose.rules.baseline import BaselineRules
from aeolid.diagnose.rules.candidates import CandidatesRules
from aeolid.diagnose.rules.conclusion import ConclusionRules
from aeolid.diagnose.rules.data import DataRules
from aeolid.diagnose.rules.declaring import Rule, checked, rules_in
from aeolid.diagnose.rules.evidence import EvidenceRules
from aeolid.diagnose.rules.experiments import ExperimentsRules
from aeolid.diagnose.rules.hypotheses import HypothesesRules
from aeolid.diagnose.rules.localise import LocaliseRules
from aeolid.diagnose.rules.predictor import PredictorRules
from aeolid.diagnose.rules.run_modes import RunModesRules
from aeolid.diagnose.rules.run_prior import RunPriorRules
from aeolid.diagnose.rules.scoring import ScoringRules
from aeolid.diagnose.rules.selection import SelectionRules
from aeolid.diagnose.rules.structure import StructureRules
from aeolid.diagnose.rules.validation import ValidationRules
from aeolid.text_files import check_keys, load_toml


@dataclass(frozen=True)
class DecisionRules:
    """Hold every number that decides, in sections: one a room, and `evidence` for what several rooms share."""

    evidence: EvidenceRules = field(default_factory=EvidenceRules)
    data: DataRules = field(default_factory=DataRules)
    structure: StructureRules = field(default_factory=StructureRules)
    predictor: PredictorRules = field(default_factory=PredictorRules)
    hypotheses: HypothesesRules = field(default_factory=HypothesesRules)
    baseline: BaselineRules = field(default_factory=BaselineRules)
    scoring: ScoringRules = field(default_factory=ScoringRules)
    localise: LocaliseRules = field(default_factory=LocaliseRules)
    candidates: CandidatesRules = field(default_factory=CandidatesRules)
    selection: SelectionRules = field(default_factory=SelectionRules)
    validation: ValidationRules = field(default_factory=ValidationRules)
    experiments: ExperimentsRules = field(default_factory=ExperimentsRules)
    conclusion: ConclusionRules = field(default_factory=ConclusionRules)
    run_prior: RunPriorRules = field(default_factory=RunPriorRules)
    run_modes: RunModesRules = field(default_factory=RunModesRules)


_DEFAULTS = DecisionRules()
_IN_FORCE: ContextVar[DecisionRules] = ContextVar("decision rules", default=_DEFAULTS)


def in_force() -> DecisionRules:
    """Return the rules that hold now: the defaults, unless with_rules says otherwise."""
    return _IN_FORCE.get()


@contextmanager
def with_rules(rules: DecisionRules) -> Iterator[DecisionRules]:
    """Let other rules hold while the block runs, in this thread; another process has to be told."""
    token = _IN_FORCE.set(rules)
    try:
        yield rules
    finally:
        _IN_FORCE.reset(token)


def every_rule(rules: DecisionRules = _DEFAULTS) -> list[Rule]:
    """List all numbers that decide, section by section; of rules that are followed, the rules as they were given."""
    rules = getattr(rules, "plain", rules)
    return [r for f in fields(rules) for r in rules_in(getattr(rules, f.name), f.name)]


def load_rules(path: str | Path) -> DecisionRules:
    """Read rules from a TOML file of sections; what it does not name keeps its default.

    Raises DataError that names the key where it is unknown, no finite number of its type or out of its range.
    """
    return rules_of(load_toml(path), str(path))


def rules_of(tables: Mapping[str, Any], source: str) -> DecisionRules:
    """Return the rules that differ from the defaults in these values by section and name; raises as load_rules."""
    rules = _DEFAULTS
    check_keys(tables, {f.name for f in fields(rules)}, source)
    for section, table in tables.items():
        here = getattr(rules, section)
        known = {f.name: f for f in fields(here)}
        check_keys(table, set(known), f"{source}: [{section}]")
        values = {name: checked(known[name], v, f"{source}: [{section}] {name}") for name, v in table.items()}
        rules = replace(rules, **{section: replace(here, **values)})
    return rules


def differing(rules: DecisionRules) -> dict[str, dict[str, int | float]]:
    """Return what differs from the defaults, by section and name; empty where nothing does. rules_of reads it back."""
    found: dict[str, dict[str, int | float]] = {}
    for own, default in zip(every_rule(rules), every_rule(), strict=True):
        if own.value != default.value:
            section, name = own.name.split(".")
            found.setdefault(section, {})[name] = own.value
    return found
