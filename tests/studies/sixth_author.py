"""Ask the diagnosis for the physics that a sixth set of machines hides, and grade each answer.

    python tests/studies/sixth_author.py [--seed 0] [--only NAME …] [--out FOLDER] [--write-only]

What an engineer of controls or tests meets: turbines, floats, valves, arms, cars, lifts, batteries and kilns, none of
them a plant of the earlier sets. This set was written by one who has not seen the diagnosis: the model of a case lacks
one or two effects of the catalogue or physics that no entry has, the recording is at fault, or all is complete. The
equations stand in sixth_author_turbines.py, _towers.py, _machines.py, _vehicles.py, _processes.py, _pairs.py and
_nulls.py and are integrated by Runge-Kutta steps apart from the package. Declared values are 1 to 10 % off; masses and
inertias mostly stand, 0 to 3 % off, as off a drawing. Loggers round to 11 to 16 bits, have coloured noise and filters
against aliases, which are no truth of a case; most plants are driven by gusts that nobody records.

Where two effects are hidden, each of them is the truth. Cases are written, diagnosed and graded as those of
second_author.py; the table is printed and written as sixth_author.md and sixth_author.json. A value is asked for in
the units of the model. Seed 0 has the random streams of the first figures, any other fresh ones. Exit code 1 where an
answer is wrong, 2 where there is no case.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from second_author import Makers, run
from sixth_author_machines import MACHINES
from sixth_author_nulls import NULLS
from sixth_author_pairs import PAIRS
from sixth_author_processes import PROCESSES
from sixth_author_towers import TOWERS
from sixth_author_turbines import TURBINES
from sixth_author_vehicles import VEHICLES

SIXTH: Makers = TURBINES | TOWERS | MACHINES | VEHICLES | PROCESSES | PAIRS | NULLS


def main(arguments: list[str] | None = None) -> int:
    """Write, diagnose and grade the cases of this set."""
    return run(SIXTH, "sixth_author", __doc__, arguments)


if __name__ == "__main__":
    sys.exit(main())
