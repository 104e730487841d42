"""Ask the diagnosis for the physics that a ninth set of machines hides, and grade each answer.

    python tests/studies/ninth_author.py [--seed 0] [--only NAME …] [--out FOLDER] [--write-only]

What an engineer for controls and loads of another company would hand over: turbines of 50 kW with two blades that
teeter, of 2 MW with gearbox, pitch or active stall, of 12 MW afloat and of 15 MW without gearbox, in their loops, in
turbulence after Kaimal and in gusts, as their controllers log them; and rigs from laboratory and industry. This set
was written by one who has not seen the diagnosis. Of 36 cases eight are complete, eighteen have equations as their
baseline, nine a linear model and nine a simulator's run, of other wind or with the same inputs. Six hide two effects,
each of which is the truth. The equations stand in the modules ninth_author_*.py and are integrated by Runge-Kutta steps
apart from the package. Declared values are 1 to 5 % off, those of complete models up to 3 %.

Cases are written, diagnosed and graded as those of second_author.py; the table is printed and written as
ninth_author.md and ninth_author.json. A value is asked for in the units of the model. Seed 0 has the random streams of
the first figures, any other fresh ones. Exit code 1 where an answer is wrong, 2 where there is no case.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import second_author
from ninth_author_axes import AXIS_MAKERS
from ninth_author_floating import FLOATING_MAKERS
from ninth_author_geared import GEARED_MAKERS
from ninth_author_large import LARGE_MAKERS
from ninth_author_motion import MOTION_MAKERS
from ninth_author_nulls import NULL_MAKERS
from ninth_author_parts import write_any
from ninth_author_process import PROCESS_MAKERS
from ninth_author_small import SMALL_MAKERS
from ninth_author_structures import STRUCTURE_MAKERS
from second_author import Makers

TURBINES: Makers = GEARED_MAKERS | LARGE_MAKERS | FLOATING_MAKERS | SMALL_MAKERS
RIGS: Makers = MOTION_MAKERS | PROCESS_MAKERS | STRUCTURE_MAKERS | AXIS_MAKERS
NINTH: Makers = {**TURBINES, **RIGS, **NULL_MAKERS}


def main(arguments: list[str] | None = None) -> int:
    """Write, diagnose and grade the cases of this set; cases with runs have a way of their own to be written."""
    second_author.write = write_any
    return second_author.run(NINTH, "ninth_author", __doc__, arguments)


if __name__ == "__main__":
    sys.exit(main())
