"""Read linearisations as each release of FAST and OpenFAST writes them.

`lin_file` writes by the format statements of the releases: tables at a tab stop 14 + 3 width + 7 columns from the left,
rows (3x, I8, 3x, number, …), orientations as three numbers of a row of the rotation matrix, matrices as 1x and numbers.
"""

import json
import re

import numpy as np
import pytest

from aeolid.cli.main import main
from aeolid.errors import DataError
from aeolid.models.exchange.openfast import read_lin

FORMS = {"8.16": ("E10.3E2", 0), "2.3": ("E15.8E2", 1), "2.4": ("E16.9E2", 2), "3.5": ("E20.12E3", 2),
         "5": ("E24.15E3", 2)}  # fmt: skip
FLAP = "1st flapwise bending-mode DOF of blade 1 (internal DOF index = DOF_BF(1,1))"
NODE = "BD_1 finite element node 2 (number of elements = 1; element order = 8) rotational displacement in"
STATES = [
    ("T", 2, f"ED {FLAP}, m"),
    ("T", 2, f"ED First time derivative of {FLAP}, m/s"),
    *(("T", 2, f"{NODE} {axis}, rad") for axis in "XYZ"),
    ("T", 1, "AD vind (axial) at blade 2, node 13, m/s"),
]
INPUTS = [
    ("F", 0, "BD_1 RootMotion X translation displacement, node 1, m"),
    ("F", 0, "BD_1 RootMotion X orientation angle, node 1, rad"),
    ("F", 0, "BD_1 RootMotion Y orientation angle, node 1, rad"),
    ("F", 0, "BD_1 RootMotion Z orientation angle, node 1, rad"),
    ("F", 0, "BD_1 RootMotion X translation acceleration, node 1, m/s^2"),
    ("F", 0, "IfW Extended input: horizontal wind speed (steady/uniform wind), m/s"),
    ("F", 0, "IfW Extended input: vertical power-law shear exponent, -"),
]
OUTPUTS = [
    ("T", 0, "ED RootFxc1, (kN)"), ("T", 0, "ED RootFxc1, (kN)"), ("F", 0, "ED Azimuth, (deg)"),
    ("T", 0, "AD B1N1Alpha, (deg)"), ("F", 0, "ED Blade 1 orientation angle, node 1, rad"),
]  # fmt: skip


def number(value, form):
    """Write a number as Fortran does: without the E where the exponent has one digit more than the format."""
    width, digits, exponent = map(int, re.match(r"E(\d+)\.(\d+)E(\d)", form).groups())
    mantissa, power = f"{value:.{digits}E}".split("E")
    size = str(abs(int(power)))
    text = f"{mantissa}{'E' if len(size) <= exponent else ''}{power[0]}{size.zfill(exponent)}"
    return text.rjust(width) if len(text) <= width else "*" * width


def table(title, first, rows, values, version, one_number=()):
    form, columns = FORMS[version]
    stop = 14 + 3 * int(re.match(r"E(\d+)", form)[1]) + 7
    heads = [*["Rotating Frame?", "Derivative Order"][:columns], "Description"]
    lines = [f"Order of {title}:", f"   {first:>10} {'Operating Point'}".ljust(stop - 1) + " ".join(heads), "   ----"]
    for i, ((frame, order, text), value) in enumerate(zip(rows, values, strict=True)):
        shown = ", ".join(number(v, form) for v in np.atleast_1d(value))
        told = one_number[0] + 1 if i in one_number else i + 1
        tail = "".join([f"{frame:>8}"] * (columns > 0) + [f"{order:>16}         "] * (columns > 1))
        tail = tail + ("        " if columns == 1 else "") + (rows[one_number[0]][2] if i in one_number else text)
        lines.append(f"   {told:8d}   {shown}".ljust(stop - 1) + tail)
    return [*lines, ""]


def matrix(name, values, version):
    rows = ["    " + " ".join(number(v, FORMS[version][0]) for v in row) for row in values]
    return ["", f"{name}: {len(values)} x {values.shape[1]}", *rows]


def model(seed=1):
    """Return A, B, C, D with numbers over many decades and the operating points of states, inputs and outputs."""
    rng = np.random.default_rng(seed)
    n, r, m = len(STATES), len(INPUTS), len(OUTPUTS)
    matrices = [rng.normal(size=s) * 10.0 ** rng.integers(-9, 9, s) for s in ((n, n), (n, r), (m, n), (m, r))]
    turn = np.array([[1, 0, 0], [0, 1, -1.836970198721e-16], [0, 1.836970198721e-16, 1]])
    u = [0.1, *turn, -9.81, 12.0, 0.2]
    return matrices, rng.normal(size=n) * 1e-3, u, [*rng.normal(size=4), turn[0]]


def lin_file(path, version, *, one_number=(), wind="8.0000", module=False, jacobians=False, derivative="First"):
    (A, B, C, D), x, u, y = model()
    lines = ["", "Linearized model: Predictions were generated on 04-Mar-2024 at 11:06:45 using OpenFAST, compiled as a"
             " 64-bit application using double precision at commit v3.5.2", " linked with  NWTC Subroutine Library",
             "", "Description from the FAST input file: A: 6 x 6", ""]  # fmt: skip
    if version == "8.16":
        lines.append("Linearized model at simulation time =   10.0000 s")
    else:
        lines += ["Simulation information:", "   Simulation time:      1.0000 s", "   Rotor Speed:       1.2799 rad/s",
                  "   Azimuth:           1.2699 rad"]  # fmt: skip
        lines += [] if version == "2.3" else [f"   Wind Speed:  {wind} m/s"]
    counts = (("continuous states", 6), ("discrete states", 0), ("constraint states", 0), ("inputs", 7), ("outputs", 5))
    lines += [f"   {'Number of ' + k + ':':32} {v:5}" for k, v in counts]
    lines += ["   Jacobians included in this file?   " + ("Yes" if jacobians else " No"), ""]
    rows = [[(f, o, t.split(" ", 1)[1] if module else t) for f, o, t in group] for group in (STATES, INPUTS, OUTPUTS)]
    lines += table("continuous states", "Row/Column", rows[0], x, version, one_number)
    derived = [(f, o, f"{derivative} time derivative of {t}/s") for f, o, t in rows[0]]
    lines += table("continuous state derivatives", "Row/Column", derived, x, version)
    lines += table("inputs", "Column  ", rows[1], u, version) + table("outputs", "Row  ", rows[2], y, version)
    if jacobians:
        lines += ["", "Jacobian matrices:", ""]
        for name, size in (("dUdu", 7), ("dUdy", 7), ("J", 9), ("dXdx", 6)):
            lines += matrix(name, np.full((size, size), 7.0), version)
    lines += ["", "Linearized state matrices:", ""]
    for name, values in zip("ABCD", (A, B, C, D), strict=True):
        lines += matrix(name, values, version)
    lines += matrix("StateRotation", np.eye(6), version)
    path.write_text("\r\n".join(lines) + "\n", encoding="utf-8", newline="")
    return path


@pytest.mark.parametrize("version", FORMS)
@pytest.mark.parametrize("module, jacobians", [(False, False), (True, True)])
def test_every_release_is_read_whole(tmp_path, version, module, jacobians):
    found = read_lin(lin_file(tmp_path / "Main.1.lin", version, module=module, jacobians=jacobians))
    matrices, x, u, _ = model()
    digits = int(FORMS[version][0].split(".")[1].split("E")[0])
    for name, expected in zip("ABCD", matrices, strict=True):
        np.testing.assert_allclose(getattr(found.model, name), expected, rtol=0.51 * 10.0**-digits, err_msg=name)
    np.testing.assert_allclose([s.offset for s in found.model.states], x, rtol=0.51 * 10.0**-digits)
    plain = [v if np.ndim(v) == 0 else 0.0 for v in u]
    np.testing.assert_allclose([s.offset for s in found.model.inputs], plain, rtol=10.0**-digits)
    assert found.model.outputs[4].offset == 0.0
    first = "" if module else "ED "
    assert [s.name for s in found.model.outputs[:3]] == [f"{first}RootFxc1 (row 1)", f"{first}RootFxc1 (row 2)",
                                                         f"{first}Azimuth"]  # fmt: skip
    assert [s.unit for s in found.model.inputs] == ["m", "rad", "rad", "rad", "m/s^2", "m/s", "-"]
    assert [s.unit for s in found.model.outputs] == ["kN", "kN", "deg", "deg", "rad"]
    assert found.digits == digits + 1
    if version == "8.16":
        assert np.isnan(found.azimuth_rad) and found.rotating == ()
    else:
        assert found.azimuth_rad == 1.2699 and len(found.rotating) == 6 + 3
        assert np.isnan(found.wind_speed_m_s) == (version == "2.3")


def test_three_rotations_of_a_node_under_one_number(tmp_path):
    """OpenFAST 4 writes number and description of the first rotation for all three."""
    found = read_lin(lin_file(tmp_path / "a.lin", "3.5", one_number=(2, 3, 4)))
    names = [s.name.rsplit(") ", 1)[1] for s in found.model.states[2:5]]
    assert names == [f"rotational displacement in X (row {k})" for k in (3, 4, 5)]
    np.testing.assert_allclose(found.model.A, model()[0][0], rtol=1e-12)


def test_a_table_that_lost_a_row_is_refused(tmp_path):
    path = lin_file(tmp_path / "a.lin", "3.5")
    lines = path.read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if "1st flapwise" in line)
    del lines[at]
    path.write_text("\n".join(lines))
    with pytest.raises(DataError, match="row 1 of the 6 continuous states was expected"):
        read_lin(path)
    lines.insert(at, lines[at])
    path.write_text("\n".join(lines))
    with pytest.raises(DataError, match="row 1 of the 6 continuous states was expected"):
        read_lin(path)


def test_a_condition_without_room_is_unknown_and_a_value_without_room_is_refused(tmp_path):
    path = lin_file(tmp_path / "a.lin", "3.5", wind="***********")
    found = read_lin(path)
    assert np.isnan(found.wind_speed_m_s) and found.rotor_speed_rad_s == 1.2799
    for flaw in ("*" * 20, "NaN", "Infinity"):
        text = path.read_text()
        spoilt = text.replace(number(12.0, "E20.12E3"), flaw.rjust(20), 1)
        assert spoilt != text
        (tmp_path / "b.lin").write_text(spoilt)
        with pytest.raises(DataError, match=rf"line \d+: '{re.escape(flaw)}' is not a finite number"):
            read_lin(tmp_path / "b.lin")


def test_other_kinds_of_file_are_refused_with_a_remedy(tmp_path):
    (tmp_path / "old.lin").write_text(
        "\nThis linearized model file was generated by FAST (v6.02c-jmj, 02-Feb-2007) on 27-Sep-2007 at 15:39:45.\n"
        "The aerodynamic calculations were made by AeroDyn (12.58, 28-Jun-2005).\n"
    )
    with pytest.raises(DataError, match=r"old.lin: of FAST 6 or 7; linearise with FAST 8.16"):
        read_lin(tmp_path / "old.lin")
    with pytest.raises(DataError, match=r"line \d+: the states' second derivatives; .* without CompAeroMaps"):
        read_lin(lin_file(tmp_path / "maps.lin", "3.5", derivative="Second"))


def test_the_command_says_what_a_linearisation_is_not_good_for(tmp_path, capsys):
    path = lin_file(tmp_path / "a.lin", "8.16")
    assert main(["convert", str(path), str(tmp_path / "a.json")]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "matrix A is written with 4 digits" in out and "turn with the rotor" not in out
    path = lin_file(tmp_path / "b.lin", "5")
    assert main(["convert", str(path), str(tmp_path / "b.json"), "--json", "-"]) == 0
    notes = json.loads(capsys.readouterr().out)["notes"]
    assert len(notes) == 1 and "9 states, inputs and outputs turn" in notes[0] and "72.8 deg" in notes[0]
