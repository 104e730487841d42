"""From a hypothesis to numbers: starts, fits, early stops, admissibility, negative control."""
