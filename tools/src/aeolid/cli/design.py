"""Design an excitation for a model before a recording is made."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aeolid.cli.common import ForceOption, JsonOption, console, emit_json, one_of, waiting
from aeolid.cli.durations import seconds_of
from aeolid.errors import UsageError
from aeolid.output import declare

if TYPE_CHECKING:
    from aeolid.excitation.design import DesignRequest

EXAMPLES = (
    "aeolid design model.json --bound pitch=1deg --rate pitch=5deg/s --duration 10min --out excitation.csv",
    "aeolid design model.json --bound pitch=1deg --limit tower_fore_aft=0.2 --deviation 10% --goal 0.44 --out e.csv",
    "aeolid design model.json --bound pitch=1deg --demand pitch=0..90deg --signal prbs --duration 600 --start 60 "
    "--out e.csv --wrapper excitation.cfg",
)


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command(name="design")(design)


def design(
    model_file: Annotated[Path, typer.Argument(metavar="MODEL", help="Identified model.json, or a .mat with noise.")],
    out: Annotated[Path, typer.Option("--out", help="Where to write the signal (.csv, .csv.gz or .parquet).")],
    bound: Annotated[
        list[str] | None,
        typer.Option("--bound", metavar="INPUT=A", help="Excite this input within ±A, such as pitch=2deg; repeatable."),
    ] = None,
    rate: Annotated[
        list[str] | None,
        typer.Option("--rate", metavar="INPUT=R", help="Move it by at most R a second, such as pitch=5deg/s."),
    ] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option("--limit", metavar="OUTPUT=S", help="Keep the predicted rms of an output below S; repeatable."),
    ] = None,
    on_top: Annotated[
        bool, typer.Option("--on-top", help="Limits are on what the excitation adds, not on the whole with noise.")
    ] = False,
    duration: Annotated[
        float | None,
        typer.Option("--duration", parser=seconds_of, metavar="TIME", help="Length of the experiment: 600, 10min, 1h."),
    ] = None,
    deviation: Annotated[
        str | None,
        typer.Option("--deviation", help="Find the shortest duration with this relative deviation, such as 5%."),
    ] = None,
    goal: Annotated[
        str | None,
        typer.Option("--goal", help="Mode to be known best: its name or frequency in Hz; default the worst known."),
    ] = None,
    quantity: Annotated[
        str,
        typer.Option(
            "--quantity",
            help="What of it: frequency, damping, or both (the larger relative deviation).",
            autocompletion=one_of("frequency", "damping", "both"),
        ),
    ] = "both",
    signal: Annotated[
        str,
        typer.Option(
            "--signal",
            help="prbs, multisine, filtered, or auto: the best of all.",
            autocompletion=one_of("auto", "prbs", "multisine", "filtered"),
        ),
    ] = "auto",
    clock: Annotated[
        float | None,
        typer.Option(
            "--clock", parser=seconds_of, metavar="TIME", help="prbs: seconds a bit; default several are tried."
        ),
    ] = (None),
    band: Annotated[
        str | None, typer.Option("--band", metavar="LOW,HIGH", help="multisine, filtered: Hz; default several.")
    ] = None,
    lines: Annotated[int | None, typer.Option("--lines", help="multisine: most lines an input, default 64.")] = None,
    phases: Annotated[
        str | None,
        typer.Option(
            "--phases",
            help="multisine: schroeder (default) or random.",
            autocompletion=one_of("schroeder", "random"),
        ),
    ] = None,
    sample_time: Annotated[
        float | None,
        typer.Option(
            "--sample-time",
            parser=seconds_of,
            metavar="TIME",
            help="Seconds between values: the model's (default), a multiple or part of it.",
        ),
    ] = None,
    controller: Annotated[
        Path | None,
        typer.Option("--controller", help="Linear model from outputs to inputs that holds the plant: closed loop."),
    ] = None,
    past: Annotated[
        int | None, typer.Option("--past", help="Past window of the identification to come; default the model's own.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", help="Of phases, registers and noise.")] = 1,
    wrapper: Annotated[
        Path | None,
        typer.Option("--wrapper", help="Write the settings with which port/discon plays the signal; needs --demand."),
    ] = None,
    demand: Annotated[
        list[str] | None,
        typer.Option("--demand", metavar="INPUT=LOW..HIGH", help="Range of the whole demand, for --wrapper."),
    ] = None,
    start: Annotated[
        float,
        typer.Option(
            "--start", parser=seconds_of, metavar="TIME", help="For --wrapper: when it begins, in simulated seconds."
        ),
    ] = 0.0,
    json_target: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Design an excitation within bounds, and foretell how well the modes will be known.

    Sequences and multisines are tried around the modes; the one that tells most is written, with the standard
    deviations of frequency and damping that identify will have. Works on the model's own noise: what the model does not
    know is not foretold.
    """
    from aeolid.excitation.candidates import Wanted
    from aeolid.excitation.design import DesignRequest
    from aeolid.excitation.quantities import read_pairs

    if wrapper is None and (demand or start):
        raise UsageError("--demand and --start are of --wrapper FILE; leave them out, or name the file")
    wanted = Wanted(None if signal == "auto" else signal, clock, _band(band), lines, phases, wrapper is not None)
    pairs = {o: read_pairs(f"--{o}", given or []) for o, given in
             (("bound", bound), ("rate", rate), ("limit", limit), ("demand", demand))}  # fmt: skip
    request = DesignRequest(
        pairs["bound"], pairs["rate"], pairs["limit"], pairs["demand"], duration, _part(deviation), sample_time, wanted,
        goal, quantity, on_top, past, seed,
    )  # fmt: skip
    request.check()
    files = {"--out": out, "--wrapper": wrapper, "--json": json_target}
    inputs = [model_file, *([controller] if controller else [])]
    declare("design", force=force, inputs=inputs, files=files)
    _run(model_file, controller, request, out, (wrapper, start), json_target)


def _run(
    model_file: Path, controller: Path | None, request: DesignRequest, out: Path, wrapper: tuple[Path | None, float],
    json_target: str | None,
) -> None:  # fmt: skip
    from aeolid import output
    from aeolid.api.designing import known_of, linear_model
    from aeolid.excitation.design import design_excitation

    model = linear_model(model_file)
    stated, facts = known_of(model)
    holder = None if controller is None else linear_model(controller).state_space
    with waiting("designing"):
        result = design_excitation(
            model.state_space, request, controller=holder, stated=stated, facts=facts, source=str(model_file)
        )
    target, start = wrapper
    settings = result.wrapper(start) if target is not None else None
    result.write(out)
    if target is not None and settings is not None:
        output.write_text(target, settings)
    if json_target != "-":
        console.print(f"{result.summary()}\nwritten to {out}", markup=False, soft_wrap=True)
        if target is not None:
            console.print(f"settings of the wrapper, written to {target}:\n{settings}", markup=False, soft_wrap=True)
    emit_json(result.to_json() | {"out": str(out), "wrapper": settings}, json_target)


def _band(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"--band {text!r} is not LOW,HIGH in Hz, such as 0.1,1") from None
    return low, high


def _part(text: str | None) -> float | None:
    if text is None:
        return None
    try:
        return float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
    except ValueError:
        raise UsageError(f"--deviation {text!r} is not a part such as 0.05 or 5%") from None
