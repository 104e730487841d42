"""aeolid monitor: a live page, or a view on the terminal, of what nodes stream."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from aeolid.cli.common import DEFAULT_BASE, BaseOption, ForceOption, JsonOption, console, progress_console
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
from aeolid.errors import UsageError

if TYPE_CHECKING:
    from aeolid.can.reception import Reception
    from aeolid.cli.listen_modes import ModeFollower
    from aeolid.monitor.board import Board
    from aeolid.monitor.server import PageServer
    from aeolid.monitor.terminal import Terminal

EXAMPLES = (
    "aeolid monitor --bus socketcan:can0 --record received.csv",
    "aeolid monitor --bus slcan:socket://127.0.0.1:29536 --terminal --for 60",
    "aeolid monitor --bus socketcan:can0 --publish mqtt://broker/park/turbine7",
)
PORT = 8536


def register(app: typer.Typer) -> None:
    """Add the sub-command to the application."""
    app.command("monitor")(run)


def run(
    bus: BusOption,
    address: Annotated[
        str, typer.Option("--address", help="Serve the page here; only this machine by default.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", help="Serve the page here; 0: any free one.", min=0, max=65535)] = PORT,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page; default, on a desktop.")
    ] = True,
    terminal: Annotated[
        bool, typer.Option("--terminal", help="Show the facts on the terminal; serve no page.")
    ] = False,
    record: RecordOption = None,
    log: LogOption = None,
    markov: MarkovOption = None,
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
    node_id: Annotated[int | None, typer.Option("--node-id", help="Show and write this node only.")] = None,
    base: BaseOption = DEFAULT_BASE,
    bit_rate: BitRateOption = 500_000,
    data_bit_rate: DataBitRateOption = 2_000_000,
    publish: PublishOption = None,
    publish_every: PublishEveryOption = 10.0,
    json: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Watch nodes while they stream: modes with their bands, Markov parameters, innovations, health, losses, bus load.

    The first line on standard output is the address of the page. Receives, writes and ends as `listen` does; the page
    of a log is kept until Ctrl-C. --poles-every is also the distance of the points in the page's history. The page's
    address has /metrics for Prometheus beside it.
    """
    from aeolid.monitor.board import Board

    wanted = Wanted(
        bus, record, log, markov, True, poles, poles_every, order, seconds, until_end, reconnect, node_id, base,
        bit_rate, data_bit_rate, json, "--for", "monitor", force,
    )  # fmt: skip
    board, targets, every = Board(), targets_of(publish), check_every(publish_every)

    @contextmanager
    def show(reception: Reception, follower: ModeFollower | None, stop: Stop) -> Iterator[Over]:
        target = reception.recorder.target
        board.watch(reception, follower, node_id, None if target is None else str(target))
        with (
            publishing(targets, lambda: board.facts, every),
            _shown(board, (address, port, browser, terminal)) as view,
        ):
            yield lambda: view.farewell("The reception is over.")
            while reception.source.is_log and not (terminal or until_end or seconds is not None or stop()):
                time.sleep(0.1)

    receive(wanted, show, board)


@contextmanager
def _shown(board: Board, where: tuple[str, int, bool, bool]) -> Iterator[PageServer | Terminal]:
    """Show the board until the reception is over."""
    address, port, browser, terminal = where
    view = _terminal(board) if terminal else _page(board, address, port, browser)
    try:
        yield view
    finally:
        view.close()


def _terminal(board: Board) -> Terminal:
    from aeolid.monitor.terminal import Terminal

    return Terminal(board, progress_console)


def _page(board: Board, address: str, port: int, browser: bool) -> PageServer:
    try:
        from aeolid.monitor.server import PageServer
    except ImportError as error:
        missing = (error.name or "a package").partition(".")[0]
        raise UsageError(
            f"the page needs {missing}, which is not installed: pip install {missing}, or use --terminal"
        ) from None
    server = PageServer(board, address, port)
    console.print(server.url, soft_wrap=True, markup=False)
    console.file.flush()
    if not _is_loopback(address):
        progress_console.print(
            f"aeolid: {address} is not the loopback: whoever reaches port {server.port} of this machine can watch",
            soft_wrap=True, markup=False,
        )  # fmt: skip
    if browser:
        _open(server.url)
    return server


def _is_loopback(address: str) -> bool:
    import ipaddress

    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return address.lower() == "localhost"


def _open(url: str) -> None:
    """Open the page where there is a desktop; a browser of the terminal would take the terminal away."""
    import os
    import sys
    import threading
    import webbrowser

    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return
    threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()
