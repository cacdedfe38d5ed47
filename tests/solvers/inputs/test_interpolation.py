"""Tables that are joined by other than straight lines, that repeat, and that come from elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, FileError, NameLookupError
from gearlib.solvers.inputs.table import INTERPOLATIONS

SMOOTH = ("monotone", "akima", "cubic")
T = np.array([0.0, 0.3, 0.7, 1.0, 1.6, 2.0])
Y = np.array([0.0, 1.0, 1.0, 3.0, -1.0, 0.0])


class Driven(gl.Component):
    """A torque turns a body; with a fan it is nonlinear."""

    fan = gl.Structural(False)

    def assemble(self) -> list[Any]:
        self.torque, self.body = gp.Torque(), gp.Inertia(J=0.5)
        parts = [self.torque]
        if self.fan:
            self.drag = gp.QuadraticSpeedDependentTorque(tau_nominal=-1e-12, w_nominal=10.0, torque_direction=False)
            parts.append(self.drag)
        return [gl.connect(part.flange, self.body.flange_a) for part in parts]


@pytest.fixture(scope="module")
def plain() -> gl.System:
    return gl.compile(Driven(), outputs=["body.w"])


@pytest.fixture(scope="module")
def nonlinear() -> gl.System:
    return gl.compile(Driven(fan=True), outputs=["body.w"])


@pytest.mark.parametrize("kind", INTERPOLATIONS)
@pytest.mark.parametrize("outside", ["hold", "periodic"])
def test_a_table_goes_through_its_points(kind: str, outside: str) -> None:
    table = gl.Table(T, Y, kind, outside)
    assert table(T[:-1]) == pytest.approx(Y[:-1], abs=1e-14)
    assert table(T[1:-1] - 1e-9) == pytest.approx(Y[:-2] if kind == "previous" else Y[1:-1], abs=1e-6)
    if outside == "hold":
        assert table([-5.0, 2.0, 7.0]) == pytest.approx([0.0, 0.0, 0.0])
    else:
        inner = np.linspace(0, 2, 23)[:-1]
        assert table(inner + 6.0) == pytest.approx(table(inner), abs=1e-12)
        assert table(inner - 4.0) == pytest.approx(table(inner), abs=1e-12)


@pytest.mark.parametrize("kind", SMOOTH)
@pytest.mark.parametrize("outside", ["hold", "periodic"])
def test_slopes_of_smooth_tables_are_continuous(kind: str, outside: str) -> None:
    table, h = gl.Table(T, Y, kind, outside), 1e-6
    knots = T[1:-1] if outside == "hold" else np.append(T[1:-1], [2.0, 4.0])
    before, after = (table(knots) - table(knots - h)) / h, (table(knots + h) - table(knots)) / h
    assert before == pytest.approx(after, abs=1e-3)
    if kind == "cubic":
        curved = (table(knots + 2e-3) - 2 * table(knots + 1e-3) + table(knots)) / 1e-6
        assert curved == pytest.approx((table(knots) - 2 * table(knots - 1e-3) + table(knots - 2e-3)) / 1e-6, abs=0.5)


@given(st.lists(st.floats(-10, 10), min_size=3, max_size=12))
def test_monotone_tables_do_not_overshoot(values: list[float]) -> None:
    table = gl.Table(np.arange(len(values)), values, "monotone")
    for k in range(len(values) - 1):
        between = table(np.linspace(k, k + 1, 50))
        low, high = sorted(values[k : k + 2])
        assert between.min() >= low - 1e-9
        assert between.max() <= high + 1e-9


def test_orders_of_accuracy() -> None:
    """A spline reproduces cubics; errors for a sine fall with the fourth power (spline), the third or better (the others)."""
    t = np.array([0.0, 0.5, 0.8, 1.7, 2.0])
    polynomial = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0])
    fine = np.linspace(0, 2, 100)
    assert gl.Table(t, polynomial(t), "cubic")(fine) == pytest.approx(polynomial(fine), abs=1e-12)
    for kind, order in (("linear", 2.0), ("cubic", 4.0), ("akima", 2.8), ("monotone", 1.8)):
        errors = []
        for n in (40, 160):
            coarse, inside = np.linspace(0, 6, n + 1), np.linspace(1, 5, 999)
            errors.append(abs(gl.Table(coarse, np.sin(coarse), kind)(inside) - np.sin(inside)).max())
        assert np.log(errors[0] / errors[1]) / np.log(4) > order - 0.3, kind


@pytest.mark.parametrize("kind", INTERPOLATIONS)
@pytest.mark.parametrize("method", ["auto", "rk5", "ida"])
@pytest.mark.parametrize("outside", ["hold", "periodic"])
def test_a_run_integrates_what_the_table_says(
    plain: gl.System, nonlinear: gl.System, kind: str, method: str, outside: str
) -> None:
    """The speed is the integral of the torque, by Gauss-Legendre quadrature from knot to knot."""
    table = gl.Table(T, Y, kind, outside)
    ends = np.sort(np.concatenate([[-0.5, 5.3], *(T + 2.0 * k for k in range(-1, 3))]))
    ends = ends[(ends >= -0.5) & (ends <= 5.3)]
    places, weights = np.polynomial.legendre.leggauss(4)
    a, b = ends[:-1, None], ends[1:, None]
    whole = (table((a + b) / 2 + (b - a) / 2 * places) * weights).sum(axis=1) @ (b - a)[:, 0] / 2
    for system in (plain, nonlinear):
        result = system.simulate(5.3, t_start=-0.5, samples=5, method=method, rtol=1e-9, inputs={"torque.tau": table})
        assert result["body.w"][-1] == pytest.approx(whole / 0.5, rel=1e-7, abs=1e-7)
        if method == "auto" and system is plain:
            assert result.stats["method"] == ("exact" if table.straight else result.stats["method"])
            assert table.straight or "a table of cubics" in result.stats["why"]


def test_a_periodic_table_goes_on_with_a_run_that_goes_on(plain: gl.System) -> None:
    table = gl.Table([0.0, 1.0], [0.0, 1.0], outside="periodic")
    first = plain.simulate(2.5, samples=3, inputs={"torque.tau": table})
    result = plain.simulate(6.0, start=first, samples=3)
    assert result["body.w"][-1] == pytest.approx(6 * 0.5 / 0.5)
    assert plain.simulate(6.0, samples=3, inputs={"torque.tau": table})["torque.tau"] == pytest.approx([0.0, 0.0, 0.0])


def test_pairs_and_series_are_inputs(plain: gl.System) -> None:
    import pandas

    expected = plain.simulate(2.0, samples=5, inputs={"torque.tau": gl.Table([0.0, 2.0], [1.0, 5.0])})["body.w"]
    series = pandas.Series([1.0, 5.0], index=[0.0, 2.0])
    for given_as in (
        ([0.0, 2.0], [1.0, 5.0]),
        (np.array([0.0, 2.0]), [1, 5]),
        series,
        gl.Table.of(series.to_frame("tau"), "tau"),
    ):
        assert np.array_equal(plain.simulate(2.0, samples=5, inputs={"torque.tau": given_as})["body.w"], expected)


@pytest.mark.parametrize(
    "text",
    [
        "t,tau,w\n0,1,9\n2,5,9\n",
        "\ufefft;tau;w\r\n0,0;1,0;9\r\n2,0;5,0;9\r\n",  # as a spreadsheet writes it where the decimal sign is a comma
        "# measured on the bench\nt\ttau\n0\t1\n\n2\t5\n",
        "t tau\n0.0   1.0\n2.0 5e0\n",
        '"t", "tau"\n0, 1\n2, 5\n',
    ],
)
def test_tables_are_read_from_text(text: str, tmp_path: Path) -> None:
    (tmp_path / "torque.csv").write_text(text, encoding="utf-8", newline="")
    table = gl.Table.read(tmp_path / "torque.csv", time="t", column="tau", interpolation="previous")
    assert table([0.0, 1.0, 2.0]) == pytest.approx([1.0, 1.0, 5.0])


@pytest.mark.parametrize("suffix", [".mat", ".nc", ".parquet"])
def test_tables_are_read_from_results(suffix: str, plain: gl.System, tmp_path: Path) -> None:
    result = plain.simulate(2.0, samples=5, inputs={"torque.tau": 1.0})
    result.save(tmp_path / f"r{suffix}")
    assert gl.Table.read(tmp_path / f"r{suffix}", column="body.w")(result.time) == pytest.approx(result["body.w"])


@pytest.mark.parametrize("column", [None, np.array([1.0, 2.0]), np.array([]), NotImplemented, 3])
def test_a_column_is_named_by_a_string(column: Any) -> None:
    with pytest.raises(ArgumentError, match=r"column is .*; expected a name, such as 'tau'"):
        gl.Table.read("t.csv", column=column)


@pytest.mark.parametrize("path", ["t\0.csv", "\ud800.csv"])
def test_what_names_no_file_is_refused(path: str) -> None:
    with pytest.raises(ArgumentError, match=r"path is .*; expected the path of a file, such as"):
        gl.Table.read(path, column="tau")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"t\.csv is empty"),
        ("t,x\n0,1\n", r"t\.csv has no column 'tau'; .*Valid names: t, x"),
        ("t,tau\n0,1\n1,two\n", r"t\.csv, line 3: 'two' in the column tau; expected a number: 1,two"),
        ("# c\nt,tau\n\n0,1\n1\n", r"t\.csv, line 5: nothing in the column tau; expected a number"),
        ("t,tau\n1,1\n0,2\n", r"t\.csv: Table\(t, y\): the times must not decrease"),
        ("t,tau\n0,nan\n", r"t\.csv: Table\(t, y\): y is "),
    ],
)
def test_what_makes_no_table_is_refused(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(text, encoding="utf-8")
    with pytest.raises((FileError, NameLookupError, ArgumentError), match=message):
        gl.Table.read(tmp_path / "t.csv", time="t", column="tau")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: gl.Table([0, 1], [0, 1], "spline"), "interpolation is 'spline'; expected 'linear', 'previous'"),
        (lambda: gl.Table([0, 1], [0, 1], outside="repeat"), "outside is 'repeat'; expected 'hold', 'periodic'"),
        (
            lambda: gl.Table([0, 1, 1, 2], [0, 1, 2, 3], "cubic"),
            "two equal times make a step, which interpolation='cubic' does not know",
        ),
        (lambda: gl.Table([0], [1], outside="periodic"), "a periodic table needs two times or more"),
        (
            lambda: gl.Table([0, 1, 2], [0, 1, 2], "cubic", "periodic"),
            "a smooth periodic table ends with the value that it begins with, got 0 and 2$",
        ),
        (
            lambda: gl.Table([0, 1, 2], [0, 1, 2], "monotone", "periodic"),
            "a smooth periodic table ends with the value that it begins with, got 0 and 2$",
        ),
        (
            lambda: gl.Table([0, 1, 2], [3, 1, 2.5], "akima", "periodic"),
            "a smooth periodic table ends with the value that it begins with, got 3 and 2.5$",
        ),
        (lambda: gl.Table([0, 1e-6], [0, 0], outside="periodic").over(0.0, 1e3), "comes 1000000000 times from 0 to 1000 s"),
        (lambda: gl.Table.of([1, 2]), r"data is \[1, 2\]; expected a pandas Series or DataFrame"),
        (lambda: gl.Table.read("t.csv"), "name the column with the values"),
        (lambda: gl.Table.read("no.csv", column="x"), r"no\.csv cannot be read: No such file"),
    ],
)
def test_wrong_tables_are_refused(make: Any, message: str) -> None:
    with pytest.raises((ArgumentError, FileError), match=message):
        make()


def test_a_column_that_a_frame_has_twice_is_refused() -> None:
    frame = pytest.importorskip("pandas").DataFrame([[1.0, 2.0, 3.0]], columns=["w", "v", "w"])
    assert gl.Table.of(frame, "v")(0.0) == 2.0
    with pytest.raises(ArgumentError, match="the table has 2 columns 'w'; expected one"):
        gl.Table.of(frame, "w")
