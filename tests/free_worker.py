"""Give tests to whichever worker is free, and go on after a worker has died.

With pytest-xdist 3.8's distribution by scopes a worker that dies stops the whole run: the test that killed it is begun
again and kills the next, and the worker that replaces it gets one test and waits for a second before it begins.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

from xdist.scheduler import LoadScopeScheduling

PREPARED = re.compile(r'scope="(module|session)"|^@cache$', re.M)  # a file's tests share what was prepared once
AHEAD = 2  # tests a worker has waiting: it begins one when it knows the next


@cache
def stays_together(file: str) -> bool:
    """Tell whether the tests of a file share fixtures or a cache, so that one worker should run them all."""
    return bool(PREPARED.search(Path(file).read_text(encoding="utf-8")))


class FreeWorker(LoadScopeScheduling):  # type: ignore[misc]
    """Hand out tests alone, or a file at a time where its tests share what they prepare, in the order collected."""

    def _split_scope(self, nodeid: str) -> str:
        file: str = nodeid.split("::", 1)[0]
        return file if stays_together(str(self.config.rootpath / file)) else nodeid

    def _reschedule(self, node: Any) -> None:
        """Give a worker units of work until it has some waiting; where there are none left, let it end.

        Not one that has not said yet which tests it knows: it is asked again once it has.
        """
        if node not in self.registered_collections:
            return
        while not node.shutting_down and (not self.workqueue or self._pending_of(self.assigned_work[node]) <= AHEAD):
            try:
                super()._reschedule(node)
            except OSError:  # it has died; what it was given is taken back when that is heard
                return

    def remove_node(self, node: Any) -> str | None:
        """Forget a worker; one that died leaves the test it ran as done (told as failed) and the rest to the others."""
        workload = self.assigned_work.pop(node)
        died_in: str | None = None
        for unit in workload.values():
            for nodeid, done in unit.items():
                if died_in is None and not done:
                    died_in, unit[nodeid] = nodeid, True
        for scope, unit in reversed(workload.items()):
            if not all(unit.values()):
                self.workqueue[scope] = unit
                self.workqueue.move_to_end(scope, last=False)
        if died_in is not None:
            for other in self.assigned_work:
                self._reschedule(other)
        return died_in
