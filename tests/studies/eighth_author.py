"""Ask the diagnosis for the physics that an eighth set of machines hides, and grade each answer.

    python tests/studies/eighth_author.py [--seed 0] [--only NAME …] [--out FOLDER] [--write-only]

The rigs behind public recordings that control engineers use as benchmarks and exercises, made again with equations and
numbers of their own: hair dryers, exchangers, furnaces, tanks, belts, balls on beams, throttles, pendulums, structures,
cells, generators and turbines, with the lengths, converters, noise and excitation of such recordings; none is a plant
of the earlier sets. This set was written by one who has not seen the diagnosis: the model of a case lacks one or two
effects of the catalogue or physics that no entry has, the recording is at fault, or all is complete. The equations
stand in eighth_author_heat.py, _motion.py, _vibration.py, _plants.py, _turbines.py and _nulls.py and are integrated by
Runge-Kutta steps apart from the package. Declared values are 1 to 8 % off; masses and inertias mostly stand, 0 to 3 %
off; linear models have gains, lags, frequencies and dampings that are 0 to 8 % off. Most plants are driven by small
disturbances that nobody records.

Where two effects are hidden, each of them is the truth. Cases are written, diagnosed and graded as those of
second_author.py; the table is printed and written as eighth_author.md and eighth_author.json. A value is asked for in
the units of the model. Seed 0 has the random streams of the first figures, any other fresh ones. Exit code 1 where an
answer is wrong, 2 where there is no case.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from eighth_author_heat import HEAT
from eighth_author_motion import MOTION
from eighth_author_nulls import NULLS
from eighth_author_plants import PLANTS
from eighth_author_turbines import TURBINES
from eighth_author_vibration import VIBRATION
from second_author import Makers, run

EIGHTH: Makers = HEAT | MOTION | VIBRATION | PLANTS | TURBINES | NULLS


def main(arguments: list[str] | None = None) -> int:
    """Write, diagnose and grade the cases of this set."""
    return run(EIGHTH, "eighth_author", __doc__, arguments)


if __name__ == "__main__":
    sys.exit(main())
