"""A declared value of a law without memory is held against the scatter of the recordings, fold by fold."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter
from small_cases import write_case

from aeolid.diagnose.conclusion.static_law import static_law, with_static_law
from aeolid.diagnose.data.case import Case, load_case

Array = NDArray[np.float64]
LAW = """[model]
name = "torque over speed"
time = "continuous"
[parameters]
K = {{ value = {value}, min = 1e-4, max = 1e-3, unit = "N m/rpm^2", free = false }}
[[input]]
name = "speed"
unit = "rpm"
[[output]]
name = "torque"
equation = "K*speed**2"
unit = "N m"
"""
CHANNELS = (("speed", "rpm", "input"), ("torque", "N m", "output"))
TRUE = 3.7e-4


def slow(rng: np.random.Generator, samples: int, keep: float) -> Array:
    """Return noise of spread 1 that forgets by `keep` a sample."""
    noise = lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.standard_normal(samples))
    return np.asarray(noise)


def write(folder: Path, seed: int, *, declared: float, limited: bool = False, noise: float = 0.02) -> Case:
    """Record a turbine's torque over its speed: 6000 samples, slow errors, and a limit above 1,100 rpm if asked for."""
    rng = np.random.default_rng(seed)
    speed = 900 + 150 * slow(rng, 6000, 0.998)
    torque = TRUE * speed**2
    if limited:
        torque = np.where(speed > 1100, TRUE * 1100**2 * 1.15, torque)  # another law rules there
    torque = torque + noise * torque.std() * (slow(rng, 6000, 0.99) + rng.standard_normal(6000))
    return load_case(write_case(folder, LAW.format(value=declared), 0.1, CHANNELS, np.column_stack([speed, torque])))


@pytest.mark.parametrize("limited", [False, True])
def test_a_wrong_constant_is_found_also_where_another_law_rules_in_a_region(limited: bool, tmp_path: Path) -> None:
    """Within 1 %: the loss leaves a region out in which the errors are large; squares would be bent by it."""
    for seed in range(3):
        folder = tmp_path / str(seed)
        folder.mkdir()
        law = static_law(write(folder, seed, declared=4.4e-4, limited=limited), 1)
        assert law is not None
        (parameter, value, deviation), *others = law.moved
        assert parameter.name == "K" and not others and value == pytest.approx(TRUE, rel=0.01)
        assert deviation < 0.02 * TRUE and law.interval[0] > 2 and law.after["torque"] < 0.5 * law.before["torque"]
        assert law.model.parameters[0].value == value


def test_a_right_constant_is_not_accused(tmp_path: Path) -> None:
    """As it is, one per cent off, with a region of another law, and with errors as large as the signal."""
    for seed in range(8):
        for name, declared, limited, noise in (("a", TRUE, True, 0.02), ("b", 1.01 * TRUE, False, 0.05),
                                               ("c", TRUE, False, 1.0)):  # fmt: skip
            folder = tmp_path / f"{name}{seed}"
            folder.mkdir()
            assert static_law(write(folder, 20 + seed, declared=declared, limited=limited, noise=noise), 1) is None


@pytest.mark.parametrize(("share", "accused"), [(0.08, False), (0.4, True)])
def test_a_value_that_hardly_matters_is_not_accused(share: float, accused: bool, tmp_path: Path) -> None:
    """Friction that is 20 % off: of the torque's spread its error is 1.3 % or 6 %, where up to 2 % is good enough."""
    rng = np.random.default_rng(5)
    speed = 100 * slow(rng, 6000, 0.99)
    spread = float(np.std(TRUE * speed**2))
    torque = TRUE * speed**2 + share * spread / 100 * speed + 2e-3 * spread * rng.standard_normal(6000)
    c = 1.2 * share * spread / 100
    law = LAW.format(value=TRUE).replace("[[input]]", f"c = {{ value = {c}, min = 0.0, max = 10.0 }}\n[[input]]", 1)
    law = law.replace("K*speed**2", "K*speed**2 + c*speed")
    case = load_case(write_case(tmp_path, law, 0.1, CHANNELS, np.column_stack([speed, torque])))
    assert (static_law(case, 1) is not None) is accused


def test_a_law_that_is_not_right_accuses_no_value(tmp_path: Path) -> None:
    """Torque that follows another signal: the best constant would still miss most of it, or end at its limit."""
    case = write(tmp_path, 3, declared=4.4e-4)
    record = case.records[0]
    values = record.values.copy()
    values[:, 1] = 300 + 60 * slow(np.random.default_rng(1), len(values), 0.998)
    for changed in (values, values * [1.0, -1.0]):
        assert static_law(replace(case, records=(replace(record, values=changed),)), 1) is None


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("ranged", [False, True], ids=["constants are held", "constants have ranges"])
def test_beside_constants_of_the_same_product_the_value_itself_is_told(
    free: bool, ranged: bool, tmp_path: Path
) -> None:
    """Of half rho K only the product is seen: what has no range is not refitted, and one value of a product is."""
    ends = ", min = 0.01, max = 10.0" if ranged else ""
    law = LAW.format(value=7e-4 / (0.5 * 1.225)).replace("max = 1e-3", "max = 1e-2")
    law = law.replace("free = false", f"free = {str(free).lower()}")
    law = law.replace("[[input]]", f"half = {{ value = 0.5{ends} }}\nrho = {{ value = 1.225{ends} }}\n[[input]]", 1)
    law = law.replace("K*speed**2", "half*rho*K*speed**2")
    values = write(tmp_path, 3, declared=4.4e-4).records[0].values
    law_of_product = static_law(load_case(write_case(tmp_path, law, 0.1, CHANNELS, values)), 1)
    assert law_of_product is not None
    ((parameter, value, deviation),) = law_of_product.moved
    assert parameter.name == "K" and value == pytest.approx(TRUE / (0.5 * 1.225), rel=0.01) and deviation < 0.02 * value


def test_the_answer_says_values_and_how_they_were_proven(tmp_path: Path) -> None:
    law = static_law(write(tmp_path, 5, declared=4.4e-4), 1)
    assert law is not None
    said = with_static_law({"verdict": "no_mismatch", "effects": [], "sealed": {}, "statement": ""}, law)
    assert said["verdict"] == "parameter" and said["effects"][0]["id"] == "parameter_error"
    assert said["effects"][0]["parameters"]["K"]["value"] == law.moved[0][1]
    assert said["sealed"]["log_likelihood_gain"] == law.gain and "part 5" in said["sealed"]["data"]
