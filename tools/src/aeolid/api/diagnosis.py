"""Hold diagnoses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aeolid.api import markup
from aeolid.api.session import public
from aeolid.api.table import Table
from aeolid.errors import NotIdentifiable
from aeolid.wording import plus_minus, spoken

if TYPE_CHECKING:
    import pandas as pd

    from aeolid.api.equations import Equations

_MODEL = "model/model.toml"


@dataclass(frozen=True)
class Effect:
    """Hold one effect that a diagnosis names.

    Attributes
    ----------
    id : str
        Its entry in the catalogue, `aeolid catalogue`.
    statement : str
        What it is, in a sentence.
    equation : str
        What it adds to the model.
    parameters : mapping
        Name to value, standard deviation and unit.
    location : mapping
        Where it sits: entry, outputs, frequencies, times.
    weight : float
        Share of the evidence among the effects that could explain the recordings, 1 in all.
    rivals : tuple of mapping
        Effects that the data do not tell from it.
    """

    id: str
    statement: str
    equation: str
    parameters: Mapping[str, Mapping[str, Any]]
    location: Mapping[str, Any]
    weight: float
    rivals: tuple[Mapping[str, Any], ...]

    @classmethod
    def of_facts(cls, facts: Mapping[str, Any]) -> Effect:
        """Return an effect of diagnosis.json.

        Parameters
        ----------
        facts : mapping
            An entry of "effects".
        """
        return cls(
            facts["id"], facts["statement"], facts.get("equation") or "", facts["parameters"], facts["location"],
            facts.get("weight", 1.0), tuple(facts.get("rivals") or ()),
        )  # fmt: skip

    def __repr__(self) -> str:
        return f"<Effect: {self.id}, {', '.join(self.told())}>" if self.parameters else f"<Effect: {self.id}>"

    def told(self) -> list[str]:
        """Return each parameter as text, ± one standard deviation."""
        texts = []
        for name, p in self.parameters.items():
            lost = p["value"] is None
            value = "beyond what these data resolve" if lost else plus_minus(p["value"], p["std"])
            texts.append(f"{name} = {value}{'' if p['unit'] in ('', '1') else ' ' + p['unit']}")
        return texts


class Diagnosis:
    """Hold the verdict on a model, what it is drawn from, and the corrected model.

    Attributes
    ----------
    facts : mapping
        The content of diagnosis.json.
    evidence : mapping
        What the report's appendix shows: scores, maps, spectra, series.
    """

    def __init__(self, facts: Mapping[str, Any], evidence: Mapping[str, Any], files: Mapping[str, str]) -> None:
        """Hold a diagnosis.

        Parameters
        ----------
        facts : mapping
            The content of diagnosis.json.
        evidence : mapping
            The content of evidence.json.
        files : mapping of str to str
            Texts that `report` writes, by name within the folder.
        """
        self.facts, self.evidence, self._files = facts, evidence, dict(files)

    @property
    def verdict(self) -> str:
        """Return the verdict: no_mismatch, immaterial, parameter, named, ambiguous, multiple, unnamed and more."""
        return str(self.facts["verdict"])

    @property
    def statement(self) -> str:
        """Return the result in a sentence."""
        return spoken(str(self.facts["statement"]))

    @property
    def effects(self) -> Table[Effect]:
        """Return the effects that are named, the first explains most."""
        return Table("effects", [Effect.of_facts(e) for e in self.facts["effects"]], _effect_row)

    @property
    def scores(self) -> Table[dict[str, Any]]:
        """Return the score of every effect of the catalogue that was tried, highest first."""
        return Table("scores", [dict(row) for row in self.evidence.get("bank") or ()], _plain_row)

    @property
    def candidates(self) -> Table[dict[str, Any]]:
        """Return the effects that were fitted: gain in nats on the data fitted and on the data selected with."""
        return Table("candidates", [dict(row) for row in self.evidence.get("candidates") or ()], _plain_row)

    @property
    def not_excluded(self) -> Table[dict[str, Any]]:
        """Return the effects that may be there below a size, and what that size is."""
        return Table("effects not excluded", self.facts.get("not_excluded") or (), _least_row)

    @property
    def sealed(self) -> Mapping[str, Any]:
        """Return the proof on the sealed data: gain in nats with its 90 % interval, errors before and after."""
        found: Mapping[str, Any] = self.facts["sealed"]
        return found

    @property
    def next_experiment(self) -> str | None:
        """Return what to record next; None where nothing is left to decide."""
        found = self.facts.get("next_experiment")
        return None if not found else str(found["text"])

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return what to beware of: a corrected model that diverges, a time limit that was reached."""
        return tuple(self.facts.get("warnings") or ())

    @property
    def corrected_model(self) -> Equations:
        """Return the model with what was found; raises NotIdentifiable where none was fitted."""
        from aeolid.api.equations import Equations
        from aeolid.models import equations_file
        from aeolid.text_files import parse_toml

        if _MODEL not in self._files:
            raise NotIdentifiable(f"no model was fitted: {self.statement}")
        text = self._files[_MODEL]
        return Equations(equations_file.from_toml(parse_toml(text, _MODEL), text, _MODEL), source="corrected model")

    def to_frame(self) -> pd.DataFrame:
        """Return the effects as a pandas.DataFrame, a row a parameter."""
        import pandas as pd

        rows = [
            {"effect": e.id, "parameter": name, **p, "weight": e.weight}
            for e in self.effects for name, p in e.parameters.items()
        ]  # fmt: skip
        return pd.DataFrame(rows, columns=["effect", "parameter", "value", "std", "unit", "weight"])

    def to_json(self) -> dict[str, Any]:
        """Return the content of diagnosis.json."""
        return dict(self.facts)

    @public
    def save(self, path: str | Path) -> None:
        """Write diagnosis.json.

        Parameters
        ----------
        path : str or pathlib.Path
            The file; another of this name is replaced.
        """
        from aeolid import output

        output.write_json(path, self.to_json())

    @public
    def report(self, folder: str | Path) -> Path:
        """Write report.html, diagnosis.json, evidence.json, the corrected model and the sealed data before and after.

        Parameters
        ----------
        folder : str or pathlib.Path
            Where to; made where it is missing, and files of these names in it are replaced.

        Returns
        -------
        pathlib.Path
            The page.

        Raises
        ------
        UsageError
            Where the folder cannot be written to.
        """
        from aeolid import output
        from aeolid.report.diagnosis import render_diagnosis

        target = Path(folder)
        output.make_folder(target)
        for name, text in self._files.items():
            output.make_folder((target / name).parent)
            output.write_text(target / name, text)
        page = target / "report.html"
        render_diagnosis(dict(self.facts), dict(self.evidence), page)
        return page

    @public
    def plot_before_after(self, axes: Any = None) -> Any:
        """Draw the sealed data, and what the model predicts of them before and after the correction.

        Several sealed stretches follow each other; one whose times the others have, too, is drawn behind them.

        Parameters
        ----------
        axes : array of matplotlib.axes.Axes, optional
            One for each output; default those of a new figure.

        Returns
        -------
        ndarray of matplotlib.axes.Axes, shape (l,)
            One that says why, where nothing was tested on the sealed data.
        """
        from aeolid.api import axes as places

        series = self.evidence.get("series") or {}
        if not series:
            found = places.grid(axes, 1, 1, size=(7.0, 2.0))[:, 0]
            found[0].text(0.5, 0.5, places.label(f"nothing to correct: {self.statement}"), ha="center", wrap=True)
            found[0].set_axis_off()
            return found
        found = places.grid(axes, len(series), 1, size=(7.0, 2.0), sharex=True)[:, 0]
        for place, (name, values) in zip(found, series.items(), strict=True):
            for kind, colour in (("measured", "0.55"), ("before", "C1"), ("after", "C0")):
                time_s, y = _in_turn(values, kind)
                place.plot(time_s, y, linewidth=0.9, label=kind, color=colour)
            place.set_ylabel(places.label(f"{name} ({values.get('unit') or '1'})"))
        found[0].legend(loc="upper right")
        found[0].set_title("sealed data", fontsize="medium")
        found[-1].set_xlabel("time (s)")
        return found

    @public
    def plot_scores(self, axes: Any = None, *, most: int = 20) -> Any:
        """Draw the highest scores of the catalogue and the threshold that chance does not pass.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Where to draw; default a new figure.
        most : int
            How many to draw.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from aeolid.api import axes as places

        rows = [row for row in self.scores if row.get("statistic") is not None][:most]
        if not rows:
            place = places.one(axes, size=(7.0, 1.5))
            place.text(0.5, 0.5, "a simulator's run has no scores; `candidates` has the explanations", ha="center")
            place.set_axis_off()
            return place
        place = places.one(axes, size=(7.0, 0.4 + 0.25 * max(len(rows), 2)))
        height = np.arange(len(rows))
        place.barh(height, [row["statistic"] for row in rows])
        place.set_yticks(height, [places.label(f"{row['id']} {row.get('entry', '')}".strip()) for row in rows])
        place.invert_yaxis()
        threshold = (self.facts.get("false_alarm") or {}).get("threshold")
        if threshold is not None:
            place.axvline(threshold, color="0.4", linestyle="--", label="threshold")
            place.legend(loc="lower right")
        place.set_xlabel("score (statistic)")
        return place

    def __repr__(self) -> str:
        named = ", ".join(dict.fromkeys(e.id for e in self.effects))
        gain = self.sealed["log_likelihood_gain"]
        proof = f", sealed gain {gain:.4g} nats" if gain else ""
        return f"<Diagnosis: {self.verdict}{', ' if named else ''}{named}{proof}>"

    def _repr_html_(self) -> str:
        lines = [self.statement, *(f"WARNING: {text}" for text in self.warnings)]
        lines += [] if self.next_experiment is None else [f"Next: {self.next_experiment}"]
        return markup.shown(repr(self)[1:-1], *([self.effects._repr_html_()] if len(self.effects) else []), lines=lines)


def _in_turn(series: Mapping[str, Any], kind: str) -> tuple[Any, Any]:
    """Return times and values of a line over the sealed stretches, a gap between two of them.

    A stretch that begins before the last one ends, as one of another recording may, is put behind it.
    """
    time_s = np.asarray(series["time_s"], dtype=float)
    values = np.array([np.nan if v is None else v for v in series[kind]], dtype=float)
    first = np.flatnonzero(np.diff(np.asarray(series.get("stretch") or np.ones(len(time_s))))) + 1
    for k in first:
        time_s[k:] += max(0.0, time_s[k - 1] + (time_s[1] - time_s[0]) - time_s[k])
    return np.insert(time_s, first, np.nan), np.insert(values, first, np.nan)


def _effect_row(effect: Effect) -> dict[str, Any]:
    return {
        "effect": effect.id, "entry": effect.location.get("entry"), "parameters": "; ".join(effect.told()),
        "weight": effect.weight, "statement": effect.statement,
    }  # fmt: skip


def _plain_row(row: dict[str, Any]) -> dict[str, Any]:
    """Return the entries of a row that are single values."""
    return {key: value for key, value in row.items() if value is None or isinstance(value, str | int | float)}


def _least_row(row: Mapping[str, Any]) -> dict[str, Any]:
    least = row.get("minimum_detectable") or {}
    return {"effect": row.get("id"), "entry": row.get("entry"), "parameter": least.get("parameter"),
            "smallest_detectable": least.get("value"), "unit": least.get("unit"), "note": row.get("note")}  # fmt: skip
