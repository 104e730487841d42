"""Write files: everything that leaves a command goes through here.

A file appears whole under its name or not at all, never through a link, and takes the place of another only where the
same command wrote that one, or where it was told to.
"""

from aeolid.output.call import declare, finished, free_number, note_input, numbered
from aeolid.output.writing import (
    adopt,
    create,
    discard,
    make_folder,
    private_path,
    record_written,
    remove_unfinished,
    replacing,
    write_json,
    write_text,
)

__all__ = [
    "adopt",
    "create",
    "declare",
    "discard",
    "finished",
    "free_number",
    "make_folder",
    "note_input",
    "numbered",
    "private_path",
    "record_written",
    "remove_unfinished",
    "replacing",
    "write_json",
    "write_text",
]
