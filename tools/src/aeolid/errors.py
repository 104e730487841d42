"""Name every failure a user can meet, with its exit code."""


class AeolidError(Exception):
    """Base of all errors that end in one sentence for the user; `exit_code` as in the command-line contract."""

    exit_code = 3


class UsageError(AeolidError):
    """The request itself is wrong: an option, a combination, a value out of range."""

    exit_code = 2


class DataError(AeolidError):
    """A file or stream is unreadable or inconsistent; the text names file, channel and sample, and the remedy."""

    exit_code = 3


class Contradiction(DataError):
    """Two files say different things of one channel; the text names the channel, both statements and the remedy."""


class UnevenClock(DataError):
    """The samples run forward in time but lie on no uniform clock; resampling brings them to one."""


class OpenUnit(DataError):
    """A column's numbers do not tell the unit of time that they are in; the text says what to state."""


class NotIdentifiable(AeolidError):
    """The data do not carry the answer; the text says which condition failed, what was found, what is needed."""

    exit_code = 4
