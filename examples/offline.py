"""From two recordings to a model, its modes and a picture, in Python: python examples/offline.py [FOLDER].

The cells (# %%) run one after the other in editors that know them, or all at once as a script.
"""

# ruff: noqa: E402 - a cell imports what it needs

# %% Recordings to work on; put your own here, with a roles file that says what their columns are
import sys
from pathlib import Path

from aeolid.plants.examples import write_examples

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "tryout")
write_examples(folder)

# %% Read them: a record knows its channels, units and roles, and where it came from
from aeolid.formats import read_record
from aeolid.record import Roles

roles = Roles.load(folder / "roles.toml")
monday = read_record(folder / "monday.csv", roles)
tuesday = read_record(folder / "tuesday.csv", roles)
print(f"{monday.source}: {len(monday)} samples of {', '.join(c.name for c in monday.channels)}")

# %% Identify: several recordings are one experiment set
from aeolid.identify.varx import identify_varx

found = identify_varx([monday], past=30)
print(found.summary())

# %% Hold the model against the day it has not seen
from aeolid.identify.validation import validate_model
from aeolid.models.load import LinearModel

verdict = validate_model(LinearModel(found.model), tuesday, (10, 50))
print(verdict.summary())

# %% The response from pitch to the tower
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from aeolid.identify.frequency import default_frequencies, frequency_response

frequencies = default_frequencies(found.model)
response = frequency_response(found.model, frequencies)
names = [s.name for s in found.model.outputs]
gain = np.abs(response.response[:, names.index("tower_fore_aft"), 0])
figure, axes = plt.subplots(figsize=(7, 3.5), layout="constrained")
axes.loglog(frequencies, gain)
axes.set(xlabel="frequency in Hz", ylabel="m/s per deg", title="pitch to tower_fore_aft")
figure.savefig(folder / "response.svg")
print(f"picture: {folder / 'response.svg'}")

# %% Keep the model: aeolid simulate, validate, diagnose and convert read it
import json

(folder / "model.json").write_text(json.dumps(found.model.to_json(), indent=1), encoding="utf-8")
