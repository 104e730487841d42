"""Translate a model's equations into machine code for one or several parameter sets at a time, by way of LLVM.

numba's front end took seconds for a model with all effects of the catalogue; straight-line code needs none of it.
"""

from __future__ import annotations

import ast
import os
import struct
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import llvmlite.binding as llvm

from aeolid.models import expressions as ex
from aeolid.models.equations import STEP, Auxiliary, Equations

LANES = 8  # copies of a model that run side by side: one AVX-512 register, two of AVX2
_LOCK = threading.Lock()  # LLVM's global context serves one thread at a time
_OPERATORS: dict[type, str] = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
_CALLED = ("exp", "log", "sin", "cos", "tan", "tanh", "pow")  # of the platform's mathematical library
_MOST_FACTORS = 4  # a whole power up to this is written as products, exact to rounding


@dataclass(frozen=True, eq=False)
class MachineCode:
    """Hold the addresses of flow(x, u, θ, d), read(x, u, θ, y, s), renew(x, u, θ, dt) and correct(x, z, y, e, K, s).

    The last one writes e = z − y, with z what was measured, and adds K s e to x; where e is NaN nothing. All arguments
    are pointers to doubles but dt. In a code of several lanes every array holds its lanes side by side,
    x[i · lanes + lane]; u, z and dt are the same for all. d may be x.
    """

    flow: int
    read: int
    renew: int
    correct: int
    lanes: int
    engine: llvm.ExecutionEngine = field(repr=False)  # owns the code


def translate(model: Equations, lanes: int = 1) -> MachineCode:
    """Translate a model (its unused intermediates already pruned): some ten milliseconds.

    Arithmetic follows IEEE rules: sqrt of a negative number is NaN, division by zero infinite; nothing is reordered.
    """
    functions = [
        _function("flow", "ptr %x, ptr %u, ptr %th, ptr %d", lanes, lambda w: _flow(w, model)),
        _function("read", "ptr %x, ptr %u, ptr %th, ptr %y, ptr %s", lanes, lambda w: _read(w, model)),
        _function("renew", "ptr %x, ptr %u, ptr %th, double %dt", lanes, lambda w: _renew(w, model)),
        _function("correct", "ptr %x, ptr %z, ptr %y, ptr %e, ptr %K, ptr %s", lanes, lambda w: _correct(w, model)),
    ]
    with _LOCK:
        engine = _assemble("\n".join([*_declarations(lanes), *functions]))
        flow, read, renew, correct = (engine.get_function_address(n) for n in ("flow", "read", "renew", "correct"))
    return MachineCode(flow, read, renew, correct, lanes, engine)


def _assemble(text: str) -> llvm.ExecutionEngine:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    module = llvm.parse_assembly(text)
    module.verify()
    cpu, features = _processor()
    machine = llvm.Target.from_default_triple().create_target_machine(cpu=cpu, features=features, opt=2, jit=True)
    engine = llvm.create_mcjit_compiler(module, machine)
    engine.finalize_object()
    return engine


def _processor() -> tuple[str, str]:
    """Return the processor's name and features for LLVM: this machine's, or those of numba's own variables.

    NUMBA_CPU_NAME and NUMBA_CPU_FEATURES thereby choose the instructions of all compiled code at once, so that one
    machine computes as others do. A name alone stands for that processor's own features.
    """
    name, features = os.environ.get("NUMBA_CPU_NAME"), os.environ.get("NUMBA_CPU_FEATURES")
    if name and features is None:
        return name, ""
    host = llvm.get_host_cpu_features().flatten() if features is None else features
    return name or llvm.get_host_cpu_name(), host


def _flow(w: _Writer, model: Equations) -> None:
    names = _visible(w, model, [s.derivative for s in model.states])
    for i, state in enumerate(model.states):
        w.store("d", i, w.value(state.derivative, names))


def _read(w: _Writer, model: Equations) -> None:
    trees = [o.equation for o in model.outputs] + [o.slope for o in model.outputs if o.slope is not None]
    names = _visible(w, model, trees)
    for j, o in enumerate(model.outputs):
        w.store("y", j, w.value(o.equation, names))
        w.store("s", j, w.number(1.0) if o.slope is None else w.value(o.slope, names))


def _renew(w: _Writer, model: Equations) -> None:
    """All memories settle first, then each is renewed; later ones see its new value, through intermediates too."""
    trees = [tree for m in model.memories for tree in (m.next, m.settled)]
    names, following = _visible(w, model, trees), model.intermediates_of_memories(trees)
    names[STEP] = w.spread("%dt")
    for m in model.memories:
        kept = names[m.name]
        missing = w.operation(f"fcmp uno {w.type} {kept}, {kept}")
        names[m.name] = w.choose(missing, w.value(m.settled, names), kept)
        names.update(_again(w, following, names))
    for i, m in enumerate(model.memories):
        names[m.name] = w.value(m.next, names)
        w.store("x", len(model.states) + i, names[m.name])
        names.update(_again(w, following, names))


def _again(w: _Writer, following: Sequence[Auxiliary], names: Mapping[str, str]) -> dict[str, str]:
    """Write these intermediates with what the memories are now."""
    found = dict(names)
    for a in following:
        found[a.name] = w.value(a.equation, found)
    return found


def _correct(w: _Writer, model: Equations) -> None:
    """Written out for the model's size: as loops over lanes it took three quarters of a linear model's time."""
    outputs = len(model.outputs)
    pushes = []
    for j in range(outputs):
        e = w.operation(f"fsub {w.type} {w.load('z', j)}, {w.load('y', j)}")
        w.store("e", j, e)
        known = w.operation(f"fcmp ord {w.type} {e}, {e}")
        pushes.append(w.choose(known, w.operation(f"fmul {w.type} {w.load('s', j)}, {e}"), w.number(0.0)))
    for i in range(len(model.states)):
        total = w.load("x", i)
        for j, push in enumerate(pushes):
            total = w.operation(
                f"fadd {w.type} {total}, " + w.operation(f"fmul {w.type} {w.load('K', i * outputs + j)}, {push}")
            )
        w.store("x", i, total)


def _visible(w: _Writer, model: Equations, roots: Sequence[ast.expr]) -> dict[str, str]:
    """Load what these equations use, directly or through intermediates; returns name → value."""
    used = set().union(*(ex.names_in(r) for r in roots)) if roots else set()
    needed = []
    for a in reversed(model.auxiliaries):
        if a.name in used:
            used |= ex.names_in(a.equation)
            needed.append(a)
    states = [s.name for s in model.states] + [m.name for m in model.memories]
    names = {n: w.load("x", i) for i, n in enumerate(states) if n in used}
    names |= {m.name: w.load("x", len(model.states) + i) for i, m in enumerate(model.memories)}
    names |= {n: w.load("u", i) for i, n in enumerate(model.symbols) if n in used}
    names |= {p.name: w.load("th", i) for i, p in enumerate(model.parameters) if p.name in used}
    for a in reversed(needed):
        names[a.name] = w.value(a.equation, names)
    return names


def _function(name: str, arguments: str, lanes: int, write: Callable[[_Writer], None]) -> str:
    writer = _Writer(lanes)
    write(writer)
    return "\n".join([f"define void @{name}({arguments}) {{", *writer.lines, *writer.stores, "  ret void", "}"])


def _declarations(lanes: int) -> list[str]:
    kind, suffix = ("double", "f64") if lanes == 1 else (f"<{lanes} x double>", f"v{lanes}f64")
    lines = [f"declare double @{n}(double{', double' if n == 'pow' else ''})" for n in _CALLED]
    return lines + [f"declare {kind} @llvm.{n}.{suffix}({kind})" for n in ("sqrt", "fabs")]


class _Writer:
    """Write straight-line code; what was computed once is used again. Stores come last: reads see the old values."""

    def __init__(self, lanes: int) -> None:
        self.lanes = lanes
        self.type, self.suffix = ("double", "f64") if lanes == 1 else (f"<{lanes} x double>", f"v{lanes}f64")
        self.lines: list[str] = []
        self.stores: list[str] = []
        self._known: dict[str, str] = {}

    def operation(self, text: str) -> str:
        """Write `%new = text` unless it was written before; returns the name of the result."""
        if text not in self._known:
            self._known[text] = f"%v{len(self._known)}"
            self.lines.append(f"  {self._known[text]} = {text}")
        return self._known[text]

    def number(self, value: float) -> str:
        """Return a constant, exact to the last bit."""
        text = f"0x{struct.unpack('>Q', struct.pack('>d', value))[0]:016X}"
        return text if self.lanes == 1 else "<" + ", ".join([f"double {text}"] * self.lanes) + ">"

    def spread(self, scalar: str) -> str:
        """Return a scalar in every lane."""
        if self.lanes == 1:
            return scalar
        first = self.operation(f"insertelement {self.type} undef, double {scalar}, i32 0")
        return self.operation(
            f"shufflevector {self.type} {first}, {self.type} undef, <{self.lanes} x i32> zeroinitializer"
        )

    def load(self, array: str, index: int) -> str:
        """Return an element of u or z (the same for all lanes) or of another array (one a lane)."""
        if array in ("u", "z"):
            return self.spread(self.operation(f"load double, ptr {self._place(array, index, 1)}, align 8"))
        return self.operation(f"load {self.type}, ptr {self._place(array, index, self.lanes)}, align 8")

    def store(self, array: str, index: int, value: str) -> None:
        """Write a result, after all that is read."""
        place = self._place(array, index, self.lanes)
        self.stores.append(f"  store {self.type} {value}, ptr {place}, align 8")

    def _place(self, array: str, index: int, width: int) -> str:
        return self.operation(f"getelementptr double, ptr %{array}, i64 {index * width}")

    def choose(self, condition: str, yes: str, no: str) -> str:
        """Return yes where the condition holds, lane by lane."""
        truth = "i1" if self.lanes == 1 else f"<{self.lanes} x i1>"
        return self.operation(f"select {truth} {condition}, {self.type} {yes}, {self.type} {no}")

    def value(self, tree: ast.expr, names: Mapping[str, str]) -> str:
        """Write an expression; returns the name of its value."""
        if isinstance(tree, ast.Constant):
            return self.number(float(tree.value))  # type: ignore[arg-type]
        if isinstance(tree, ast.Name):
            return self.number(float(ex.CONSTANTS[tree.id])) if tree.id in ex.CONSTANTS else names[tree.id]
        if isinstance(tree, ast.UnaryOp):
            inner = self.value(tree.operand, names)
            return self.operation(f"fneg {self.type} {inner}") if isinstance(tree.op, ast.USub) else inner
        if isinstance(tree, ast.BinOp):
            return self._binary(tree, names)
        if isinstance(tree, ast.Call):
            return self._call(tree.func.id, [self.value(a, names) for a in tree.args])  # type: ignore[attr-defined]
        raise AssertionError(f"unchecked node {type(tree).__name__}")

    def _binary(self, tree: ast.BinOp, names: Mapping[str, str]) -> str:
        left = self.value(tree.left, names)
        if not isinstance(tree.op, ast.Pow):
            right = self.value(tree.right, names)
            return self.operation(f"{_OPERATORS[type(tree.op)]} {self.type} {left}, {right}")
        power = tree.right.value if isinstance(tree.right, ast.Constant) else None
        if power in range(1, _MOST_FACTORS + 1):
            result = left
            for _ in range(int(power) - 1):  # type: ignore[arg-type]
                result = self.operation(f"fmul {self.type} {result}, {left}")
            return result
        return self._library("pow", [left, self.value(tree.right, names)])

    def _call(self, name: str, values: list[str]) -> str:
        kind, first = self.type, values[0]
        if name in ("sqrt", "abs"):
            intrinsic = {"sqrt": "sqrt", "abs": "fabs"}[name]
            return self.operation(f"call {kind} @llvm.{intrinsic}.{self.suffix}({kind} {first})")
        if name == "sign":  # zero and NaN stay what they are
            above = self.operation(f"fcmp ogt {kind} {first}, {self.number(0.0)}")
            below = self.operation(f"fcmp olt {kind} {first}, {self.number(0.0)}")
            return self.choose(above, self.number(1.0), self.choose(below, self.number(-1.0), first))
        if name in ("min", "max"):
            order = "olt" if name == "min" else "ogt"
            for other in values[1:]:
                first = self.choose(self.operation(f"fcmp {order} {kind} {other}, {first}"), other, first)
            return first
        return self._library(name, values)

    def _library(self, name: str, values: list[str]) -> str:
        """Call the mathematical library, once a lane."""
        if self.lanes == 1:
            return self.operation(f"call double @{name}({', '.join(f'double {v}' for v in values)})")
        result = "undef"
        for lane in range(self.lanes):
            parts = [self.operation(f"extractelement {self.type} {v}, i32 {lane}") for v in values]
            one = self.operation(f"call double @{name}({', '.join(f'double {p}' for p in parts)})")
            result = self.operation(f"insertelement {self.type} {result}, double {one}, i32 {lane}")
        return result
