"""Check that streamed Markov parameters are taken only by an identification of the filter's own kind."""

from dataclasses import replace

import numpy as np
import pytest

from aeolid.errors import DataError
from aeolid.filters import filter_record, save_markov
from aeolid.identify.streamed import StreamedMarkov
from aeolid.identify.varmax import identify_varmax
from aeolid.identify.varx import identify_varx
from aeolid.plants.lti import simulate_fourth_order
from aeolid.record import Record

METHODS = {"varx": identify_varx, "varmax": identify_varmax}


def in_units(record: Record, name: str, unit: str) -> Record:
    return replace(record, channels=tuple(replace(c, unit=unit) if c.name == name else c for c in record.channels))


RECORD = in_units(simulate_fourth_order(1200, 3, feedback=0.25), "y2", "m")


def write(path, method="rls", past=6, feedthrough=(), **more):
    """Filter RECORD as `aeolid filter` does; `more` is written over what the file says."""
    with open(path, "wb") as handle:
        save_markov(handle, filter_record(RECORD, past=past, method=method, feedthrough=feedthrough), RECORD)
    if more:
        with np.load(path) as archive:
            arrays = dict(archive)
        np.savez(path, **(arrays | more))
    return StreamedMarkov.load(path)


def order_of(record: Record, *places: int) -> Record:
    return replace(record, values=record.values[:, places], channels=tuple(record.channels[i] for i in places))


@pytest.mark.parametrize("method, filtered", [("varx", "rls"), ("varx", "lattice"), ("varmax", "els")])
def test_what_fits_is_taken(tmp_path, method, filtered):
    markov = write(tmp_path / "m.npz", filtered, feedthrough=("u2",))
    result = METHODS[method]([RECORD], past=6, order=4, feedthrough=("u2",), markov=markov)
    width = markov.theta.shape[1]
    np.testing.assert_allclose(result.markov_parameters[:, : width - 1], markov.theta[:, :-1], rtol=1e-9, atol=1e-12)
    assert not result.markov.penalty.any() and result.settings.passes is None


@pytest.mark.parametrize(
    "record, method, options, words",
    [
        (RECORD, "varx", {"past": 9}, "past window of 6: --past 6"),
        (RECORD, "varmax", {"past": 6}, "VARX filter: --method varx"),
        # 4 blocks of [u; y; e] have as many columns as 6 of [u; y]: the size alone would not tell
        (RECORD, "varmax", {"past": 4}, "VARX filter: --method varx"),
        (RECORD, "varx", {"past": 6, "feedthrough": ("u1",)}, "feedthrough of no input: no --feedthrough"),
        (RECORD, "varx", {"past": 6, "decimation": 2}, "every 1 s, the identification every 2 s"),
        (order_of(RECORD, 1, 0, 2, 3), "varx", {"past": 6}, "channels were u1, u2, y1, y2, the recording's are u2, u1"),
        (order_of(RECORD, 0, 1, 3, 2), "varx", {"past": 6}, "roles file of the filter"),
        (order_of(RECORD, 0, 1, 2), "varx", {"past": 6}, "2 inputs and 2 outputs, the recording has 2 and 1"),
        (in_units(RECORD, "y2", "mm"), "varx", {"past": 6}, "'y2' was in m there and is in mm here"),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path, record, method, options, words):
    markov = write(tmp_path / "m.npz")
    with pytest.raises(DataError, match=words):
        METHODS[method]([record], order=2, markov=markov, **options)


def test_feedthrough_of_another_input_is_told(tmp_path):
    markov = write(tmp_path / "m.npz", feedthrough=("u2",))
    with pytest.raises(DataError, match="feedthrough of u2: --feedthrough u2"):
        identify_varx([RECORD], past=6, order=4, feedthrough=("u1",), markov=markov)


def test_names_that_a_bus_made_up_or_cut_are_no_conflict(tmp_path):
    long = [f"a channel with a long name, number {i}" for i in range(4)]  # the number is beyond what is sent
    channels = tuple(replace(c, name=n) for c, n in zip(RECORD.channels, long, strict=True))
    record, wired = replace(RECORD, channels=channels), {"sample_index": np.int64(1199)}
    cut = {"inputs": np.array([n[:32] for n in long[:2]]), "outputs": np.array([n[:32] for n in long[2:]])}
    for names in (cut, {}):
        markov = write(tmp_path / "m.npz", **wired, **names)
        assert identify_varx([record], past=6, order=4, markov=markov).order == 4
    with pytest.raises(DataError, match="channels were u1, u2, y1, y2"):  # names of its own, in another order
        identify_varx([order_of(RECORD, 1, 0, 2, 3)], past=6, order=4, markov=write(tmp_path / "m.npz", **wired))
    with pytest.raises(DataError, match="roles file"):  # a filter's file has the names of the roles
        identify_varx([record], past=6, order=4, markov=write(tmp_path / "m.npz"))


def test_innovations_are_those_of_the_recording_that_was_filtered(tmp_path):
    markov = write(tmp_path / "m.npz", "els")
    assert markov.innovation_of([RECORD]) is markov.innovation
    other = replace(RECORD, values=RECORD.values[::-1].copy(), sha256="of another file")
    assert markov.innovation_of([other]) is None and markov.innovation_of([RECORD, RECORD]) is None
    wild = markov.theta.copy()
    wild[0, -2] += 3.0  # the newest e of the first output: a zero far outside the circle
    with pytest.raises(DataError, match="identify the recording that was filtered"):
        identify_varmax([other], past=6, order=4, markov=replace(markov, theta=wild))


@pytest.mark.parametrize(
    "build",
    [
        lambda path: np.save(path, np.zeros((2, 24))),
        lambda path: path.with_name("m.npz.npy").write_bytes(b"PK\x05\x06"),
        lambda path: np.savez(path.with_name("m.npz.npy").open("wb"), theta=np.array([{}], dtype=object)),
        lambda path: np.savez(path.with_name("m.npz.npy").open("wb"), theta=np.array([["a"]])),
        lambda path: np.savez(
            path.with_name("m.npz.npy").open("wb"), theta=np.zeros((2, 24)), settings="{", inputs=["u"], outputs=["y"],
            input_units=[""], output_units=[""]
        ),
    ],
)  # fmt: skip
def test_files_that_hold_something_else_are_named(tmp_path, build):
    build(tmp_path / "m.npz")
    with pytest.raises(
        DataError,
        match=r"m\.npz\.npy: .*(not readable as NumPy archive|Markov parameters|no array|neither numbers nor text)",
    ):
        StreamedMarkov.load(tmp_path / "m.npz.npy")
