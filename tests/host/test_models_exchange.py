"""Models keep their behaviour through python-control, MATLAB files and OpenFAST linearisations."""

from __future__ import annotations

import builtins
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.io import savemat
from scipy.linalg import expm

from aeolid.cli.main import main
from aeolid.diagnose.data.case import load_case
from aeolid.errors import DataError, UsageError
from aeolid.formats import read_record, write_table
from aeolid.models.exchange.files import read_state_space
from aeolid.models.exchange.matlab import read_mat_model, write_mat
from aeolid.models.exchange.openfast import read_lin
from aeolid.models.exchange.python_control import from_control, to_control
from aeolid.models.exchange.select import select
from aeolid.models.load import load_model
from aeolid.models.model_file import Signal
from aeolid.models.prediction import free_run, predict
from aeolid.models.state_space import StateSpace
from aeolid.plants.lti import fourth_order, simulate_fourth_order
from aeolid.record import Roles

MATRICES = ("A", "B", "C", "D", "K", "x0", "innovation_covariance")


def full_model() -> StateSpace:
    """Build a model that uses every entry: feedthrough, offsets, units, start, noise; three inputs, two outputs."""
    rng = np.random.default_rng(3)
    return StateSpace(
        0.9 * np.linalg.qr(rng.normal(size=(4, 4)))[0], rng.normal(size=(4, 3)), rng.normal(size=(2, 4)),
        rng.normal(size=(2, 3)), 0.1 * rng.normal(size=(4, 2)), rng.normal(size=4), np.array([[2.0, 0.3], [0.3, 1.0]]),
        0.05, (Signal("pitch", "deg", 4.5), Signal("torque", "kN m", 41.0), Signal("Größe =1", "", 0.0)),
        (Signal("speed", "rpm", 12.1), Signal("tower", "m", -0.2)), tuple(Signal(f"x{i + 1}") for i in range(4)),
    )  # fmt: skip


def same(one: StateSpace, other: StateSpace, *, tolerance: float = 0.0) -> None:
    for name in MATRICES:
        a, b = getattr(one, name), getattr(other, name)
        assert (a is None) == (b is None), name
        if a is not None:
            np.testing.assert_allclose(b, a, rtol=tolerance, atol=0, err_msg=name)
    assert (one.inputs, one.outputs, one.states) == (other.inputs, other.outputs, other.states)
    assert one.sample_time_s == other.sample_time_s


# python-control


def test_control_has_the_same_response_and_comes_back():
    control = pytest.importorskip("control")
    model = full_model()
    system = to_control(model)
    u = np.random.default_rng(0).normal(size=(50, 3))
    response = control.forced_response(system, inputs=u.T, initial_state=model.x0)
    expected = free_run(model, u + model.u_offset, model.x0) - model.y_offset
    np.testing.assert_allclose(response.outputs.T, expected, atol=1e-11)
    bare = [tuple(Signal(s.name) for s in signals) for signals in (model.inputs, model.outputs, model.states)]
    expected_model = replace(
        model, K=None, x0=np.zeros(4), innovation_covariance=None, inputs=bare[0], outputs=bare[1], states=bare[2]
    )
    same(expected_model, from_control(system))


def test_control_with_innovations_reproduces_the_recording():
    control = pytest.importorskip("control")
    model = full_model()
    rng = np.random.default_rng(1)
    u, y = rng.normal(size=(60, 3)) + model.u_offset, rng.normal(size=(60, 2)) + model.y_offset
    e = y - predict(model, u, y, 1, model.x0)
    system = to_control(model, innovations=True)
    assert system.input_labels[3:] == ["e_speed", "e_tower"]
    driven = control.forced_response(system, inputs=np.hstack([u - model.u_offset, e]).T, initial_state=model.x0)
    np.testing.assert_allclose(driven.outputs.T + model.y_offset, y, atol=1e-10)


def test_control_keeps_states_that_do_nothing_and_continuous_time():
    pytest.importorskip("control")
    model = replace(full_model(), A=np.zeros((4, 4)), B=np.zeros((4, 3)), sample_time_s=0.0)
    assert from_control(to_control(model)).order == 4
    assert from_control(to_control(model)).sample_time_s == 0.0


def test_control_without_a_time_base_or_with_the_wrong_kind_is_refused():
    control = pytest.importorskip("control")
    unspecified = control.StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], None)
    assert from_control(unspecified, sample_time_s=0.2).sample_time_s == 0.2
    with pytest.raises(UsageError, match="sample time"):
        from_control(control.StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], True))
    for wrong in (-0.2, np.nan):
        with pytest.raises(UsageError, match="is not a time in seconds"):
            from_control(unspecified, sample_time_s=wrong)
    with pytest.raises(UsageError, match="contradicts"):
        from_control(control.StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], 0.1), sample_time_s=0.2)
    with pytest.raises(DataError, match="TransferFunction"):
        from_control(control.tf([1.0], [1.0, 1.0]))
    with pytest.raises(UsageError, match="no Kalman gain"):
        to_control(replace(full_model(), K=None), innovations=True)


def test_absent_control_is_said_plainly(monkeypatch):
    real = builtins.__import__

    def without(name, *arguments, **words):
        if name == "control":
            raise ImportError(name)
        return real(name, *arguments, **words)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(UsageError, match=r"pip install 'aeolid\[control\]'"):
        to_control(full_model())


# MATLAB


@pytest.mark.parametrize("change", [{}, {"K": None, "innovation_covariance": None}, {"sample_time_s": 0.0}])
def test_a_matlab_file_holds_the_whole_model(tmp_path, change):
    model = replace(full_model(), **change)
    write_mat(tmp_path / "m.mat", model)
    same(model, read_mat_model(tmp_path / "m.mat"))


def test_a_matlab_structure_and_bare_matrices_are_read(tmp_path):
    A, B, C = np.diag([0.5, 0.2]), np.ones((2, 1)), np.ones((1, 2))
    names = np.array(["wind", "rpm "])  # a character array has rows of equal length
    savemat(tmp_path / "s.mat", {"sys": {"A": A, "B": B, "C": C, "Ts": 0.1, "D": [], "StateName": names}})
    model = read_mat_model(tmp_path / "s.mat")
    assert [s.name for s in (*model.inputs, *model.outputs, *model.states)] == ["u1", "y1", "wind", "rpm"]
    assert model.D.tolist() == [[0.0]] and model.K is None and model.sample_time_s == 0.1
    savemat(tmp_path / "b.mat", {"A": A, "B": B, "C": C, "Ts": -1.0})
    assert read_mat_model(tmp_path / "b.mat", 0.25).sample_time_s == 0.25


@pytest.mark.parametrize(
    "content, text",
    [
        ({"B": 1.0, "C": 1.0, "Ts": 1.0}, "no matrix A"),
        ({"A": 1.0, "B": 1.0, "C": 1.0}, "no sample time Ts"),
        ({"A": [[1.0, 2.0]], "B": 1.0, "C": 1.0, "Ts": 1.0}, "A is 1x2"),
        ({"A": 1.0, "B": 1.0, "C": 1.0, "Ts": 1.0, "K": [[1.0, 2.0]]}, "K is 1x2"),
        ({"A": 1.0j, "B": 1.0, "C": 1.0, "Ts": 1.0}, "A is not a matrix of real numbers"),
        ({"A": np.nan, "B": 1.0, "C": 1.0, "Ts": 1.0}, "not finite"),
        ({"A": "text", "B": 1.0, "C": 1.0, "Ts": 1.0}, "A is not a matrix of real numbers"),
        ({"A": 1.0, "B": 1.0, "C": 1.0, "Ts": 1.0, "InputName": ["a", "b"]}, "InputName has 2 entries"),
    ],
)
def test_an_unusable_matlab_file_is_named(tmp_path, content, text):
    savemat(tmp_path / "bad.mat", content)
    with pytest.raises(DataError, match=text) as error:
        read_mat_model(tmp_path / "bad.mat")
    assert "bad.mat" in str(error.value)


def test_properties_that_make_another_system_are_refused(tmp_path):
    """What `get` of a MATLAB system holds besides the matrices: at its defaults it says nothing."""
    plain = {"A": np.diag([0.5, 0.2]), "B": np.ones((2, 1)), "C": np.ones((1, 2)), "D": [[0.0]], "Ts": 0.1}
    default = {"E": np.zeros((0, 0)), "InputDelay": [[0.0]], "OutputDelay": [[0.0]], "InternalDelay": np.zeros((0, 1))}
    savemat(tmp_path / "m.mat", plain | default | {"TimeUnit": "seconds"})
    assert read_mat_model(tmp_path / "m.mat").order == 2
    savemat(tmp_path / "m.mat", plain | {"E": np.eye(2), "TimeUnit": ""})
    assert read_mat_model(tmp_path / "m.mat").order == 2
    for more, words in (
        ({"E": 2 * np.eye(2)}, "E is not the unit matrix; take ss"),
        ({"InputDelay": [[3.0]]}, "InputDelay is not zero"),
        ({"OutputDelay": [[1.0]]}, "OutputDelay is not zero"),
        ({"InternalDelay": [[1.0]]}, "InternalDelay is not zero"),
        ({"TimeUnit": "minutes"}, "TimeUnit is 'minutes'; take chgTimeUnit"),
    ):
        savemat(tmp_path / "m.mat", {"s": plain | default | more})
        with pytest.raises(DataError, match=words):
            read_mat_model(tmp_path / "m.mat")


def test_a_matlab_file_is_a_baseline_of_a_diagnosis(tmp_path):
    model, record = fourth_order(), simulate_fourth_order(300, 4)
    write_table(tmp_path / "r.csv", {c.name: record.column(c.name) for c in record.channels}, {})
    channels = [f'[[channel]]\nname = "{c.name}"\nunit = "{c.unit}"\nrole = "{c.role}"\n' for c in record.channels]
    (tmp_path / "roles.toml").write_text("[recording]\nsample_time_s = 1.0\n" + "".join(channels))
    write_mat(tmp_path / "m.mat", model)
    (tmp_path / "case.toml").write_text(
        '[recordings]\nfiles = ["r.csv"]\nroles = "roles.toml"\n[baseline]\nkind = "state_space"\nfile = "m.mat"\n'
    )
    baseline = load_case(tmp_path).baseline
    assert isinstance(baseline, StateSpace)
    same(model, baseline)


@pytest.mark.parametrize("content", [b"", b"not a MATLAB file at all" * 20, b"MATLAB 7.3 MAT-file"])
def test_a_damaged_matlab_file_is_named(tmp_path, content):
    (tmp_path / "bad.mat").write_bytes(content)
    with pytest.raises(DataError, match=r"bad\.mat: "):
        read_mat_model(tmp_path / "bad.mat")


# OpenFAST linearisations, written as its manual and its files have them

A_LIN = np.array([[0.0, 1.0, 0.0], [-4.2, -0.05, 0.3], [0.0, 0.12, -0.2]])
B_LIN = np.array([[0.0, 0.0], [0.7, 1e-7], [-2.5, -1.2e-5]])
C_LIN = np.array([[0.0, 0.0, 9.54929659], [1.0, 0.0, 0.0], [0.0, 0.0, 9.54929659], [0.0, 0.1, 0.0]])
D_LIN = np.array([[0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [-320.5, 0.25]])
STATES = [("3.5E-01", "F", 2, "ED 1st tower fore-aft bending mode DOF (internal DOF index = DOF_TFA1), m"),
          ("0.0E+00", "F", 2, "ED First time derivative of 1st tower fore-aft bending mode DOF, m/s"),
          ("1.26711E+00", "F", 1, "ED First time derivative of Variable speed generator DOF, rad/s")]  # fmt: skip
INPUTS = [("6.5E-02", "T", 0, "ED Extended input: collective blade-pitch command, rad"),
          ("4.3E+04", "F", 0, "ED Generator torque, Nm")]  # fmt: skip
OUTPUTS = [("1.21E+01", "F", 0, "ED RotSpeed, (rpm)"), ("3.5E-01", "F", 0, "ED TTDspFA, (m)"),
           ("1.21E+01", "F", 0, "ED RotSpeed, (rpm)"), ("7.1E+03", "T", 0, "ED RootMyc1, (kN-m)")]  # fmt: skip


def table(title, first, rows, order):
    heading = (
        f"   {first:10} Operating Point   Rotating Frame? " + ("Derivative Order " if order else "") + "Description"
    )
    lines = [f"Order of {title}:", heading, "   ---------- ---------------"]
    for i, (value, frame, degree, text) in enumerate(rows):
        lines.append(f"  {i + 1:9}   {value}      {frame}     " + (f"{degree}      " if order else "") + text)
    return [*lines, "", ""]


def matrix(name, values):
    rows = ["  " + " ".join(f"{v:15.8E}" for v in row) for row in values]
    return [f"{name}: {values.shape[0]} x {values.shape[1]}", *rows, ""]


def lin_text(order=True, wind=True, states=STATES, inputs=INPUTS, matrices=True, extra=()):
    counts = {"continuous states": len(states), "discrete states": 0, "constraint states": 0, "inputs": len(inputs),
              "outputs": len(OUTPUTS)}  # fmt: skip
    lines = ["", "Linearized model: Predictions were generated on 01-Jun-2020 using OpenFAST", "",
             "Description from the FAST input file: a test: A: 1 x 1 B:", "", "Simulation information:",
             "   Simulation time:   10.0 s", "   Rotor Speed:   1.2671 rad/s", "   Azimuth:   2.0944 rad"]  # fmt: skip
    lines += ["   Wind Speed:  12.0 m/s"] if wind else []
    lines += [f"   Number of {k}: {v:5}" for k, v in counts.items()] + ["   Jacobians included in this file?   No", ""]
    lines += table("continuous states", "Row/Column", states, order)
    derivatives = [(v, f, d, f"First time derivative of {t}/s") for v, f, d, t in states]
    lines += table("continuous state derivatives", "Row/Column", derivatives, order)
    lines += table("inputs", "Column", inputs, order) if inputs else []
    lines += table("outputs", "Row", OUTPUTS, order) + list(extra)
    lines += ["Linearized state matrices:", ""] if matrices else []
    for name, values in (("A", A_LIN), ("B", B_LIN), ("C", C_LIN), ("D", D_LIN)) if matrices else ():
        values = values if name in "AC" else values[:, : len(inputs)]
        lines += matrix(name, values) if values.size else []
    return "\n".join(lines) + "\n"


def written(tmp_path, text):
    path = tmp_path / "Main.1.lin"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("order, wind", [(True, True), (False, False)])
def test_a_linearisation_is_read_whole(tmp_path, order, wind):
    result = read_lin(written(tmp_path, lin_text(order, wind)))
    model = result.model
    for name, expected in (("A", A_LIN), ("B", B_LIN), ("C", C_LIN), ("D", D_LIN)):
        np.testing.assert_allclose(getattr(model, name), expected, rtol=1e-8)
    assert model.inputs == (
        Signal("ED Extended input: collective blade-pitch command", "rad", 0.065),
        Signal("ED Generator torque", "Nm", 43000.0),
    )
    assert [(s.name, s.unit, s.offset) for s in model.outputs] == [
        ("ED RotSpeed (row 1)", "rpm", 12.1), ("ED TTDspFA", "m", 0.35), ("ED RotSpeed (row 3)", "rpm", 12.1),
        ("ED RootMyc1", "kN-m", 7100.0)]  # fmt: skip
    assert model.states[0].name.endswith("(internal DOF index = DOF_TFA1)") and model.states[0].unit == "m"
    assert (result.azimuth_rad, result.rotor_speed_rad_s) == (2.0944, 1.2671)
    assert result.wind_speed_m_s == 12.0 if wind else np.isnan(result.wind_speed_m_s)
    assert result.rotating == ("ED Extended input: collective blade-pitch command", "ED RootMyc1")
    assert model.sample_time_s == 0.0 and model.K is None


def test_orientations_no_inputs_and_exponents_of_three_digits(tmp_path):
    turned = [("1.0E+00, 0.0E+00, 0.0E+00", "T", 0, "ED Blade 1 orientation angle, node 1, rad"), INPUTS[1]]
    assert read_lin(written(tmp_path, lin_text(inputs=turned))).model.inputs[0].offset == 0.0
    alone = read_lin(written(tmp_path, lin_text(inputs=[]))).model
    assert alone.B.shape == (3, 0) and alone.D.shape == (4, 0)
    text = lin_text().replace(" 1.00000000E-07", " 1.0000000-101")
    assert read_lin(written(tmp_path, text)).model.B[1, 1] == 1e-101


@pytest.mark.parametrize(
    "spoil, text",
    [
        (lambda t: "", "not a linearisation file"),
        (lambda t: "\0\x01\x02" * 100, "not a linearisation file"),
        (lambda t: lin_text(matrices=False), r"matrix A \(3 x 3\) is missing"),
        (lambda t: t[: t.index("C: 4 x 3")], r"matrix C \(4 x 3\) is missing"),
        (lambda t: t[: t.index("C: 4 x 3") + 40], r"line \d+: row 1 of matrix C has 2 numbers, 3 are needed"),
        (lambda t: t.replace("B: 3 x 2", "B: 3 x 3"), r"line \d+: matrix B is 3 x 3, the counts say 3 x 2"),
        (lambda t: t.replace(" 7.00000000E-01", " *************"), r"line \d+: '\*+' is not a finite number"),
        (lambda t: t.replace(" 7.00000000E-01", "           NaN"), r"line \d+: 'NaN' is not a finite number"),
        (lambda t: t.replace("inputs:     2", "inputs:    -2"), r"line 14: the number of inputs is '-2'"),
        (lambda t: t.replace("inputs:     2", "inputs: 99999999"), r"line 14: the number of inputs is '99999999'"),
        (lambda t: t.replace("inputs:     2", "inputs:     3"), r"line \d+: row 3 of the 3 inputs"),
        (lambda t: t.replace("Order of outputs:", "Order of things:"), "table 'Order of outputs:' is missing"),
        (lambda t: t.replace("ED Generator torque, Nm", ""), r"line \d+: row 2 of the 2 inputs"),
        (lambda t: t.replace("discrete states:     0", "discrete states:     2"), "2 discrete states"),
        (lambda t: t.replace("continuous states:     3", "continuous states:     0"), "no continuous states"),
    ],
)  # fmt: skip
def test_a_damaged_linearisation_is_named_by_its_line(tmp_path, spoil, text):
    with pytest.raises(DataError, match=text) as error:
        read_lin(written(tmp_path, spoil(lin_text())))
    assert "Main.1.lin" in str(error.value) and "\n" not in str(error.value)


def test_any_damage_to_a_linearisation_is_an_error_or_a_model(tmp_path):
    rng, text = np.random.default_rng(5), lin_text()
    refused = 0
    for _ in range(300):
        broken = list(text)
        for at in rng.integers(0, len(text), 4):
            broken[at] = chr(rng.choice([0, 9, 10, 32, 42, 45, 46, 57, 58, 69, 120, 0xB2, 0x660]))
        cut = int(rng.integers(len(text) // 2, 2 * len(text)))
        try:
            model = read_lin(written(tmp_path, "".join(broken)[:cut])).model
        except DataError:
            refused += 1
        else:
            assert all(np.isfinite(m).all() for m in (model.A, model.B, model.C, model.D))
    assert 50 < refused < 300


def test_the_line_of_a_fault_is_the_right_one(tmp_path):
    lines = lin_text().splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("A: ")) + 2
    lines[at] = lines[at] + " 1.0"
    with pytest.raises(DataError, match=f"line {at + 1}: row 2 of matrix A has 4 numbers"):
        read_lin(written(tmp_path, "\n".join(lines)))


def test_a_linearisation_runs_on_a_recording_as_its_differential_equation(tmp_path, capsys):
    path, h = written(tmp_path, lin_text()), 0.05
    wanted = ["--input", "pitch=Extended input: collective blade-pitch command", "--output", "tower=TTDspFA"]
    assert main(["convert", str(path), str(tmp_path / "m.json"), "--sample-time", str(h), *wanted]) == 0
    assert "tower [m] about 0.35" in capsys.readouterr().out
    u = 0.065 + 0.02 * np.sign(np.sin(0.4 * np.arange(200)))
    step = expm(np.block([[A_LIN, B_LIN[:, :1]], [np.zeros((1, 4))]]) * h)  # inputs held over a sample
    x, y = np.zeros(3), []
    for value in u:
        y.append(0.35 + x[0])
        x = step[:3, :3] @ x + step[:3, 3] * (value - 0.065)
    write_table(tmp_path / "r.csv", {"time_s": h * np.arange(200), "pitch": u, "tower": np.array(y)}, {})
    roles = "".join(
        f'[[channel]]\nname = "{n}"\nunit = "{v}"\nrole = "{r}"\n'
        for n, v, r in (("pitch", "rad", "input"), ("tower", "m", "output"))
    )
    (tmp_path / "roles.toml").write_text('[recording]\ntime = "time_s"\n' + roles)
    record = read_record(tmp_path / "r.csv", Roles.load(tmp_path / "roles.toml"))
    simulated = replace(load_model(tmp_path / "m.json"), initial="zero").simulate(record)[:, 0]
    np.testing.assert_allclose(simulated, y, atol=1e-9)
    model = select(read_state_space(path), ["pitch=Extended input: collective blade-pitch command"], ["tower=TTDspFA"])
    write_mat(tmp_path / "m.mat", model)  # continuous time, discretised when it meets the recording
    common = [str(tmp_path / "r.csv"), "--roles", str(tmp_path / "roles.toml")]
    for name in ("m.json", "m.mat"):
        command = ["validate", str(tmp_path / name), *common, "--fail-above", "1e-6"]
        assert main(command) == 0
        for wrong in ("nan", "inf", "-1"):
            assert main([*command[:-1], wrong]) == 2
            assert f"--fail-above {wrong} is no NRMSE" in capsys.readouterr().err
        assert main(["simulate", str(tmp_path / name), *common, "--out", str(tmp_path / "s.csv")]) == 0


# selection and the command


def test_selection_keeps_order_gain_and_names():
    model = full_model()
    swapped = select(model, [], ["tower", "speed"])
    np.testing.assert_array_equal(swapped.K, model.K[:, ::-1])
    np.testing.assert_array_equal(swapped.innovation_covariance, model.innovation_covariance[::-1, ::-1])
    part = select(model, ["torque=torque", "b=pitch", "Größe =1"], ["tower"])
    assert part.K is None and part.innovation_covariance is None
    assert [s.name for s in part.inputs] == ["torque", "b", "Größe =1"]
    np.testing.assert_array_equal(part.D, model.D[1:][:, [1, 0, 2]])
    with pytest.raises(DataError, match=r"no input 'wind'; it has 'pitch', 'torque'"):
        select(model, ["wind"], [])
    with pytest.raises(UsageError, match="'pitch' is asked for twice"):
        select(model, ["pitch", "pitch"], [])
    with pytest.raises(UsageError, match="'a' is asked for twice"):
        select(model, ["a=pitch", "a=torque"], [])


def test_the_command_goes_round_and_says_what_it_wrote(tmp_path, capsys):
    first, middle, last = (tmp_path / n for n in ("a.json", "b.mat", "c.json"))
    first.write_text(json.dumps(fourth_order().to_json()))
    assert main(["convert", str(first), str(middle)]) == 0
    assert "with a Kalman gain" in capsys.readouterr().out
    assert main(["convert", str(middle), str(last), "--json", "-"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["order"] == 4 and facts["kalman_gain"] is True
    assert json.loads(first.read_text()) == json.loads(last.read_text())


@pytest.mark.parametrize(
    "arguments, code, text",
    [
        (["a.json", "b.txt"], 2, "written as .json, .mat, .h or .fmu"),
        (["a.json", "b.mat", "--sample-time", "-1"], 2, "--sample-time -1"),
        (["a.json", "b.mat", "--precision", "f64"], 2, "--precision and --name belong to C"),
        (["a.json", "b.json", "--name", "plant"], 2, "--precision and --name belong to C"),
        (["a.json", "b.h", "--output", "y1"], 2, "all outputs that its Kalman gain was made for: y1, y2"),
        (["a.json", "b.h", "--sample-time", "0.3"], 2, "an observer runs at the 1 s that its Kalman gain was made for"),
        (["a.json", "b.fmu", "--continuous"], 2, "--continuous writes a model as .json or .mat"),
        (["a.json", "b.mat", "--output", "none"], 3, "no output 'none'"),
        (["a.json", "absent/b.mat"], 2, "cannot be written"),
        (["a.json", "absent/b.h"], 2, "cannot be written"),
        (["absent.lin", "b.json"], 3, "no such file"),
        (["absent.mat", "b.json"], 3, "no such file"),
        (["equations.toml", "b.json"], 2, "equations are written as .h"),
        (["absent.toml", "b.fmu", "--sample-time", "0.1"], 3, "absent.toml"),
    ],
)
def test_bad_conversions_end_in_one_sentence(tmp_path, monkeypatch, capsys, arguments, code, text):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.json").write_text(json.dumps(fourth_order().to_json()))
    assert main(["convert", *arguments]) == code
    error = capsys.readouterr().err
    assert text in error and "Traceback" not in error and len(error.strip().splitlines()) == 1
