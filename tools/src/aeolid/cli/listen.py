"""aeolid listen: receive the stream of one or several nodes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aeolid.cli.common import DEFAULT_BASE, BaseOption, ForceOption, JsonOption
from aeolid.cli.durations import seconds_of
from aeolid.cli.publishing import PublishEveryOption, PublishOption, check_every, publishing, targets_of
from aeolid.cli.receiving import (
    BitRateOption,
    BusOption,
    DataBitRateOption,
    LogOption,
    MarkovOption,
    OrderOption,
    Over,
    PolesEveryOption,
    PolesOption,
    ReconnectOption,
    RecordOption,
    Stop,
    UntilEndOption,
    Wanted,
    receive,
)

if TYPE_CHECKING:
    from aeolid.can.reception import Reception
    from aeolid.cli.listen_modes import ModeFollower

EXAMPLES = (
    "aeolid listen --bus socketcan:can0 --record received.csv",
    "aeolid listen --bus slcan:socket://127.0.0.1:29536 --record received.csv --markov markov.npz --until-end",
    "aeolid listen --bus bus.blf --record received.parquet",
)


def register(app: typer.Typer) -> None:
    """Add the sub-command to the application."""
    app.command("listen")(run)


def run(
    bus: BusOption,
    record: RecordOption = None,
    log: LogOption = None,
    markov: MarkovOption = None,
    modes: Annotated[
        bool, typer.Option("--modes/--no-modes", help="Follow the modes of each node as samples arrive; default.")
    ] = True,
    poles: PolesOption = None,
    poles_every: PolesEveryOption = 1.0,
    order: OrderOption = None,
    seconds: Annotated[
        float | None,
        typer.Option(
            "--for", "--seconds", parser=seconds_of, metavar="TIME", help="Stop after this time: 600, 10min, 1h."
        ),
    ] = None,
    until_end: UntilEndOption = False,
    reconnect: ReconnectOption = None,
    node_id: Annotated[int | None, typer.Option("--node-id", help="Write this node only.")] = None,
    base: BaseOption = DEFAULT_BASE,
    bit_rate: BitRateOption = 500_000,
    data_bit_rate: DataBitRateOption = 2_000_000,
    publish: PublishOption = None,
    publish_every: PublishEveryOption = 10.0,
    json: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Receive the stream of nodes, show its progress, write recordings, raw logs and Markov parameters.

    Stops at the end of a log, with --until-end when the nodes end, after --seconds, or on Ctrl-C and SIGTERM. What had
    arrived is written in any case; exit code 3 when nothing usable came, the bus broke off or the disk was full.
    """
    from aeolid.cli.listen_view import shown

    wanted = Wanted(
        bus, record, log, markov, modes, poles, poles_every, order, seconds, until_end, reconnect, node_id, base,
        bit_rate, data_bit_rate, json, force=force,
    )  # fmt: skip
    targets, every = targets_of(publish), check_every(publish_every)
    if not targets:
        receive(wanted, lambda reception, follower, _: shown(reception, follower))
        return
    from aeolid.monitor.board import Board

    board = Board()

    def facts() -> dict[str, Any]:
        board.tick()
        return board.facts

    @contextmanager
    def show(reception: Reception, follower: ModeFollower | None, stop: Stop) -> Iterator[Over]:
        board.watch(reception, follower, node_id)
        with publishing(targets, facts, every), shown(reception, follower) as over:
            yield over

    receive(wanted, show, board)
