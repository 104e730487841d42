"""Say whether enough windows stand behind a model's parameters."""

from __future__ import annotations

from aeolid.errors import NotIdentifiable
from aeolid.wording import counted

FEWEST = 10.0  # windows times outputs a parameter of the model that is told


def require_enough(windows: int, order: int, inputs: int, outputs: int, source: str, lost: bool) -> str:
    """Return a warning where fewer than 10 windows stand behind a parameter, empty elsewhere; refuse where data miss.

    A model of n states has n (2 l + r) + l r parameters whatever the basis, a window l equations: below 10 of them a
    parameter the scatter of the answer is no longer small beside it. lost: whether missing samples took windows; a
    complete short recording is answered with a warning. Raises NotIdentifiable.
    """
    parameters = order * (2 * outputs + inputs) + outputs * inputs
    each = windows * outputs / parameters
    if each >= FEWEST:
        return ""
    text = f"{windows} windows of {counted(outputs, 'output')} are {each:.1f} a parameter of a model of order {order}"
    if lost:
        raise NotIdentifiable(
            f"{source}: {text}, fewer than {FEWEST:.0f}; other windows hold missing samples: record longer, "
            "ask for a lower order or a shorter past window"
        )
    return f"{text}, fewer than {FEWEST:.0f}: the answer may be chance"
