"""Write self-contained HTML pages: one for an identification, one for a diagnosis, one for both.

The figures are drawn once, as SVG inside the page: nothing is fetched, no script runs, and paper shows what the screen
shows. Plotly's script alone would add 4.8 MB to every page; a whole page of these is a few hundred kB.
"""

from aeolid.report.diagnosis import render_diagnosis
from aeolid.report.facts import identification_facts
from aeolid.report.identification import render_identification
from aeolid.report.joint import render_demo

__all__ = ["identification_facts", "render_demo", "render_diagnosis", "render_identification"]
