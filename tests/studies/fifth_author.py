"""Ask the diagnosis for the physics that a fifth set of machines hides, and grade each answer.

    python tests/studies/fifth_author.py [--seed 0] [--only NAME …] [--out FOLDER] [--write-only]

Turbines, springs, vehicles, water, climate and drives, none of them a plant of the earlier sets, and with a preference
for entries of the catalogue that those hide seldom or never. This set was written by one who has not seen the
diagnosis: the model of a case lacks one or two effects of the catalogue or physics that no entry has, the recording is
at fault, or all is complete. The equations stand in fifth_author_towers.py, _rotors.py, _machines.py, _processes.py,
_pairs.py and _nulls.py and are integrated by Runge-Kutta steps apart from the package. Declared values are 1 to 10 %
off. Loggers round to 12 to 16 bits, have coloured noise and filters against aliases of half a sample, which are no
truth of a case; most plants are driven by gusts that nobody records.

Where two effects are hidden, each of them is the truth. Cases are written, diagnosed and graded as those of
second_author.py; the table is printed and written as fifth_author.md and fifth_author.json. A value is asked for in
the units of the model. Seed 0 has the random streams of the first figures, any other fresh ones. Exit code 1 where an
answer is wrong, 2 where there is no case.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from fifth_author_machines import MACHINES
from fifth_author_nulls import NULLS
from fifth_author_pairs import PAIRS
from fifth_author_processes import PROCESSES
from fifth_author_rotors import ROTORS
from fifth_author_towers import TOWERS
from second_author import Makers, run

FIFTH: Makers = TOWERS | ROTORS | MACHINES | PROCESSES | PAIRS | NULLS


def main(arguments: list[str] | None = None) -> int:
    """Write, diagnose and grade the cases of this set."""
    return run(FIFTH, "fifth_author", __doc__, arguments)


if __name__ == "__main__":
    sys.exit(main())
