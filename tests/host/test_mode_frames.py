"""Mode shapes on a wire frame: laws of the motion, and the page and pictures that show it."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread
from test_report import chromium_messages

import aeolid as ae
from aeolid.cli.main import main
from aeolid.errors import DataError, UsageError
from aeolid.formats import write_table
from aeolid.geometry import Geometry, Point, Sensor
from aeolid.models.projections import placed, views_of
from aeolid.models.wire_frame import (
    DISPLACEMENT,
    REACH,
    _follow,
    _straight_on,
    collinearity,
    frame_of,
    motions,
    phase_deviation,
    to_real_axis,
)
from aeolid.plants.structure import mass_chain, shaken
from aeolid.report.frames import frames_part

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
POLE = complex(-0.1, 6.0)  # rad/s
PHASES = np.linspace(0, 2 * np.pi, 7)
# of positions of tens of metres in double precision, with a rotation and a square root on the way
NEAR: dict[str, float] = {"rtol": 0, "atol": 1e-11}


def drawn_structure(seed: int) -> tuple[Geometry, dict[str, complex]]:
    """Return a random structure with two or three sensors at each of six places, lines, points, and a shape."""
    random = np.random.default_rng(seed)
    sensors, shape = [], {}
    places = 40 * random.standard_normal((6, 3))
    for i, place in enumerate(places):
        for direction in random.permutation(np.linalg.qr(random.standard_normal((3, 3)))[0])[: 2 + i % 2]:
            name = f"s{len(sensors)}"
            sensors.append(Sensor(name, "m", tuple(place), tuple(direction)))
            shape[name] = complex(*random.standard_normal(2))
    firsts = [next(s.name for s in sensors if s.position == tuple(p)) for p in places]
    points = [Point("middle", tuple((places[0] + places[1]) / 2)), Point("foot", tuple(places[2] + 10))]
    lines = [*pairwise(firsts), ("foot", firsts[2])]
    return Geometry(tuple(sensors), tuple(points), tuple(lines)), shape


def rotated(geometry: Geometry, Q: np.ndarray) -> Geometry:
    """Return the geometry turned as a whole."""
    return Geometry(
        tuple(replace(s, position=tuple(Q @ s.position), direction=tuple(Q @ s.direction)) for s in geometry.sensors),
        tuple(replace(p, position=tuple(Q @ p.position)) for p in geometry.points),
        geometry.lines,
    )


def at(geometry: Geometry, points: np.ndarray, name: str) -> np.ndarray:
    """Return the row of the place that a name is at, of an array (P, …) over the frame's points."""
    place = next(p.position for p in (*geometry.sensors, *geometry.points) if p.name == name)
    return points[int(np.argmin(np.linalg.norm(frame_of(geometry).positions - place, axis=1)))]


@pytest.mark.parametrize("seed", range(4))
def test_a_rotation_of_everything_leaves_all_distances(seed: int) -> None:
    geometry, shape = drawn_structure(seed)
    Q = np.linalg.qr(np.random.default_rng(seed + 100).standard_normal((3, 3)))[0]
    turned = rotated(geometry, Q)
    names = [s.name for s in geometry.sensors] + [p.name for p in geometry.points]
    (one,), (other,) = (motions(frame_of(g), shape, POLE) for g in (geometry, turned))
    for phase in PHASES:
        a, b = (
            np.array([at(g, placed(frame_of(g), m, phase), n) for n in names])
            for g, m in ((geometry, one), (turned, other))
        )
        apart = [np.linalg.norm(p[:, None] - p, axis=2) for p in (a, b)]
        np.testing.assert_allclose(*apart, **NEAR)
    assert one.collinearity == pytest.approx(other.collinearity, abs=1e-12)


@pytest.mark.parametrize("factor", [2.0, 1j, -3.0, 0.3 - 0.8j, 1e-9j, 1e9])
def test_the_scale_of_a_shape_leaves_the_drawing(factor: complex) -> None:
    geometry, shape = drawn_structure(5)
    frame = frame_of(geometry)
    (one,) = motions(frame, shape, POLE)
    (other,) = motions(frame, {n: factor * v for n, v in shape.items()}, POLE)
    for phase in PHASES:
        np.testing.assert_allclose(placed(frame, one, phase), placed(frame, other, phase), **NEAR)
    assert one.phase_deviation_deg == pytest.approx(other.phase_deviation_deg, abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_perpendicular_sensors_at_a_place_add_as_vectors(seed: int) -> None:
    geometry, shape = drawn_structure(seed)
    (found,) = motions(frame_of(geometry), shape, POLE)
    sums = {s.position: np.zeros(3, dtype=complex) for s in geometry.sensors}
    for s in geometry.sensors:
        sums[s.position] += shape[s.name] * np.array(s.direction)
    named = {s.position: s.name for s in geometry.sensors}
    u = np.array([at(geometry, found.displacement, named[p]) for p in sums])
    true = np.array(list(sums.values()))
    factor = np.vdot(true, u) / np.vdot(true, true)  # the drawing's scale and phase
    np.testing.assert_allclose(u, factor * true, **NEAR)
    assert np.linalg.norm(u, axis=1).max() == pytest.approx(1.0)


def test_sensors_that_point_alike_are_averaged_and_skew_ones_explained() -> None:
    place = (0.0, 0.0, 10.0)
    alike = Geometry((Sensor("a", "m", place, X), Sensor("b", "m", place, X), Sensor("c", "m", (0.0, 0.0, 5.0), X)))
    (found,) = motions(frame_of(alike), {"a": 1.0, "b": 2.0, "c": 1.5}, POLE)
    assert at(alike, found.displacement, "a") == pytest.approx(at(alike, found.displacement, "c"))
    skew = (np.sqrt(0.5), np.sqrt(0.5), 0.0)
    two = Geometry((Sensor("a", "m", place, X), Sensor("b", "m", place, skew)))
    (found,) = motions(frame_of(two), {"a": 3.0, "b": (3.0 + 4.0) * np.sqrt(0.5)}, POLE)  # of u = (3, 4, 0)
    np.testing.assert_allclose(found.displacement[0], [0.6, 0.8, 0.0], **NEAR)


def tower(lines: tuple[tuple[str, str], ...], *points: Point) -> Geometry:
    """Return a tower with sensors along x and y at 30 m and 90 m."""
    sensors = [Sensor(f"{d}{z}", "m", (0.0, 0.0, z), v) for z in (30.0, 90.0) for d, v in (("x", X), ("y", Y))]
    return Geometry(tuple(sensors), points, lines)


SHAPE = {"x30.0": 0.3 + 0.1j, "y30.0": 0.2j, "x90.0": 1.0, "y90.0": -0.5 + 0.2j}


def test_points_on_a_line_between_sensors_are_interpolated() -> None:
    """At the share of the line that they are at, whether one line passes them or several end there."""
    shares = (0.1, 0.5, 0.75)
    points = [Point(f"p{i}", (0.0, 0.0, 30 + 60 * s)) for i, s in enumerate(shares)]
    one = tower((("x30.0", "y90.0"),), *points)
    chain = tower((("x30.0", "p0"), ("p0", "p1"), ("p1", "p2"), ("p2", "x90.0")), *points)
    for geometry in (one, chain):
        (found,) = motions(frame_of(geometry), SHAPE, POLE)
        low, high = (at(geometry, found.displacement, n) for n in ("x30.0", "x90.0"))
        for i, share in enumerate(shares):
            np.testing.assert_allclose(at(geometry, found.displacement, f"p{i}"), low + share * (high - low), **NEAR)
    assert len(frame_of(one).edges) == 4


def test_points_that_are_not_between_sensors_stay_and_so_do_fixed_ones() -> None:
    foot, held = Point("foot", (0.0, 0.0, 0.0)), Point("held", (0.0, 0.0, 60.0), fixed=True)
    alone = [Point("a", (50.0, 0.0, 0.0)), Point("b", (60.0, 0.0, 0.0)), Point("c", (50.0, 9.0, 0.0))]
    ring = (("a", "b"), ("b", "c"), ("c", "a"))
    geometry = tower((("foot", "x30.0"), ("x30.0", "x90.0"), *ring), foot, held, *alone)
    (found,) = motions(frame_of(geometry), SHAPE, POLE)
    for name in ("foot", "held", "a", "b", "c"):
        assert not at(geometry, found.displacement, name).any()
    halfway = tower((("foot", "x30.0"),), foot, Point("half", (0.0, 0.0, 15.0)))
    (found,) = motions(frame_of(halfway), SHAPE, POLE)
    low = at(halfway, found.displacement, "x30.0")
    np.testing.assert_allclose(at(halfway, found.displacement, "half"), low / 2, **NEAR)


def test_a_bent_chain_is_a_line_and_a_corner_is_not() -> None:
    """Within 30° of straight on a point is between its neighbours; what joins only such points has none to follow."""
    bend = [Point("bend", (4.0, 0.0, 60.0)), Point("corner", (60.0, 0.0, 60.0))]
    angle = 2 * np.pi * np.arange(24) / 24
    rim = [Point(f"r{i}", (float(np.cos(a)), float(np.sin(a)), 0.0)) for i, a in enumerate(angle)]
    lines = [(n, end) for n in ("bend", "corner") for end in ("x30.0", "x90.0")]
    lines += [(f"r{i}", f"r{(i + 1) % 24}") for i in range(24)]
    geometry = tower(tuple(lines), *bend, *rim)
    (found,) = motions(frame_of(geometry), SHAPE, POLE)
    low, high = (at(geometry, found.displacement, n) for n in ("x30.0", "x90.0"))
    np.testing.assert_allclose(at(geometry, found.displacement, "bend"), (low + high) / 2, **NEAR)
    for name in ("corner", "r0", "r11"):
        assert not at(geometry, found.displacement, name).any()
    follow = _follow(_straight_on(frame_of(geometry)))  # of the rim nobody: a matrix of them alone would be singular
    np.testing.assert_array_equal(frame_of(geometry).positions[follow], [bend[0].position])


def test_cross_beams_do_not_pull_on_a_line() -> None:
    """The middle of a line between sensors is their mean, whatever else is joined to it."""
    middle, aside = Point("middle", (0.0, 0.0, 60.0)), Point("aside", (9.0, 0.0, 60.0))
    geometry = tower((("x30.0", "x90.0"), ("middle", "aside")), middle, aside)
    (found,) = motions(frame_of(geometry), SHAPE, POLE)
    low, high = (at(geometry, found.displacement, n) for n in ("x30.0", "x90.0"))
    np.testing.assert_allclose(at(geometry, found.displacement, "middle"), (low + high) / 2, **NEAR)
    assert not at(geometry, found.displacement, "aside").any()


def test_a_fixed_point_holds_a_sensor_at_its_place() -> None:
    geometry = tower((), Point("clamp", (0.0, 0.0, 30.0), fixed=True))
    (found,) = motions(frame_of(geometry), SHAPE, POLE)
    assert not at(geometry, found.displacement, "x30.0").any()


def test_derivatives_of_a_motion_are_drawn_as_the_motion_itself() -> None:
    """x(t) = Re(u exp(s t)): its velocity has the amplitude s u, its acceleration s² u, in any unit of theirs."""
    geometry = tower((("x30.0", "x90.0"),))
    (true,) = motions(frame_of(geometry), SHAPE, POLE)
    assert not true.derived
    units = {"x30.0": ("m/s2", POLE**2), "y30.0": ("mm/s", 1e3 * POLE), "x90.0": ("g", POLE**2 / 9.80665)}
    sensors = tuple(replace(s, unit=units.get(s.name, ("m", 1))[0]) for s in geometry.sensors)
    recorded = {n: v * units.get(n, ("m", 1))[1] for n, v in SHAPE.items()}
    (found,) = motions(frame_of(replace(geometry, sensors=sensors)), recorded, POLE)
    assert found.derived and found.unit == DISPLACEMENT
    np.testing.assert_allclose(found.displacement, true.displacement, **NEAR)
    assert found.collinearity == pytest.approx(true.collinearity)


def test_what_is_no_displacement_is_drawn_by_itself() -> None:
    geometry = tower(())
    sensors = tuple(replace(s, unit="kN m" if s.name.startswith("y") else "m") for s in geometry.sensors)
    found = {m.unit: m for m in motions(frame_of(replace(geometry, sensors=sensors)), SHAPE, POLE)}
    assert set(found) == {DISPLACEMENT, "kN m"}
    assert found["kN m"].sensors == ("y30.0", "y90.0")
    assert not found["kN m"].displacement[:, 0].any() and not found[DISPLACEMENT].displacement[:, 1].any()


def test_sensors_without_an_amplitude_count_as_none() -> None:
    geometry = tower(())
    assert motions(frame_of(geometry), {}, POLE) == []
    assert motions(frame_of(geometry), {"x30.0": 0.0, "x90.0": complex("nan")}, POLE) == []
    (found,) = motions(frame_of(geometry), {"x90.0": 1j}, POLE)
    assert found.sensors == ("x90.0",) and not at(geometry, found.displacement, "x30.0").any()


def test_complexity_is_that_of_standing_and_travelling_waves() -> None:
    random = np.random.default_rng(3)
    standing = random.standard_normal(9) * np.exp(0.7j)
    assert collinearity(standing) == pytest.approx(1.0)
    assert phase_deviation(standing) == pytest.approx(0.0, abs=1e-6)  # degrees: the root of rounding
    wave = np.exp(2j * np.pi * np.arange(8) / 8)
    assert collinearity(wave) == pytest.approx(0.0, abs=1e-12)
    # Σ (Re a)² is largest on the axis found: as large as the largest singular value of [Re a, Im a] squared
    a = random.standard_normal(9) + 1j * random.standard_normal(9)
    best = np.linalg.svd(np.column_stack([a.real, a.imag]), compute_uv=False)[0] ** 2
    assert (to_real_axis(a).real ** 2).sum() == pytest.approx(best)


def test_the_drawing_reaches_as_far_as_it_says_and_views_that_show_nothing_are_left_out() -> None:
    geometry = tower((("x30.0", "x90.0"),))
    frame = frame_of(geometry)
    (both,) = motions(frame, SHAPE, POLE)
    (aside,) = motions(frame, {"y90.0": 1.0, "x90.0": 0.001, "x30.0": 0.0}, POLE)
    away = np.max([np.linalg.norm(placed(frame, aside, p) - frame.positions, axis=1).max() for p in PHASES])
    assert away == pytest.approx(REACH * frame.extent)
    assert views_of(frame, [both]) == [(0, 2), (1, 2)]  # from above a tower is a point
    assert views_of(frame, [aside]) == [(1, 2)]
    point = frame_of(Geometry((Sensor("a", "m", (0.0, 0.0, 0.0), X),)))
    assert point.extent == 1.0 and len(views_of(point, motions(point, {"a": 1.0}, POLE))) == 3


def facts_of(geometry: Geometry, *shapes: dict[str, complex]) -> dict[str, Any]:
    """Return facts of modes with these shapes."""
    modes = [
        {"frequency_hz": 0.3 + i, "damping": 0.01, "name": "", "shape": {"outputs": {n: {"re": complex(v).real, "im":
         complex(v).imag} for n, v in shape.items()}}} for i, shape in enumerate(shapes)
    ]  # fmt: skip
    return {"geometry": geometry.to_json(), "modes": modes}


def test_the_moving_frame_runs_through_the_phases_of_the_shape() -> None:
    """Every state in the page is the projection of the points at its phase; the last is the first again."""
    geometry = tower((("x30.0", "x90.0"),))
    page = frames_part(facts_of(geometry, SHAPE))
    (values,) = re.findall(r'class="line" d="[^"]*"><animate[^>]* values="([^"]*)"', page)
    states = [np.array(re.findall(r"-?[\d.]+", state), dtype=float).reshape(-1, 2) for state in values.split(";")]
    assert len(states) == 17
    np.testing.assert_array_equal(states[0], states[-1])
    frame = frame_of(geometry)
    (motion,) = motions(frame, SHAPE, complex(-0.003, 0.3) * 2 * np.pi)
    (rest,) = re.findall(r'class="rest"><path class="line" d="M([\d.]+) ([\d.]+)L([\d.]+) ([\d.]+)', page)[1:]
    scale = abs(float(rest[3]) - float(rest[1])) / 60  # of the drawing a metre, by the tower's height
    for k, state in enumerate(states[:-1]):
        x, y = (placed(frame, motion, 2 * np.pi * k / 16)[:, i] for i in (0, 1))
        for drawn, true in ((state[:2, 0], x), (state[2:, 0], y)):  # x–z, then y–z: one scale, places of their own
            np.testing.assert_allclose(np.diff(drawn), scale * np.diff(true), rtol=0, atol=0.15)  # written to 0.1


def test_pages_of_large_frames_stay_small_and_say_what_they_leave_out() -> None:
    count = 900
    sensors = [Sensor(f"s{i}", "m", (float(i), float(i % 7), float(i % 11)), Z) for i in range(count)]
    lines = tuple((f"s{i}", f"s{i + 1}") for i in range(count - 1))
    shapes = [{f"s{i}": np.sin(k * i / 50) for i in range(count)} for k in range(1, 21)]
    page = frames_part(facts_of(Geometry(tuple(sensors), (), lines), *shapes))
    assert len(page) < 6_000_000
    assert "<animate" not in page and "too many lines" in page and "are not drawn" in page


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a recording of a tower that swings in two planes, and its roles."""
    folder = tmp_path_factory.mktemp("tower")
    chain = mass_chain(2)
    x = shaken(chain, 2000, 0.1, seed=1)
    y = shaken(replace(chain, stiffness=1.6 * chain.stiffness), 2000, 0.1, seed=2)
    table, text, plain = {"time_s": x.time_s}, "", ""
    for level in (1, 2):
        for direction, record in (("x", x), ("y", y)):
            name = f"l{level}_{direction}<b>"
            table[name] = record.column(f"level_{level}")
            plain += (entry := f'[[channel]]\nname = "{name}"\nunit = "m"\nrole = "output"\n')
            text += entry + f'position = [0, 0, {40 * level}]\ndirection = "{direction}"\n'
    text += '[[point]]\nname = "foot"\nposition = [0, 0, 0]\n[[line]]\nfrom = "foot"\nto = "l2_x<b>"\n'
    write_table(folder / "tower.csv", table)
    (folder / "tower.toml").write_text(text)
    (folder / "plain.toml").write_text(plain)
    return folder


@pytest.fixture(scope="module")
def found(recorded: Path) -> ae.ModalAnalysis:
    return ae.modes(ae.read(recorded / "tower.csv", roles=recorded / "tower.toml"), past=16)


def test_the_page_shows_each_mode_on_the_frame_and_refers_to_nothing_outside(
    found: ae.ModalAnalysis, tmp_path: Path
) -> None:
    found.report(tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    part = page[page.index("Modes on the structure</h2>") : page.index("Mode shapes</h2>")]
    assert len(found.modes) == 4
    assert part.count('class="frame moves"') == part.count('class="moving"') == 4
    assert part.count("phase collinearity") == 2 * 4  # below each drawing and as its title
    for mode in found.modes:
        assert f"{mode.frequency_hz:.3f}"[:4] in part
    assert not re.search(r"<(script|link|iframe|object|embed|base|image|use)\b", page)
    assert not re.search(r"(?:src|href)\s*=\s*[\"'](?!#|data:)", page) and not re.search(r"@import|url\((?!#)", page)
    assert "<b>" not in part and "l1_x&lt;b&gt;" in part
    told = found.to_json()
    assert [c["frequency_hz"] for c in told["complexity"]] == [m.frequency_hz for m in found.modes]
    assert all(c["collinearity"] > 0.95 for c in told["complexity"])  # damped in proportion: real shapes
    assert "on the structure" in found.summary()


@pytest.mark.slow
def test_a_browser_shows_the_frames_and_lets_them_move(found: ae.ModalAnalysis, tmp_path: Path) -> None:
    """The page's policy, no script and no network, lets the animation through: half a period apart pixels differ."""
    page = tmp_path / "page.html"
    found.report(page)
    slow = page.read_text(encoding="utf-8").replace('dur="2.4s"', 'dur="24000s"')  # stands while it is looked at
    drawings = []
    for begin in ("0s", "-12000s"):
        page.write_text(slow.replace("<animate ", f'<animate begin="{begin}" '), encoding="utf-8")
        assert chromium_messages(page, tmp_path) == []
        drawings.append(imread(tmp_path / "page.png"))
    differ = drawings[0][..., :3] != drawings[1][..., :3]
    assert differ.any(axis=2).sum() > 500  # four frames of lines 2 wide and some 200 high, at two places each


def test_without_positions_all_is_as_before(recorded: Path, found: ae.ModalAnalysis, tmp_path: Path) -> None:
    plain = ae.modes(ae.read(recorded / "tower.csv", roles=recorded / "plain.toml"), past=16)
    told, more = plain.to_json(), found.to_json()
    assert set(more) - set(told) == {"geometry", "complexity"}
    assert {k: v for k, v in more.items() if k in told} == told
    plain.report(tmp_path / "page.html")
    assert "Modes on the structure" not in (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "on the structure" not in plain.summary()
    with pytest.raises(UsageError, match="no channel has a position"):
        plain.plot_shapes()


def test_shapes_are_drawn_on_the_axes_given(found: ae.ModalAnalysis) -> None:
    import matplotlib.pyplot as plt

    grid = found.plot_shapes()
    assert grid.shape == (2, 4)
    rest = [line for line in grid[0, 0].get_lines() if line.get_color() == "0.6"]
    np.testing.assert_allclose(sorted(rest[0].get_ydata()), [0, 40], **NEAR)
    plt.close(grid[0, 0].figure)
    own = found.plot_shapes(modes=[-1]).shape  # a mode within one plane has one view
    given = found.plot_shapes(plt.subplots(*own, squeeze=False)[1], modes=[-1])
    assert given.shape == own and own[1] == 1
    assert f"{found.modes[-1].frequency_hz:.4g}" in given[0, 0].get_title()
    for wrong in ([4], [-5]):
        with pytest.raises(UsageError, match="no mode"):
            found.plot_shapes(modes=wrong)
    with pytest.raises(UsageError, match="axes"):
        found.plot_shapes(plt.subplots(3, 1)[1])
    plt.close("all")


def test_the_commands_picture_holds_the_shapes_below_the_diagram(recorded: Path, tmp_path: Path) -> None:
    for roles in ("tower", "plain"):
        call = ["modes", str(recorded / "tower.csv"), "--roles", str(recorded / f"{roles}.toml"), "--past", "16"]
        assert main([*call, "--picture", str(tmp_path / f"{roles}.svg")]) == 0
    heights = [
        float(re.search(r'height="([\d.]+)pt"', (tmp_path / f"{r}.svg").read_text())[1]) for r in ("tower", "plain")
    ]
    assert heights == pytest.approx([72 * (4.6 + 2 * 2.6), 72 * 4.6])
    assert "collinearity" in (tmp_path / "tower.svg").read_text()


def test_set_ups_are_drawn_with_the_sensors_of_all(
    recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = ae.read(recorded / "tower.csv", roles=recorded / "tower.toml")
    names = list(record.names("output"))
    setups = []
    for keep in (names[:1] + names[2:], names[1:]):  # each with roles of its own
        known = replace(record.geometry, sensors=tuple(s for s in record.geometry.sensors if s.name in keep))
        channels = tuple(c for c in record.channels if c.name in keep)
        setups.append(replace(record, values=record.columns(keep), channels=channels, geometry=known))
    merged = ae.merge_setups(setups, references=names[2:], past=16)
    told = merged.to_json()
    assert {n for c in told["complexity"] for n in c["sensors"]} == set(names)
    merged.report(tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert page.count('class="frame moves"') == len(merged.modes) == 4
    grid = merged.plot_shapes(modes=[0])
    assert grid.shape[1] == 1
    moved = tuple(replace(s, position=(1.0, 0.0, 0.0)) for s in record.geometry.sensors)
    elsewhere = replace(setups[1], geometry=replace(record.geometry, sensors=moved))
    monkeypatch.setattr("aeolid.identify.setup_request.find_modal", None)  # refused before the work
    with pytest.raises(DataError, match="in one roles file and at"):
        ae.merge_setups([setups[0], elsewhere], references=names[2:], past=16)
