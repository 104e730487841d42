"""What a diagnosis is asked with is taken as it is given, or refused before anything is fitted."""

import numpy as np
import pytest

import aeolid as ae
from aeolid.diagnose.data.case import CONTEXT
from aeolid.diagnose.data.machine import blades_of
from aeolid.errors import UsageError
from aeolid.record import Channel, Record


def test_a_seed_below_zero_is_refused_before_anything_is_read() -> None:
    record = Record(np.arange(3.0), np.zeros((3, 1)), (Channel("u", "", "input"),), 1.0, "a.csv", "")
    with pytest.raises(UsageError, match="seed = -1 is below 0"):
        ae.diagnose(record, None, seed=-1)


@pytest.mark.parametrize("blades", range(1, 10))
def test_as_many_blades_count_as_a_case_may_have(blades: int) -> None:
    assert CONTEXT["blades"][0](blades) and blades_of({"blades": blades}) == blades
    assert not CONTEXT["blades"][0](10)
