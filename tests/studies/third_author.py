"""Ask the diagnosis for the physics that a third set of machines hides, and grade each answer.

    python tests/studies/third_author.py [--seed 0] [--only NAME …] [--out FOLDER] [--write-only]

Vehicles, drives, converters, processes, heat and turbines, many after public benchmarks. This is the third independent
set: it was written without regard to what the diagnosis is good at, and after the diagnosis had been changed for the
second. The model of a case lacks an effect of the catalogue or physics that no entry has, the recording is at fault, or
all is complete. The equations stand in third_author_machines.py, _electric.py, _processes.py, _turbines.py and
_nulls.py and are integrated by Runge-Kutta steps of their own, apart from the package. Declared values are 2 to 10 %
off. What no entry has may have further fair verdicts, a fault of the data among them, and an encoder that is coarser
than its noise may be named beside the effect.

Cases are written, diagnosed and graded as those of second_author.py; the table is printed and written as
third_author.md and third_author.json. A value is asked for in the units of the model: the suspension of speaker_spider
pulls with k3 in mN/m^3, as the model divides by a mass in grams. Seed 0 has the random streams of the first figures,
any other fresh ones. Exit code 1 where an answer is wrong, 2 where there is no case.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from second_author import Makers, run
from third_author_electric import ELECTRIC
from third_author_machines import MACHINES
from third_author_nulls import NULLS
from third_author_processes import PROCESSES
from third_author_turbines import TURBINES

THIRD: Makers = TURBINES | MACHINES | ELECTRIC | PROCESSES | NULLS


def main(arguments: list[str] | None = None) -> int:
    """Write, diagnose and grade the cases of this set."""
    return run(THIRD, "third_author", __doc__, arguments)


if __name__ == "__main__":
    sys.exit(main())
