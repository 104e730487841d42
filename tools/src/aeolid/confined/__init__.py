"""Run one function of this package in a process of its own, with limits, and take arrays and text back from it.

For readers of other parties' formats, which a damaged or crafted file can crash, send round in circles, fill the memory
with or take over. The child has bounds on memory, processor time, file size and descriptors, imports nothing from the
current folder, inherits no descriptor, writes to no terminal, and on Linux (x86-64, arm64) can start no program and,
unless allowed, open no connection and no file for writing. What it sends back is checked like a file from outside.
"""

from aeolid.confined.channel import Reply
from aeolid.confined.limits import Limits
from aeolid.confined.parent import Failure, Running, call, start

__all__ = ["Failure", "Limits", "Reply", "Running", "call", "start"]
