"""The public interface as such: light to import, typed, documented parameter by parameter."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import aeolid as ae

HEAVY = ("numpy", "scipy", "pandas", "pyarrow", "numba", "llvmlite", "matplotlib", "plotly", "rich", "typer", "asammdf",
         "cantools", "can", "cffi", "tornado", "fmpy", "control", "threadpoolctl", "IPython")  # fmt: skip
PUBLIC = sorted(set(ae.__all__) - {"__version__"})


def test_importing_it_imports_nothing_heavy() -> None:
    """Counted, not timed: what takes the time are the packages behind it."""
    code = f"import sys, aeolid; dir(aeolid); print([m for m in {HEAVY!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    code = f"import sys, aeolid as ae; ae.Record; ae.Table; print([m for m in {HEAVY[2:]!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_names_are_there_and_others_are_not() -> None:
    assert set(PUBLIC) <= set(dir(ae))
    for name in PUBLIC:
        assert callable(getattr(ae, name)), name
    with pytest.raises(AttributeError, match="no attribute 'identfy'"):
        _ = ae.identfy  # type: ignore[attr-defined]


def test_a_package_is_a_function_too() -> None:
    """Whatever of it was imported before, aeolid.identify holds its modules and is called."""
    code = (
        "import aeolid.identify.varx, aeolid.diagnose.data.case, aeolid.fleet.plan, aeolid as ae, inspect\n"
        "assert ae.identify.varx.identify_varx and ae.diagnose.data.case.load_case and ae.fleet.plan.Plan\n"
        "for f in (ae.identify, ae.diagnose, ae.fleet): assert callable(f), f\n"
        "from aeolid import identify, diagnose\n"
        "assert 'past' in inspect.signature(identify).parameters\n"
        "assert 'baseline' in inspect.signature(diagnose).parameters\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_report_leaves_the_style_of_the_caller_alone() -> None:
    code = (
        "import matplotlib\nmatplotlib.rcParams['font.size'] = 17\n"
        "from aeolid.report.charts import sketch\n"
        "with sketch((3, 2)) as drawing: assert matplotlib.rcParams['font.size'] == 9.5\n"
        "assert matplotlib.rcParams['font.size'] == 17 and drawing.svg\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_it_is_typed() -> None:
    assert (Path(ae.__file__).parent / "py.typed").is_file()
    text = Path(ae.__file__).read_text(encoding="utf-8")  # what a type checker sees is what is imported
    stated = re.findall(r"from (aeolid\.[\w.]+) import (\w+) as \2$", text, re.M)
    assert sorted(name for _, name in stated) == PUBLIC
    for place, name in stated:
        found: Any = getattr(ae, name)
        assert getattr(import_module(place), name) is (found.__wrapped__ if inspect.ismodule(found) else found)


def documented() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Yield every public function, and constructors and methods of every public class."""
    for name in PUBLIC:
        found: Any = getattr(ae, name)
        if not inspect.isclass(found):
            yield name, getattr(found, "__wrapped__", found) if inspect.ismodule(found) else found
            continue
        for key, member in vars(found).items():
            if isinstance(member, classmethod | staticmethod):
                member = member.__func__
            own = inspect.isfunction(member) and "<locals>" not in member.__qualname__
            if own and (not key.startswith("_") or key == "__init__") and "__create_fn__" not in member.__qualname__:
                if key == "__init__" and hasattr(found, "__dataclass_fields__"):
                    continue  # its fields are told as attributes
                yield f"{name}.{key}", member


def told(function: Callable[..., Any]) -> list[str]:
    """Return the names in the section Parameters of a docstring, in its order."""
    text = inspect.getdoc(function) or ""
    section = re.search(r"^Parameters\n-+\n(.*?)(?=^\w[\w ]*\n-+\n|\Z)", text, re.S | re.M)
    names = re.findall(r"^([\w*, ]+?) : \S", section[1], re.M) if section else []
    return [name for group in names for name in group.split(", ")]


@pytest.mark.parametrize(("name", "function"), list(documented()), ids=lambda v: v if isinstance(v, str) else "")
def test_every_parameter_is_documented(name: str, function: Callable[..., Any]) -> None:
    """One by one, in the order of the signature, none that is not there; as python-control asks of itself."""
    wanted = [p for p in inspect.signature(function).parameters if p not in ("self", "cls")]
    assert told(function) == wanted
    text = inspect.getdoc(function) or ""
    first = text.split("\n")[0]
    assert first.endswith(".") and len(first) < 120, first
    untyped = [p.name for p in inspect.signature(function).parameters.values()
               if p.annotation is p.empty and p.name not in ("self", "cls")]  # fmt: skip
    assert untyped == [] and "return" in function.__annotations__


def test_the_walk_can_fail() -> None:
    def bad(a: int, b: int) -> None:
        """Do nothing.

        Parameters
        ----------
        b : int
            Second.
        """

    assert told(bad) == ["b"] and len(list(documented())) > 50


def test_attributes_of_classes_are_documented() -> None:
    for name in PUBLIC:
        found: Any = getattr(ae, name)
        fields = getattr(found, "__dataclass_fields__", {}) if inspect.isclass(found) else {}
        text = inspect.getdoc(found) or ""
        for field in fields:
            if not issubclass(found, Exception) and field != "run":
                assert re.search(rf"\b{field}\b", text), (name, field)


def test_settings_are_those_of_the_command() -> None:
    """Python has every setting of `aeolid identify`, by its name, and the command every setting of Python."""
    from dataclasses import fields

    from aeolid.cli.identify import identify as command
    from aeolid.identify.request import Request

    own = set(inspect.signature(ae.identify).parameters) - {"records", "markov", "progress"}
    assert own == {f.name for f in fields(Request)}
    assert own == set(inspect.signature(command).parameters) - {
        "recordings", "roles", "out", "markov", "report", "json_target", "force", "resample",  # which reads them
        "structure",  # Equations.fit
    }  # fmt: skip
    defaults = {f.name: f.default for f in fields(Request)}
    assert all(p.default == defaults[n] for n, p in inspect.signature(ae.identify).parameters.items() if n in own)


def test_one_module_takes_from_the_diagnosis() -> None:
    found = [p.name for p in (Path(ae.__file__).parent / "api").glob("*.py") if "from aeolid.diagnose" in p.read_text()]
    assert found == ["from_diagnose.py"]
