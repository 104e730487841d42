"""The study of other turbines: its runs and pairs fit together, decks are changed as the simulator reads them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from study_modules import load_study

study = load_study("other_turbines")
others = study.others
decks = others.decks
crossings = others.crossings


@pytest.mark.parametrize("of", crossings.SETS)
def test_every_pair_has_its_runs_and_a_known_truth(of: str) -> None:
    runs = {name for _, name, _ in others.all_runs(of)}
    pairs = others.all_pairs(of)
    made = {"first": 24, "crossed": 24, "field": 18, "third": 14, "sea": 14, "floating": 12}[of]
    assert len(runs) == len({p.name for _, p in pairs}) == len(pairs) == made
    assert len({c.seed for _, _, c in others.all_runs(of)}) == made
    for turbine, pair in pairs:
        assert {pair.recording, pair.simulation} <= runs
        assert pair.recording != pair.simulation
        assert int(pair.wind[1:]) in decks.DECKS[turbine].pitch_deg
        assert (pair.effect == "null") == (not pair.families)
    effects = {c.effect for made in crossings.SETS[of].values() for c in made}
    assert effects <= {*others._KNOWN, *others._OUTSIDE}


def test_no_two_sets_make_different_runs_of_one_name() -> None:
    made: dict[str, object] = {}
    for of in crossings.SETS:
        for _, name, change in others.all_runs(of):
            assert made.setdefault(name, change) == change


def test_what_the_simulation_lacks_is_on_its_side() -> None:
    sides = {p.name: (p.recording, p.simulation) for of in ("first", "field") for _, p in others.all_pairs(of)}
    assert sides["iea15-mode_tower"] == ("iea15-n1", "iea15-mode_tower")
    assert sides["iea15-lag"] == ("iea15-lag", "iea15-n1")
    assert sides["iea15-mode_tower-f14"] == ("iea15-n1-f14", "iea15-mode_tower-f14")


SECTIONS = """a blade
5   NumBlNds - nodes
  BlSpn  BlChord
  (m)    (m)
0 1.0
1 1.1
2 1.2
3 1.3
4 1.4
end
"""
OUTPUTS = """1 Something
  OutList - the next lines
"Old1"
"Old2"
END of input file
"Nodal"
"""


def test_lines_of_a_newer_simulator_are_written_once(tmp_path: Path) -> None:
    sea = tmp_path / "sea.dat"
    sea.write_text("2  WaveMod - kind\n0  WaveStMod  - stretching\n900 WaveTMax - s\n")
    for _ in range(2):
        decks._insert(str(sea), "WaveStMod", "0 WvCrntMod")
    assert [line.split()[1] for line in sea.read_text().splitlines()] == [
        "WaveMod",
        "WaveStMod",
        "WvCrntMod",
        "WaveTMax",
    ]


def test_every_run_at_sea_has_waves_of_its_own() -> None:
    seeds = [
        others._waves({"sea": "sea.dat"}, c.seed)[0] for of in ("sea", "floating") for *_, c in others.all_runs(of)
    ]
    assert len({value for _, _, value in seeds}) == len(seeds) == 26
    assert others._waves({"main": "x.fst"}, 5) == []


def test_sections_are_halved_and_outputs_replaced(tmp_path: Path) -> None:
    sections, outputs = tmp_path / "sections.dat", tmp_path / "outputs.dat"
    sections.write_text(SECTIONS)
    outputs.write_text(OUTPUTS)
    decks._thin(str(sections))
    lines = sections.read_text().splitlines()
    assert lines[1] == "3 NumBlNds"
    assert lines[4:7] == ["0 1.0", "2 1.2", "4 1.4"]
    assert lines[7] == "end"
    decks._outputs(str(outputs), ("GenSpeed",))
    assert re.findall(r'"(\w+)"', outputs.read_text()) == ["GenSpeed", "Nodal"]


@pytest.mark.parametrize("key", ["BldFile(2)", "BldFile2"])
def test_one_blade_is_made_heavier(tmp_path: Path, key: str) -> None:
    """Both ways in which decks name a blade's file."""
    blade, elastic = tmp_path / "blade.dat", tmp_path / "elastic.dat"
    blade.write_text("  1.05  AdjBlMs - factor\n")
    elastic.write_text(f'"blade.dat" BldFile(1) - first\n"blade.dat"   {key} - second\n')

    def change(file: str, name: str, value: object) -> None:
        path = Path(file)
        path.write_text(re.sub(rf"\S+(\s+{name}\b)", rf"{value}\1", path.read_text()))

    files = {"main": str(tmp_path / "x.fst"), "blade": str(blade), "elastic": str(elastic)}
    decks.heavier(decks.DECKS["iea15"], files, 1.02, change)
    assert float((tmp_path / "blade_2.dat").read_text().split()[0]) == pytest.approx(1.02 * 1.05)
    first, second = elastic.read_text().splitlines()
    assert first.startswith('"blade.dat"') and second.startswith('"blade_2.dat"')
    blade.write_text("no such factor\n")
    with pytest.raises(ValueError, match="AdjBlMs"):
        decks.heavier(decks.DECKS["iea15"], files, 1.02, change)


def test_the_second_blade_is_twisted(tmp_path: Path) -> None:
    sections, aero = tmp_path / "sections.dat", tmp_path / "aero.dat"
    sections.write_text("3 NumBlNds\n BlSpn BlTwist\n (m) (deg)\n 0 20\n 5 1.5e1\n 9 -1\nend\n")
    aero.write_text('"a.dat" ADBlFile(1) - first\n"a.dat" ADBlFile(2) - second\n')
    files = {"main": str(tmp_path / "x.fst"), "sections": str(sections), "aero": str(aero)}
    decks.twisted(files, 0.5)
    rows = (tmp_path / "sections_2.dat").read_text().splitlines()
    assert [[float(x) for x in r.split()] for r in rows[3:6]] == [[0, 20.5], [5, 15.5], [9, -0.5]]
    assert rows[6] == "end" and "20.5" not in sections.read_text()
    assert [line.split()[0] for line in aero.read_text().splitlines()] == ['"a.dat"', '"sections_2.dat"']


def test_it_says_what_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert study.main(["make", str(tmp_path), "--simulator", str(tmp_path)]) == 2
    assert study.main(["score", str(tmp_path)]) == 2
    assert "no such file" in (said := capsys.readouterr().err)
    assert "make some first" in said
