"""Options for handing facts on to brokers and databases, and the thread that does it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aeolid.cli.common import progress_console
from aeolid.cli.durations import seconds_of
from aeolid.errors import UsageError
from aeolid.wording import counted

if TYPE_CHECKING:
    from aeolid.publish.rows import Row
    from aeolid.publish.target import Target

PublishOption = Annotated[
    list[str] | None,
    typer.Option(
        "--publish",
        metavar="URL",
        help="Send the facts to mqtt://HOST/TOPIC or, as InfluxDB's lines, to http://HOST/write?db=X; repeatable.",
    ),
]
PublishEveryOption = Annotated[
    float,
    typer.Option(
        "--publish-every", parser=seconds_of, metavar="TIME", help="Between two messages of --publish: 10, 1min."
    ),
]


def targets_of(urls: Sequence[str] | None) -> list[tuple[str, Target]]:
    """Return what the options name, by a name that may be shown. Raises UsageError."""
    if not urls:
        return []
    from urllib.parse import urlsplit

    from aeolid.publish.target import target_of

    return [(f"{urlsplit(url).scheme}://{urlsplit(url).netloc}", target_of(url)) for url in urls]


def check_every(seconds: float) -> float:
    """Return the time between two messages; raises UsageError on none."""
    if not 0.1 <= seconds <= 86400:
        raise UsageError(f"--publish-every {seconds:g} is no time between 0.1 and 86400 s")
    return seconds


@contextmanager
def publishing(
    targets: Sequence[tuple[str, Target]], facts: Callable[[], dict[str, Any]], every_s: float
) -> Iterator[None]:
    """Send the facts of a monitor for as long as the block lasts, and the last of them at its end."""
    if not targets:
        yield
        return
    from aeolid.publish.rows import rows_of_monitor
    from aeolid.publish.target import Publisher

    def say(text: str) -> None:
        progress_console.print(f"aeolid: {text}", soft_wrap=True, markup=False)

    publisher = Publisher(targets, lambda: rows_of_monitor(facts()), say, every_s)
    try:
        yield
    finally:
        publisher.close()


def publish_once(targets: Sequence[tuple[str, Target]], rows: Sequence[Row]) -> None:
    """Send rows to every target, and say of each whether they arrived."""
    import time

    for name, target in targets:
        try:
            target.send(rows, time.time())
        except Exception as error:  # the result is still to be written and judged
            progress_console.print(f"aeolid: --publish {name}: not sent ({error})", soft_wrap=True, markup=False)
        else:
            told = f"aeolid: --publish {name}: {counted(len(rows), 'row')} sent"
            progress_console.print(told, soft_wrap=True, markup=False)
        finally:
            target.close()
