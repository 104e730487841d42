"""What a diagnosis is asked with is taken as it is given, or refused before anything is fitted."""

from pathlib import Path

import numpy as np
import pytest
from small_cases import SWING, SWING_CHANNELS, SWING_STEP, write_case

import aeolid as ae
from aeolid.diagnose.data.case import CONTEXT, KINDS, load_case
from aeolid.diagnose.data.machine import blades_of
from aeolid.errors import DataError, UsageError
from aeolid.models import equations_file
from aeolid.plants.lti import fourth_order, simulate_fourth_order
from aeolid.record import Channel, Record


def test_a_seed_below_zero_is_refused_before_anything_is_read() -> None:
    record = Record(np.arange(3.0), np.zeros((3, 1)), (Channel("u", "", "input"),), 1.0, "a.csv", "")
    with pytest.raises(UsageError, match="seed = -1 is below 0"):
        ae.diagnose(record, None, seed=-1)


@pytest.mark.parametrize("blades", range(1, 10))
def test_as_many_blades_count_as_a_case_may_have(blades: int) -> None:
    assert CONTEXT["blades"][0](blades) and blades_of({"blades": blades}) == blades
    assert not CONTEXT["blades"][0](10)


def _swing(folder: Path, kind: str, same_inputs: str) -> Path:
    """Write a case whose baseline is called this kind, with same_inputs; the file is one of equations."""
    write_case(folder, SWING, SWING_STEP, SWING_CHANNELS, np.random.default_rng(1).standard_normal((400, 3)))
    text = (folder / "case.toml").read_text()
    (folder / "case.toml").write_text(
        text.replace('kind = "equations"', f'kind = "{kind}"\nsame_inputs = {same_inputs}')
    )
    return folder


@pytest.mark.parametrize("kind", [k for k in KINDS if k != "run"])
def test_same_inputs_says_nothing_of_a_model_and_is_refused(tmp_path: Path, kind: str) -> None:
    with pytest.raises(DataError, match=r"case\.toml \[baseline\]: same_inputs = true .* for a run only"):
        load_case(_swing(tmp_path, kind, "true"), allow_fmu=True)


def test_same_inputs_that_is_false_goes_with_every_kind(tmp_path: Path) -> None:
    assert not load_case(_swing(tmp_path, "equations", "false")).same_inputs


def test_python_refuses_it_for_models_too(tmp_path: Path) -> None:
    model = equations_file.load(_swing(tmp_path, "equations", "false") / "model.toml")
    record = simulate_fourth_order(400, 1)
    for baseline in (model, fourth_order()):
        with pytest.raises(UsageError, match=r"same_inputs = true .* for a run only"):
            ae.diagnose(record, baseline, same_inputs=True, sham=0, progress=False)
