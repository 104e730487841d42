"""Read recordings from the files engineers have, and write tables."""

from aeolid.formats.recording import read_chosen, read_record, read_table
from aeolid.formats.table import Table
from aeolid.formats.writing import write_table

__all__ = ["Table", "read_chosen", "read_record", "read_table", "write_table"]
