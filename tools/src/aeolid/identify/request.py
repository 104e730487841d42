"""Hold what is asked of an identification: the settings that the command line and Python share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from aeolid.errors import UsageError
from aeolid.identify.request_checks import (
    check_blades,
    check_finish,
    check_method,
    check_ort_and_fir,
    check_output_only,
    check_passes,
    check_preparation,
    check_scheduled,
    check_uncertainty,
    check_whole,
    read_order,
    read_regularization,
)

DELAYED = ("varx", "varmax", "fir")
_WHOLE = (
    "future", "decimate", "passes", "kernel_rows", "joint_order", "deterministic_order", "bootstrap_runs",
    "bootstrap_seed",
)  # fmt: skip
_RENAMED = {"forget": "forgetting", "memory": "memory_gb", "refine": "refined"}  # option: argument of the methods


@dataclass(frozen=True)
class Request:
    """Hold the settings of an identification by the names of the options of `aeolid identify`; None: not given.

    past: p in samples, seconds as "12s", or "auto" (varx, varmax). method: one of request_checks.METHODS. future: f,
    default p. order: n or "auto". order_criterion, missing, detrend, robust, solution, passes, forget, scheduling,
    varying, kernel_*, scheduling_scaling, offsets, refine, memory (gigabytes), joint_order, deterministic_order,
    response, uncertainty, bootstrap_*: of single methods, refused with another. feedthrough, angle: names, "auto" or
    "none". outputs: channels to identify by themselves, without inputs, or "all" of the role. reference: output that
    mode shapes are scaled to (varx, varmax). blades: sets of blade channels that go to the fixed frame, "auto" or
    "none"; None for those of the roles file. delay: samples by name of the input, texts NAME=SAMPLES, "auto" or
    "none"; None is "auto" where the method has delays. regularize: "gcv", "none" or λ. decimate: factor. stable: move
    poles inside the unit circle; allow_unstable: return also a model that is unstable or whose free run diverges.
    """

    past: str | int = "auto"
    method: str = "varx"
    future: int | None = None
    order: str | int | None = "auto"
    order_criterion: str | None = None
    feedthrough: Sequence[str] | str | None = None
    regularize: str | float = "gcv"
    missing: str | None = None
    detrend: str | None = None
    robust: str | None = None
    solution: str | None = None
    decimate: int = 1
    passes: int | None = None
    forget: float | None = None
    delay: Mapping[str, int] | Sequence[str] | str | None = None
    angle: Sequence[str] | str | None = None
    scheduling: Sequence[str] | None = None
    varying: str | Sequence[str] | None = None
    kernel_rows: int | None = None
    kernel_selection: str | None = None
    kernel_tolerance: float | None = None
    scheduling_scaling: str | None = None
    offsets: bool | None = None
    refine: bool | None = None
    memory: float | None = None
    joint_order: int | None = None
    deterministic_order: int | None = None
    response: str | None = None
    stable: bool = False
    allow_unstable: bool = False
    uncertainty: str | None = None
    bootstrap_runs: int | None = None
    bootstrap_seed: int | None = None
    outputs: Sequence[str] | str | None = None
    reference: str | None = None
    blades: Sequence[str] | str | None = None

    def check(self, *, streamed: bool = False) -> None:
        """Refuse settings that do not go together, before anything is read; streamed: whether Ξ comes from a stream.

        Raises UsageError that names the option.
        """
        check_whole(self.given(*_WHOLE))
        check_method(self.method, str(self.past))
        check_passes(self.given("passes", "forget"), self.method, streamed)
        check_uncertainty(self.given("uncertainty", "bootstrap_runs", "bootstrap_seed"), self.method, streamed)
        check_scheduled(self._scheduled(), self.method, streamed, self.stable)
        check_finish(self.given("order_criterion", "refine", "solution"), self.method, str(self.order or "auto"))
        self.delays(streamed=streamed)
        check_preparation(self.given("missing", "detrend", "robust"), self.method, streamed)
        check_output_only(self.given("outputs", "reference"), self.method, streamed)
        check_blades(names(self.blades), streamed)
        joint = self.given("joint_order", "deterministic_order", "response")
        check_ort_and_fir(joint, self.method, streamed, self.regularize, self.stable)
        read_order(self.order)
        read_regularization(self.regularize)

    def common(self) -> dict[str, Any]:
        """Return the arguments that every method takes."""
        return {
            "future": self.future, "order": read_order(self.order), "decimation": self.decimate,
            "regularization": read_regularization(self.regularize),
        }  # fmt: skip

    def own(self) -> dict[str, Any]:
        """Return the arguments of this method alone, those that were given."""
        given = self._scheduled() | self.given(
            "passes", "forget", "uncertainty", "bootstrap_runs", "bootstrap_seed", "joint_order", "deterministic_order",
            "response", "order_criterion", "refine", "solution", "missing", "detrend", "robust", "reference",
        )  # fmt: skip
        if "scheduling" in given:
            given["scheduling"] = names(self.scheduling)
        return {_RENAMED.get(option, option): value for option, value in given.items()}

    def given(self, *options: str) -> dict[str, Any]:
        """Return those of these options that are not None."""
        return {option: value for option in options if (value := getattr(self, option)) is not None}

    def delays(self, *, streamed: bool) -> Mapping[str, int] | str | None:
        """Return samples by input, "auto" where nothing is said and the method has delays, None for none."""
        fit = self.method in DELAYED and not streamed
        if self.delay is None:
            return "auto" if fit else None
        if isinstance(self.delay, Mapping):
            found: Mapping[str, int] | str | None = self.delay
        else:
            from aeolid.identify.delay import read_delays

            found = read_delays(names(self.delay))
        if found is not None and not fit:
            what = "--markov, whose windows know of no delay" if streamed else f"--method {self.method}"
            raise UsageError(f"--delay is for --method varx, varmax and fir on recordings; leave it out with {what}")
        return found

    def _scheduled(self) -> dict[str, Any]:
        return self.given(
            "scheduling", "varying", "kernel_rows", "kernel_selection", "offsets", "memory", "scheduling_scaling",
            "kernel_tolerance",
        )  # fmt: skip


def names(given: Sequence[str] | str | None) -> list[str] | None:
    """Return names as a list: a text is one of them."""
    return None if given is None else [given] if isinstance(given, str) else list(given)
