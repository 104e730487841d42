"""Say what is missing or wrong in a reception, and what to do about it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from aeolid.wording import counted

Facts = dict[str, Any]
SILENT_S = 10.0  # without a frame before that is worth a word; health comes at least as often at usual settings
LOST = 0.01  # part of the values that may be lost before that is
AGE = 3.0  # usual distances between snapshots after which the newest is old
OUTSIDE = 4  # of the newest 20 blocks outside their bounds: by chance three looks in 10,000, once in 30,000 blocks
FULL = 0.7  # bus load from which low priorities wait

HEALTH = {
    1: "samples carry almost no news, so the filter does not forget: usual at standstill; else excite an input",
    2: "some direction is not excited: leave out channels that are constant or copies of others, or excite an input",
    4: "numbers ran away and the filter started afresh: check the sensors, scales and plausible ranges of the channels",
    8: "innovations grew and the filter fell back to VARX: lengthen the VARX start, or the past window without VARMAX",
    16: "the window was cut and began anew: the control task skipped samples or sent some that are no numbers",
    32: "a residual was cut before it was fed back: check the sensors for outliers",
    64: "the residual is not fed back: hand aeo_els_feedback to aeo_regressor_set_innovation after each update",
    128: "P held far more than the data bring, as after a sensor's fault, and started anew: check sensors and ranges",
}


def findings(facts: Facts) -> list[Facts]:
    """Return what an operator should know: dictionaries with node (or None), level (alarm, note), what and remedy."""
    found = [{"node": None} | f for f in _of_bus(facts)]
    alone = not (facts["over"] or facts["bus"]["status"] or facts["bus"]["silent_s"] >= SILENT_S)
    for node in facts["nodes"]:
        found += [{"node": node["node"]} | f for f in (*(_silence(node) if alone else ()), *_of_node(node))]
    return sorted(found, key=lambda f: f["level"] != "alarm")


def _alarm(what: str, remedy: str) -> Facts:
    return {"level": "alarm", "what": what, "remedy": remedy}


def _note(what: str, remedy: str) -> Facts:
    return {"level": "note", "what": what, "remedy": remedy}


def _of_bus(f: Facts) -> Iterator[Facts]:
    bus = f["bus"]
    if bus["status"] and f["ended"]:
        yield _note(
            "All nodes have ended their stream, and the bus is closed.", "It is opened again when it comes back."
        )
    elif bus["status"]:
        yield _alarm(
            bus["status"][0].upper() + bus["status"][1:] + ".", "It is opened by itself; check plug, power and adapter."
        )
    elif bus["frames"] == 0 and bus["seconds"] >= SILENT_S:
        yield _alarm("Not one frame has come.", "Is a node sending? Compare the bit rate, the wiring and its ends.")
    elif bus["frames"] and bus["silent_s"] >= SILENT_S and not f["ended"] and not f["over"]:
        yield _alarm(f"No frame for {bus['silent_s']:.0f} s.", "Is the controller running, and the adapter plugged in?")
    elif bus["frames"] and not f["nodes"] and bus["seconds"] >= SILENT_S:
        yield _alarm("There are frames, none of them from a node.", "Does the node use another --base?")
    if bus["overrun"]:
        yield _alarm(
            f"The interface has dropped {counted(bus['overrun'], 'frame')}.",
            "The host is too slow: end other programs.",
        )
    if bus["damaged"] or bus["garbled"]:
        yield _note(
            f"{counted(bus['damaged'], 'frame')} damaged, {counted(bus['garbled'], 'line')} garbled.",
            "Use a slower serial line or a faster adapter; seals on the node keep samples near them believed.",
        )
    if bus["errors"]:
        yield _note(
            f"{bus['errors']} error frames.", "Check the wiring, its ends and the bit rate of every participant."
        )
    if bus["load"] >= FULL:
        yield _alarm(f"The bus is {bus['load']:.0%} full.", "Lower the share of the node, or send every k-th sample.")


def _of_node(n: Facts) -> Iterator[Facts]:
    if n["problem"]:
        yield _alarm(n["problem"], "Bring node and host to the same version; until then none of its frames is read.")
        return
    if n["contested"]:
        yield _alarm(
            f"Two nodes seem to bear this number: {n['contested']}.",
            "Give one of them another number; until then no more is recorded than what one of them alone has sent.",
        )
    if n["refused"]:
        yield _alarm(
            f"Not followed any more: it {n['refused']}.", "Look for a device that imitates it, then start anew."
        )
    if not n["described"]:
        yield _note(
            "Waiting for its description.",
            "It comes within some ten seconds; of a node that never sends it, raise the share of the bus, or shorten"
            " describe_every.",
        )
        return
    checks: list[Callable[[Facts], Iterator[Facts]]] = [_losses, _snapshots, _modes, _innovations]
    for check in checks:
        yield from check(n)
    for flag, remedy in HEALTH.items():
        if n["flags"] & flag:
            yield _note(f"Health flag: {n['health'][str(flag)]}.", remedy[0].upper() + remedy[1:] + ".")


def _silence(n: Facts) -> Iterator[Facts]:
    """Tell of a node that has fallen silent while the bus goes on."""
    if n["state"] == "silent":
        yield _alarm(
            f"Nothing has come of it for {n['silent_s']:.0f} s, and it has not said goodbye.",
            "Is the controller powered and its plug in? What it sent last stays shown.",
        )


def _losses(n: Facts) -> Iterator[Facts]:
    if n["lost_share"] >= LOST:
        yield _alarm(
            f"{n['lost_share']:.1%} of the samples' values are lost.",
            "Each loss empties a window. Look at the node's queue (counter Refused), the adapter, the bus load.",
        )
    if n["left_out"]:
        yield _alarm(
            f"The modes were left without {counted(n['left_out'], 'sample')}.",
            "The host is too slow for them: a smaller --order or longer --poles-every helps. The recording has them.",
        )


def _snapshots(n: Facts) -> Iterator[Facts]:
    s = n["snapshots"]
    late = s["age_s"] is not None and s["every_s"] is not None and s["age_s"] > AGE * s["every_s"] + SILENT_S
    if s["incomplete"] > max(1, s["complete"] // 10):
        yield _alarm(
            f"{s['incomplete']} snapshots incomplete, {s['complete']} complete.",
            "Raise the repair frames of the node (repair_percent, --repair): they restore what gets lost on the way.",
        )
    elif late and n["state"] == "running":
        yield _alarm(
            f"No complete snapshot for {s['age_s']:.0f} s; usual are {s['every_s']:.0f} s.",
            "Does the node still compute them (counter Snapshots), and has it a share of the bus (counter Busy)?",
        )


def _modes(n: Facts) -> Iterator[Facts]:
    if n["modes_waiting"]:
        yield _note(f"No modes yet: {n['modes_waiting']}.", _about_modes(n["modes_waiting"]))
    elif n["modes_note"] and n["modes"]:
        yield _note(
            f"No deviations: {n['modes_note']}.",
            "Who listens from the node's first sample has them; else they come late.",
        )


def _about_modes(why: str) -> str:
    if "modes need every one" in why:
        return "Send every sample (sample_every = 1)."
    if "Markov parameters" in why:
        return "They come with the first complete snapshot."
    if "windows" in why:
        return "The order is chosen once enough samples have come; --order N does without."
    return "Compare past window, order and excitation; the documentation (Choose a method) says which method fits."


def _innovations(n: Facts) -> Iterator[Facts]:
    tests = n["innovations"]
    if tests["waiting"] or tests["caution"]:
        return
    for row in tests["rows"]:
        white, steady = row["outside"]
        of = f"in {{}} of the newest {tests['blocks']} blocks outside 99 %"
        if white >= OUTSIDE:
            yield _alarm(
                f"Innovations of {row['output']} are not white, {of.format(white)}.",
                "The window is too short, or the turbine has changed faster than the filter forgets: lengthen the past"
                " window, or let λ forget.",
            )
        if steady >= OUTSIDE:
            yield _note(
                f"The size of the innovations of {row['output']} changes, {of.format(steady)}.",
                "Gusts, faults or outliers: modes stay true, their deviations come out too small. Record, and"
                " identify with --uncertainty bootstrap.",
            )
