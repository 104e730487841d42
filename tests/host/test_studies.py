"""Run the studies in their shortest form: the commands work and say what they should."""

import json

from study_modules import load_study


def test_paper000_finds_seven_states_and_the_poles(tmp_path, capsys):
    study = load_study("paper000")
    assert study.main(["--runs", "2", "--json", str(tmp_path / "facts.json")]) == 0
    facts = json.loads((tmp_path / "facts.json").read_text())
    assert len(capsys.readouterr().out.splitlines()) == 3 + len(study.WINDOWS)
    for row in facts["rows"]:
        assert row["fall_7_8"] > 3 and set(row["orders_chosen"]) == {7}
        distance = row["pole_distance"]
        assert distance["integrator"] < 0.008 and distance["drive train"] < 0.004  # some three deviations of two runs
        assert max(distance["tower 1"], distance["tower 2"]) < 0.005
