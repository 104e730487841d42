"""Read and write equations as model.toml: every fault names the file, the line and the key."""

from __future__ import annotations

import ast
import json
import keyword
import math
import unicodedata
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from aeolid.errors import DataError
from aeolid.file_kinds import check_tables
from aeolid.models import expressions as ex
from aeolid.models.equations import STEP, Auxiliary, Equations, InputFilter, Memory, Output, Parameter, State
from aeolid.models.equations_names import require_divisible
from aeolid.models.equations_size import require_few, require_small
from aeolid.models.input_filters import KINDS
from aeolid.models.model_file import Signal
from aeolid.record import check_keys
from aeolid.text_files import MOST_LETTERS, is_number, is_short, parse_toml, read_text, shown
from aeolid.wording import did_you_mean

_LISTS = ("state", "output", "input", "input_filter", "auxiliary", "memory")


def load(path: str | Path) -> Equations:
    """Read model.toml; raises DataError that names file, line and key."""
    text = read_text(path)
    return from_toml(parse_toml(text, str(path)), text, str(path))


def from_toml(data: dict[str, Any], text: str, source: str) -> Equations:
    """Build the model from parsed TOML; `text` serves to name the line of a bad expression."""
    check_tables(data, "equations", source)
    head = data.get("model", {})
    check_keys(head, {"name", "time", "sample_time_s"}, f"{source} [model]")
    name = head.get("name", Path(source).stem)
    if not isinstance(name, str):
        raise DataError(f"{source} [model]: name = {shown(name)} is not a text")
    sample_time = _time_base(head, source)
    parameters = _parameters(data.get("parameters", {}), source)
    tables = {key: [_as_in_formulas(key, entry) for entry in _tables(data, key, source)] for key in _LISTS}
    key = "next" if sample_time else "derivative"
    states = tuple(_state(s, i, text, source, key) for i, s in enumerate(tables["state"]))
    outputs = tuple(_output(o, i, text, source) for i, o in enumerate(tables["output"]))
    if not outputs:
        raise DataError(f"{source}: no [[output]] entry")
    auxiliaries = tuple(_auxiliary(a, i, text, source) for i, a in enumerate(tables["auxiliary"]))
    memories = tuple(_memory(m, i, text, source) for i, m in enumerate(tables["memory"]))
    model = Equations(
        name, sample_time, parameters, states, outputs, (), (),
        tuple(_filter(f, i, source) for i, f in enumerate(tables["input_filter"])), auxiliaries, memories,
    )  # fmt: skip
    model = _with_inputs(model, [_input(entry, i, source) for i, entry in enumerate(tables["input"])], source)
    require_small(model, source)
    _check_filters(model, source)
    _check_order(model, source)
    _check_memories(model, source)
    require_divisible(model, source)
    return model


def _with_inputs(model: Equations, declared: Sequence[tuple[str, Signal]], source: str) -> Equations:
    """Return the model with its inputs: those declared, then every name in a formula that nothing defines."""
    symbols, signals = [symbol for symbol, _ in declared], [signal for _, signal in declared]
    own = [n.name for group in (model.parameters, model.states, model.memories, model.auxiliaries) for n in group]
    for names in (own + symbols, [s.name for s in signals], [o.name for o in model.outputs]):
        double = sorted(n for n, count in Counter(names).items() if count > 1)
        if double:
            raise DataError(f"{source}: {shown(double[0])} is defined twice")
    known = {*own, *symbols}
    memories = [tree for m in model.memories for tree in (m.next, m.settled)]
    formulas = [[a.equation for a in model.auxiliaries], [s.derivative for s in model.states],
                [o.equation for o in model.outputs], memories]  # fmt: skip
    for tree in (tree for group in formulas for tree in group):
        found = sorted(ex.names_in(tree) - known - ({STEP} if any(tree is one for one in memories) else set()))
        if STEP in found:
            raise DataError(f"{source}: {STEP} is known in [[memory]] alone, which is renewed once a sample")
        own_output = next((name for name in found if name in {o.name for o in model.outputs}), None)
        if own_output is not None:
            raise DataError(
                f"{source}: {own_output!r} is an output; as an input it would be fed with what was recorded of it."
                " Write its equation there, or what it is computed from as an [[auxiliary]]"
            )
        known.update(found)
        symbols += found
        signals += map(Signal, found)
    return replace(model, inputs=tuple(signals), symbols=tuple(symbols))


def _as_in_formulas(kind: str, entry: Any) -> Any:
    """Return a table with its names as Python reads them in a formula: there the micro sign is the Greek letter.

    Names of channels stay as they are: of inputs it is the symbol that formulas hold.
    """
    if not isinstance(entry, dict) or kind == "output":
        return entry
    if kind == "input" and "name" in entry:
        entry = {"symbol": entry["name"]} | entry
    keys: tuple[str, ...] = ("symbol" if kind == "input" else "name",)
    if kind == "input_filter":
        keys = tuple(KINDS[entry["kind"]].slots) if _is_kind(entry.get("kind")) else ()
    return entry | {k: _normal(entry[k]) for k in keys if k in entry}


def _normal(name: Any) -> Any:
    return unicodedata.normalize("NFKC", name) if isinstance(name, str) else name


def _tables(data: dict[str, Any], key: str, source: str) -> list[Any]:
    entries = data.get(key, [])
    if not isinstance(entries, list):
        raise DataError(f"{source}: {key} is a list of tables, each headed [[{key}]]")
    require_few(len(entries), f"[[{key}]] tables", source)
    return entries


def _parameters(table: Any, source: str) -> tuple[Parameter, ...]:
    if not isinstance(table, dict):
        raise DataError(f"{source}: parameters = {shown(table)} is not a table, headed [parameters]")
    require_few(len(table), "parameters", source)
    return tuple(_parameter(_normal(name), entry, source) for name, entry in table.items())


def _unit(entry: Any, where: str) -> str:
    if not is_short(unit := entry.get("unit", "")):
        raise DataError(f"{where}: unit = {shown(unit)} is not a text of at most {MOST_LETTERS} characters")
    return unit


def _time_base(head: dict[str, Any], source: str) -> float:
    base = head.get("time", "continuous")
    if base == "continuous":
        return 0.0
    if base != "discrete":
        raise DataError(f"{source} [model]: time = {shown(base)}; 'continuous' or 'discrete' is needed")
    step = head.get("sample_time_s")
    if not is_number(step) or not 0 < step < 1e6:
        raise DataError(f"{source} [model]: time = 'discrete' needs sample_time_s above 0, found {shown(step)}")
    return float(step)


def _number(value: Any, where: str) -> float:
    if not is_number(value):
        raise DataError(f"{where}: {shown(value)} is not a finite number")
    return float(value)


def _parameter(name: str, entry: Any, source: str) -> Parameter:
    where = f"{source} [parameters] {name}"
    _check_name(name, where)
    entry = entry if isinstance(entry, dict) else {"value": entry}
    check_keys(entry, {"value", "min", "max", "unit", "free", "prior_std"}, where)
    if "value" not in entry:
        raise DataError(f"{where}: value is missing")
    value = _number(entry["value"], where)
    low = _number(entry["min"], f"{where} min") if "min" in entry else -math.inf
    high = _number(entry["max"], f"{where} max") if "max" in entry else math.inf
    if not low <= value <= high:
        raise DataError(f"{where}: value {value:g} lies outside min {low:g} … max {high:g}")
    prior = _number(entry["prior_std"], f"{where} prior_std") if "prior_std" in entry else None
    if prior is not None and prior <= 0:
        raise DataError(f"{where}: prior_std = {prior:g} must be above 0")
    if not isinstance(entry.get("free", False), bool):
        raise DataError(f"{where}: free is true or false")
    return Parameter(name, value, _unit(entry, where), low, high, entry.get("free", False), prior)


def _state(entry: Any, index: int, text: str, source: str, key: str) -> State:
    where = f"{source} [[state]] {index + 1}"
    check_keys(entry, {"name", "derivative", "next", "initial", "unit"}, where)
    name = entry.get("name")
    _check_name(name, where)
    other = "derivative" if key == "next" else "next"
    if other in entry:
        raise DataError(f"{where} {name}: {other} does not go with the model's time base; {key} is needed")
    formula = entry.get(key)
    if formula is None:
        raise DataError(f"{where} {name}: {key} is missing")
    tree = _tree(formula, text, f"{where} {name}", source)
    initial = entry.get("initial", 0.0)
    initial = initial if isinstance(initial, dict) else {"value": initial}
    check_keys(initial, {"value", "free"}, f"{where} {name} initial")
    value = _number(initial.get("value", 0.0), f"{where} {name} initial")
    if not isinstance(initial.get("free", False), bool):
        raise DataError(f"{where} {name} initial: free is true or false")
    return State(name, _unit(entry, where), tree, value, initial.get("free", False))


def _auxiliary(entry: Any, index: int, text: str, source: str) -> Auxiliary:
    where = f"{source} [[auxiliary]] {index + 1}"
    check_keys(entry, {"name", "equation"}, where)
    _check_name(entry.get("name"), where)
    if "equation" not in entry:
        raise DataError(f"{where} {entry['name']}: equation is missing")
    return Auxiliary(entry["name"], _tree(entry["equation"], text, where, source))


def _memory(entry: Any, index: int, text: str, source: str) -> Memory:
    where = f"{source} [[memory]] {index + 1}"
    check_keys(entry, {"name", "next", "settled", "unit"}, where)
    _check_name(entry.get("name"), where)
    for key in ("next", "settled"):
        if key not in entry:
            raise DataError(f"{where} {entry['name']}: {key} is missing")
    trees = [_tree(entry[key], text, where, source) for key in ("next", "settled")]
    return Memory(entry["name"], _unit(entry, where), *trees)


def _check_order(model: Equations, source: str) -> None:
    later = {a.name for a in model.auxiliaries}
    for a in model.auxiliaries:
        late = sorted(ex.names_in(a.equation) & later)
        later.discard(a.name)
        if late:
            raise DataError(f"{source} [[auxiliary]] {a.name}: uses {late[0]!r}, which must stand before it")


def _check_memories(model: Equations, source: str) -> None:
    """Refuse a memory that settles on one that has not settled yet: all settle in their order, then are renewed."""
    needs = {a.name: ex.names_in(a.equation) for a in model.auxiliaries}
    for name, used in needs.items():
        needs[name] = used.union(*(needs[n] for n in used if n in needs and n != name))
    names = [m.name for m in model.memories]
    for i, m in enumerate(model.memories):
        used = ex.names_in(m.settled)
        used = used.union(*(needs[n] for n in used if n in needs))
        early = [n for n in names[i:] if n in used]
        if early:
            which = "itself" if early[0] == m.name else f"{early[0]!r}, which must stand before it"
            raise DataError(f"{source} [[memory]] {m.name}: settled uses {which}")


def _output(entry: Any, index: int, text: str, source: str) -> Output:
    where = f"{source} [[output]] {index + 1}"
    check_keys(entry, {"name", "equation", "unit"}, where)
    if not is_short(entry.get("name")) or "equation" not in entry:
        raise DataError(f"{where}: name and equation are needed")
    tree = _tree(entry["equation"], text, f"{where} {entry['name']}", source)
    return Output(entry["name"], _unit(entry, where), tree)


def _input(entry: Any, index: int, source: str) -> tuple[str, Signal]:
    where = f"{source} [[input]] {index + 1}"
    check_keys(entry, {"name", "symbol", "unit"}, where)
    if not is_short(entry.get("name")):
        raise DataError(f"{where}: name is missing, or no text of at most {MOST_LETTERS} characters")
    symbol = entry.get("symbol", entry["name"])
    _check_name(symbol, where)
    return symbol, Signal(entry["name"], _unit(entry, where))


def _filter(entry: Any, index: int, source: str) -> InputFilter:
    where = f"{source} [[input_filter]] {index + 1}"
    if not isinstance(entry, dict) or not _is_kind(entry.get("kind")):
        raise DataError(f"{where}: kind is none of {', '.join(KINDS)}")
    slots = KINDS[entry["kind"]].slots
    check_keys(entry, {"input", "kind", *slots}, where)
    missing = [k for k in ("input", *slots) if not isinstance(entry.get(k), str)]
    if missing:
        raise DataError(f"{where}: {missing[0]} is missing (the name of a parameter or channel)")
    return InputFilter(entry["input"], entry["kind"], tuple(entry[s] for s in slots))


def _is_kind(kind: Any) -> bool:
    return isinstance(kind, str) and kind in KINDS


def _check_filters(model: Equations, source: str) -> None:
    known = {p.name for p in model.parameters}
    for f in model.filters:
        if f.channel not in {s.name for s in model.inputs}:
            raise DataError(f"{source} [[input_filter]]: {shown(f.channel)} is no input of the equations")
        for name in f.parameters:
            if name not in known:
                hint = did_you_mean(name, sorted(known))
                raise DataError(f"{source} [[input_filter]]: {shown(name)} is no parameter{hint}")
        fault = KINDS[f.kind].fault([model.parameters[model.index(name)].value for name in f.parameters])
        if fault is not None:
            raise DataError(f"{source} [[input_filter]] {f.kind} of {shown(f.channel)}: {fault}")


def _check_name(name: Any, where: str) -> None:
    reserved = not isinstance(name, str) or name in ex.FUNCTIONS or name in ex.CONSTANTS or name == STEP
    if reserved or not is_short(name) or not name.isidentifier() or keyword.iskeyword(name):
        raise DataError(
            f"{where}: {shown(name)} cannot be a name here (letters, digits, _; no function, no Python keyword)"
        )


def _tree(formula: Any, text: str, where: str, source: str) -> ast.expr:
    """Parse a formula; a bad one is named by its line, which is looked for only then."""
    try:
        return ex.parse(formula, where)
    except DataError:
        return ex.parse(formula, _line(formula, text, where, source))


def _line(formula: Any, text: str, where: str, source: str) -> str:
    for number, line in enumerate(text.splitlines(), 1):
        if isinstance(formula, str) and formula and formula in line:
            return f"{source} line {number}"
    return where


def to_toml(model: Equations) -> str:
    """Return the text of model.toml."""
    quote = json.dumps
    lines = ["[model]", f"name = {quote(model.name)}"]
    if model.sample_time_s:
        lines += ['time = "discrete"', f"sample_time_s = {model.sample_time_s!r}"]
    else:
        lines.append('time = "continuous"')
    lines.append("[parameters]")
    for p in model.parameters:
        fields = [f"value = {p.value!r}"]
        fields += [f"min = {p.minimum!r}"] if math.isfinite(p.minimum) else []
        fields += [f"max = {p.maximum!r}"] if math.isfinite(p.maximum) else []
        fields += [f"unit = {quote(p.unit)}"] if p.unit else []
        fields += [f"free = {str(p.free).lower()}"]
        fields += [f"prior_std = {p.prior_std!r}"] if p.prior_std else []
        lines.append(f"{p.name} = {{ {', '.join(fields)} }}")
    for symbol, signal in zip(model.symbols, model.inputs, strict=True):
        lines += ["[[input]]", f"name = {quote(signal.name)}", f"symbol = {quote(symbol)}"]
        lines += [f"unit = {quote(signal.unit)}"] if signal.unit else []
    for a in model.auxiliaries:
        lines += ["[[auxiliary]]", f"name = {quote(a.name)}", f"equation = {quote(ex.to_text(a.equation))}"]
    for m in model.memories:
        lines += ["[[memory]]", f"name = {quote(m.name)}", f"next = {quote(ex.to_text(m.next))}"]
        lines += [f"settled = {quote(ex.to_text(m.settled))}"]
        lines += [f"unit = {quote(m.unit)}"] if m.unit else []
    for s in model.states:
        key = "next" if model.sample_time_s else "derivative"
        lines += ["[[state]]", f"name = {quote(s.name)}", f"{key} = {quote(ex.to_text(s.derivative))}"]
        lines.append(f"initial = {{ value = {s.initial!r}, free = {str(s.initial_free).lower()} }}")
        lines += [f"unit = {quote(s.unit)}"] if s.unit else []
    for o in model.outputs:
        lines += ["[[output]]", f"name = {quote(o.name)}", f"equation = {quote(ex.to_text(o.equation))}"]
        lines += [f"unit = {quote(o.unit)}"] if o.unit else []
    for f in model.filters:
        lines += ["[[input_filter]]", f"input = {quote(f.channel)}", f"kind = {quote(f.kind)}"]
        lines += [f"{slot} = {quote(p)}" for slot, p in zip(KINDS[f.kind].slots, f.parameters, strict=True)]
    return "\n".join(lines) + "\n"
