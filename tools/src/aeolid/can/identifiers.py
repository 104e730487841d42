"""Say whose an identifier is on a bus with CANopen, J1939 or NMEA 2000 devices, and which bases disturb none of them.

Sources: CiA 301 4.2, tables of the generic pre-defined connection set and of restricted CAN-IDs; CiA 305 (LSS); SAE
J1939-21, parameter groups; NMEA 2000 main document, appendix B, ranges of parameter groups. A node that sends where a
device of another protocol listens writes to that device: 0x600 is where CANopen devices take their settings from.
"""

from __future__ import annotations

from dataclasses import dataclass

from aeolid.can.wire import STANDARD_LAYOUT, choose_layout, identifiers_of
from aeolid.errors import UsageError


@dataclass(frozen=True)
class Use:
    """Name what a range of identifiers, or of parameter groups, is for: first and last are in it."""

    first: int
    last: int
    what: str


CANOPEN = (  # identifiers of 11 bits
    Use(0x000, 0x000, "NMT commands"),
    Use(0x001, 0x07F, "reserved by CiA 301"),
    Use(0x080, 0x080, "SYNC"),
    Use(0x081, 0x0FF, "EMCY"),
    Use(0x100, 0x100, "TIME"),
    Use(0x101, 0x180, "reserved by CiA 301"),
    Use(0x181, 0x1FF, "TPDO 1"),
    Use(0x201, 0x27F, "RPDO 1"),
    Use(0x281, 0x2FF, "TPDO 2"),
    Use(0x301, 0x37F, "RPDO 2"),
    Use(0x381, 0x3FF, "TPDO 3"),
    Use(0x401, 0x47F, "RPDO 3"),
    Use(0x481, 0x4FF, "TPDO 4"),
    Use(0x501, 0x57F, "RPDO 4"),
    Use(0x581, 0x5FF, "SDO answers"),
    Use(0x601, 0x67F, "SDO requests"),
    Use(0x6E0, 0x6FF, "reserved by CiA 301"),
    Use(0x701, 0x77F, "NMT error control (heartbeats)"),
    Use(0x780, 0x7FF, "reserved by CiA 301, 0x7E4 and 0x7E5 LSS"),
)
J1939 = (  # parameter groups, 18 bits: extended data page, data page, PDU format, group extension
    Use(0x00000, 0x0EEFF, "groups that SAE assigns, to one device"),
    Use(0x0EF00, 0x0EFFF, "proprietary A, to one device"),
    Use(0x0F000, 0x0FEFF, "groups that SAE assigns"),
    Use(0x10000, 0x1EEFF, "groups that SAE assigns, to one device"),
    Use(0x1EF00, 0x1EFFF, "proprietary A2, to one device"),
    Use(0x1F000, 0x1FFFF, "groups that SAE and NMEA assign"),
    Use(0x20000, 0x2FFFF, "reserved by SAE"),
    Use(0x30000, 0x3FFFF, "ISO 15765-3, diagnostics"),
)
PROPRIETARY_B = Use(0x0FF00, 0x0FFFF, "proprietary B: open to anybody whose source address is claimed")
NMEA_2000 = (  # parameter groups
    Use(0x0E800, 0x0EEFF, "ISO 11783 acknowledgement, request, transport, address claim"),
    Use(0x0EF00, 0x0EFFF, "proprietary, to one device, with the maker's code"),
    Use(0x0F000, 0x0FEFF, "ISO 11783 groups, commanded address"),
    Use(0x1ED00, 0x1EEFF, "group functions"),
    Use(0x1EF00, 0x1EFFF, "proprietary fast packets, to one device, with the maker's code"),
    Use(0x1F000, 0x1FEFF, "groups that NMEA assigns"),
    Use(0x1FF00, 0x1FFFF, "proprietary fast packets with the maker's code"),
)


def group_of(identifier: int) -> int:
    """Return the parameter group, 18 bits, of an identifier of 29 bits; below format 240 without the destination."""
    group = identifier >> 8 & 0x3FFFF
    return group if group >> 8 & 0xFF >= 0xF0 else group & 0x3FF00


def users_of(identifier: int, extended: bool) -> list[str]:
    """Return what else an identifier is used for by CANopen (11 bits), or by J1939 or NMEA 2000 (29 bits)."""
    if not extended:
        return [f"CANopen: {use.what}" for use in CANOPEN if use.first <= identifier <= use.last]
    group = group_of(identifier)
    return [
        f"{protocol}: {use.what}"
        for protocol, uses in (("J1939", J1939), ("NMEA 2000", NMEA_2000))
        for use in uses
        if use.first <= group <= use.last
    ]


def check_free(base: int) -> None:
    """Raise UsageError, which says what they are for, where nodes above a base would send on identifiers of others."""
    extended = base >= STANDARD_LAYOUT.limit
    every = choose_layout(base).nodes if extended else 1  # a source address is no part of the group
    met = dict.fromkeys(user for i in identifiers_of(base)[::every] for user in users_of(i, extended))
    if met:
        free = "0x1CFF0000 to 0x1CFFE000 in steps of 0x2000" if extended else "0x680"
        raise UsageError(
            f"--base {base:#x}: its identifiers are in use on other buses ({'; '.join(met)}); {free} disturbs nobody,"
            " and --force-base takes it on a bus without such devices"
        )
