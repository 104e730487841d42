"""The arithmetic of model files: what is allowed, what is refused, and that machine code means the same."""

from __future__ import annotations

import ast
import math
import warnings
from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aeolid.errors import DataError
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Output, Parameter
from aeolid.models.integrate import compile_equations

VALUES = {"a": 0.7, "b": -1.3, "c": 2.9, "height_1": 0.05}
SCOPE = {
    "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "sin": np.sin, "cos": np.cos, "tan": np.tan, "tanh": np.tanh,
    "abs": abs, "sign": np.sign, "min": min, "max": max, "pi": math.pi,
}  # fmt: skip


def compiled(tree: ast.expr, values: Mapping[str, float]) -> float:
    """Return what the machine code of a model makes of an expression in its parameters."""
    parameters = tuple(Parameter(n, v) for n, v in values.items())
    model = Equations("expression", 0.0, parameters, (), (Output("y", "", tree),), (), ())
    return float(compile_equations(model).read(np.zeros(0), np.zeros(0), model.theta)[0][0])


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2*3", 7.0), ("-2**2", -4.0), ("(-2)**2", 4.0), ("2**3**2", 512.0), ("7/2/2", 1.75), ("+a", 0.7),
        ("--a", 0.7), ("2 - 3 - 4", -5.0), ("sqrt(4)", 2.0), ("exp(0)", 1.0), ("log(exp(2))", 2.0), ("sin(pi/2)", 1.0),
        ("cos(pi)", -1.0), ("tan(0)", 0.0), ("tanh(0)", 0.0), ("abs(b)", 1.3), ("sign(b)", -1.0),
        ("min(a, b, c)", -1.3), ("max(a, b)", 0.7), (" a ", 0.7), ("1e-3", 1e-3), ("height_1*2", 0.1), ("a\n", 0.7),
    ],
)  # fmt: skip
def test_allowed_arithmetic_means_what_it_says(text: str, value: float) -> None:
    tree = ex.parse(text, "line 1")
    assert compiled(tree, VALUES) == pytest.approx(value, rel=1e-15, abs=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        "", " ", "1 +", "a b", "(a", "a)", "a = 1", "a == 1", "a < b", "a and b", "not a", "a if b else c", "a // b",
        "a % b", "a @ b", "~a", "a | b", "a << 2", "[a]", "(a, b)", "{a}", "{1: a}", "a[0]", "a.real", "'text'",
        "f'{a}'", "b'x'", "True", "None", "...", "1j", "2j*a", "lambda: 1", "(lambda x: x)(a)", "[x for x in a]",
        "a := 1", "(a := 1)", "__import__('os')", "().__class__", "a.__class__.__mro__", "eval('1')", "open(a)",
        "sqrt", "sqrt + 1", "sqrt()", "sqrt(a, b)", "sqrt(x=a)", "sqrt(*a)", "min(a)", "min(*a)", "atan(a)", "Sqrt(a)",
        "sqrt(a)(b)", "await a", "yield", "1_000j", "import os", "a; b", "a\nb", "𝚨=1", "\x00",
    ],
)  # fmt: skip
def test_everything_else_is_refused_with_the_line_named(text: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)
        with pytest.raises(DataError, match=r"model\.toml line 7"):
            ex.parse(text, "model.toml line 7")


def test_a_hat_is_explained() -> None:
    with pytest.raises(DataError, match=r"line 3.*\*\*"):
        ex.parse("a ^ 2", "line 3")


@pytest.mark.parametrize("value", [1.0, None, True, ["a"], {"a": 1}])
def test_an_equation_that_is_no_text_is_refused(value: object) -> None:
    with pytest.raises(DataError, match="in quotes"):
        ex.parse(value, "line 3")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "text",
    [
        "(" * 5000 + "a" + ")" * 5000,
        "-" * 5000 + "a",
        "abs(" * 4000 + "a" + ")" * 4000,
        "+".join(["a"] * 5000),
        "a**" * 3000 + "a",
        "a" * 100_000,
        "1" * 5000 + "+a",
        "9" * 400 + "*a",
        "1e999*a",
    ],
    ids=["parentheses", "minuses", "calls", "sum", "powers", "name", "5000 digits", "400 digits", "infinite"],
)
def test_hostile_sizes_end_in_one_sentence(text: str) -> None:
    """Deep or huge text is refused, or compiles to a finite number; never a crash of the parser or a hang."""
    try:
        tree = ex.parse(text, "line 1")
        value = compiled(tree, {"a": 0.5})
    except DataError as error:
        assert str(error).startswith("line 1") and len(str(error)) < 25_000
        return
    assert math.isfinite(value)


def test_a_sum_that_just_fits_is_taken() -> None:
    tree = ex.parse("+".join(["a"] * 100), "line 1")
    assert compiled(tree, {"a": 0.5}) == 50.0


def leaves() -> st.SearchStrategy[str]:
    numbers = st.floats(0, 1e3, allow_nan=False).map(lambda v: repr(round(v, 6))) | st.integers(0, 99).map(str)
    return numbers | st.sampled_from([*VALUES, "pi"])


def grown(children: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return st.one_of(
        st.tuples(children, st.sampled_from("+-*/"), children).map(lambda t: f"({t[0]} {t[1]} {t[2]})"),
        st.tuples(children, st.sampled_from("+-*/"), children).map(lambda t: f"{t[0]} {t[1]} {t[2]}"),
        children.map(lambda t: f"-{t}"),
        st.tuples(st.sampled_from(["sin", "cos", "tanh", "abs", "sign"]), children).map(lambda t: f"{t[0]}({t[1]})"),
        st.tuples(st.sampled_from(["min", "max"]), children, children).map(lambda t: f"{t[0]}({t[1]}, {t[2]})"),
        children.map(lambda t: f"sqrt(abs({t}))"),
        children.map(lambda t: f"exp(tanh({t}))"),
        children.map(lambda t: f"(1 + abs({t}))**0.5"),
    )


expression = st.recursive(leaves(), grown, max_leaves=12)


def evaluate(text: str) -> float:
    try:
        return float(eval(text, dict(SCOPE), dict(VALUES)))
    except ZeroDivisionError:
        return math.nan


@settings(max_examples=150, deadline=None, derandomize=True)
@given(expression)
def test_machine_code_equals_the_text(text: str) -> None:
    """Python's own reading of the same text is the reference; numbers are floats, so equality is to the last bit."""
    with np.errstate(all="ignore"):
        expected = evaluate(text)
        tree = ex.parse(text, "line 1")
        for form in (tree, ex.parse(ex.to_text(tree), "line 1")):
            found = compiled(form, VALUES)
            if math.isfinite(expected):
                assert found == pytest.approx(expected, rel=1e-14, abs=1e-300)
            else:
                assert not math.isfinite(found)


@pytest.mark.parametrize(
    "text", ["2*a**2 - sqrt(c)/b", "max(a, b, 0) + min(c, 1)", "-a + pi", "log(b)", "1/(a - a)", "+3"]
)
def test_arrays_are_read_like_the_machine_code(text: str) -> None:
    tree = ex.parse(text, "line 1")
    found = ex.values_of(tree, {n: np.array([v, 2 * v]) for n, v in VALUES.items()})
    for k in (0, 1):
        value = float(np.broadcast_to(found, 2)[k])
        expected = compiled(tree, {n: v * (k + 1) for n, v in VALUES.items()})
        assert value == pytest.approx(expected, rel=1e-14) or (math.isnan(value) and math.isnan(expected))


def test_names_are_variables_only() -> None:
    assert ex.names_in(ex.parse("sqrt(a) + pi*b - max(a, c_2)", "line 1")) == {"a", "b", "c_2"}
    assert ex.unknown_names(ex.parse("a + z + y", "line 1"), ["a"]) == ["y", "z"]


def test_substitution_keeps_precedence_and_leaves_the_original() -> None:
    tree = ex.parse("2*a**2 - sqrt(a)", "line 1")
    moved = ex.substitute(tree, {"a": ex.parse("b + c", "line 1")})
    again = ex.parse(ex.to_text(moved), "line 1")
    assert compiled(again, {"b": 1.5, "c": 2.5}) == 2 * 4.0**2 - 2.0
    assert ex.names_in(tree) == {"a"}


@pytest.mark.parametrize(("operator", "value"), [("+", 2.2), ("-", -0.8), ("*", 1.05), ("/", 0.7 / 1.5)])
def test_joining_is_grouped(operator: str, value: float) -> None:
    joined = ex.combine(operator, ex.parse("a", "1"), ex.parse("0.5 + 1", "1"))
    assert compiled(joined, {"a": 0.7}) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize("name", sorted(ex.FUNCTIONS))
def test_both_limits_of_a_function_are_told(name: str) -> None:
    """Ten arguments of max were told to be "2 or more", which they are."""
    fewest, most = ex.FUNCTIONS[name]
    for count in (fewest, most):
        ex.parse(f"{name}({', '.join(['a'] * count)})", "here")
    for count in (fewest - 1, most + 1):
        with pytest.raises(DataError) as refused:
            ex.parse(f"{name}({', '.join(['a'] * count)})", "here")
        limits = f"{fewest} argument," if fewest == most else f"{fewest} to {most} arguments,"
        assert str(refused.value).endswith(f"takes {limits} found {count}"), refused.value
