"""Quadrature of an energy audit: its nodes and weights, and balances of made-up parts with known integrals."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy

from gearlib.errors import NameLookupError, SolverError
from gearlib.flatten.energies import NOTHING, Audited, Formula, Term
from gearlib.run.energy.audit import ENDS, GAUSS, KRONROD, NODES, balance, explained
from gearlib.run.energy.energy_balance import EnergyBalance

T = np.linspace(0.0, 2.0, 5)


def test_nodes_and_weights_integrate_polynomials() -> None:
    """Kronrod's up to degree 22, Gauss's, at every other node, up to 13 and no further."""
    assert np.polynomial.legendre.leggauss(7)[0] == pytest.approx(NODES[1::2], abs=1e-15)
    assert np.polynomial.legendre.leggauss(7)[1] == pytest.approx(GAUSS[1::2], abs=1e-15)
    assert (GAUSS[::2] == 0.0).all()
    assert (np.diff(NODES) > 0).all()
    for degree in range(24):
        exact = 2.0 / (degree + 1) if degree % 2 == 0 else 0.0
        assert NODES**degree @ KRONROD == pytest.approx(exact, abs=1e-14)
        assert (NODES**degree @ GAUSS == pytest.approx(exact, abs=1e-14)) == (degree < 14 or degree % 2 == 1)


def test_values_at_the_ends_are_extrapolated() -> None:
    for degree in range(15):
        assert ENDS @ NODES**degree == pytest.approx([(-1.0) ** degree, 1.0], abs=1e-9)


def term(**values: str) -> Term:
    """A formula of some histories; the key is its text."""
    ((_, text),) = values.items()
    expression = sympy.sympify(text)
    symbols = tuple(sorted(expression.free_symbols, key=str))
    return Term(
        tuple(str(s).replace("der_", "der(") + ")" * str(s).startswith("der_") for s in symbols), Formula(symbols, expression)
    )


def part(path: str, through: str = "0", **more: Any) -> Audited:
    given: dict[str, Any] = {name: term(f=more.pop(name)) for name in ("heat_in", "stored", "heat", "supplied") if name in more}
    terms = {name: given.get(name) for name in ("heat_in", "stored", "heat", "supplied")}
    flags = {"declares": True, "source": False, "unknown": False} | more
    return Audited(path, "Part", NOTHING if through == "0" else term(f=through), **terms, **flags)


def audit(
    *parts: Audited, histories: dict[str, Callable[[Any], Any]], events: Any = (), rtol: float = 1e-6, samples: Any = T,
    slowest: float = 0.0, runs: list[int] | None = None,
) -> Any:  # fmt: skip
    def run(times: Any) -> Any:
        assert (np.diff(times) > 0).all()
        if runs is not None:
            runs.append(len(times))

        class Found(dict[str, Any]):
            time = times

            def __missing__(self, name: str) -> Any:
                if name not in histories:
                    raise NameLookupError(name)
                return histories[name](times)

        return Found()

    return balance(parts, samples, events, rtol, run, {"k": 3.0}, slowest)


def test_one_source_one_store_and_one_loss() -> None:
    """w = t: a source of power 5 w, a body that stores w^2 and takes 2 w, and a brake that turns 3 w into heat."""
    source, body = part("source", "-5*w", source=True), part("body", "2*w", stored="w**2")
    brake = part("brake", "k*w", heat="3*w")
    found = audit(source, body, brake, histories={"w": lambda t: t})
    assert found.time == pytest.approx(T)
    assert {name: value == pytest.approx(2.5 * T**2) for name, value in found.work.items()} == {"source": True}
    assert found.stored["body"] == pytest.approx(T**2, abs=1e-12)
    assert list(found.stored) == ["body"]
    assert found.heat["brake"] == pytest.approx(1.5 * T**2)
    for path in ("source", "body", "brake"):
        assert found.residuals[path] == pytest.approx(np.zeros(5), abs=1e-12)
    assert found.residual == pytest.approx(np.zeros(5), abs=1e-12)
    assert found.throughput == pytest.approx((10.0 + 4.0 + 6.0 + 6.0) / 2 + 4.0)  # half of all powers, and what is stored
    assert (found.returned.tolist(), found.jumps, found.unaccounted, found.unknown) == ([0.0] * 5, {}, {}, ())
    assert (found.rtol, found.unresolved) == (1e-6, 0.0)


@pytest.mark.parametrize("level", [9.0, -1.0, -20.0])
def test_the_level_of_what_is_stored_does_not_matter(level: float) -> None:
    """Only its change is an energy exchanged: half of the power put in and taken, and that."""
    found = audit(
        part("source", "-2*w", source=True), part("body", "2*w", stored=f"w**2 + {level}"), histories={"w": lambda t: t}
    )
    assert found.stored["body"] == pytest.approx(T**2 + level, abs=1e-12)
    assert found.throughput == pytest.approx((4.0 + 4.0) / 2 + 4.0)
    assert found.largest_residual < 1e-12


def test_a_part_that_stores_the_wrong_sign_keeps_a_residual() -> None:
    found = audit(part("body", "2*w", stored="-w**2"), histories={"w": lambda t: t})
    assert found.residuals["body"] == pytest.approx(-2 * T**2, abs=1e-12)
    assert found.residual == pytest.approx(-(T**2) - 0.0, abs=1e-12)
    found = audit(part("brake", "2*w", heat="w"), histories={"w": lambda t: t})
    assert found.residuals["brake"] == pytest.approx(-0.5 * T**2, abs=1e-12)


def test_what_is_supplied_from_within_is_work() -> None:
    """A prescribed excitation: power 4 t that flows out of the part."""
    found = audit(part("mesh", "-4*w", supplied="4*w"), histories={"w": lambda t: t})
    assert found.work["mesh"] == pytest.approx(2 * T**2)
    assert found.residuals["mesh"] == pytest.approx(np.zeros(5), abs=1e-12)


def test_heat_that_comes_back_through_ports() -> None:
    """A damper of 3 w gives its heat to a body of heat through a port: nothing leaves the model."""
    damper, warm = part("damper", "3*w", heat="3*w", heat_in="-3*w"), part("warm", "3*w", stored="1.5*w**2")
    found = audit(damper, warm, histories={"w": lambda t: t})
    assert found.returned == pytest.approx(1.5 * T**2)
    assert found.residuals["damper"] == pytest.approx(np.zeros(5), abs=1e-12)
    assert found.residuals["warm"] == pytest.approx(np.zeros(5), abs=1e-12)


def test_jumps_at_events_only() -> None:
    """A store that jumps by 2 at t = 0.7 is explained there; one that jumps where no event is keeps a residual."""
    step = {"e": lambda t: np.where(t < 0.7, 1.0, 3.0)}
    found = audit(part("spring", stored="e"), histories=step, events=[0.7, 0.0, 2.0, 5.0])
    expected = np.where(T < 0.7, 0.0, 2.0)
    assert found.jumps["spring"] == pytest.approx(expected, abs=1e-9)
    assert found.residuals["spring"] == pytest.approx(np.zeros(5), abs=1e-9)
    silent = audit(part("spring", stored="e"), histories={"e": lambda t: np.where(t < 1.0, 1.0, 3.0)})
    assert silent.jumps == {}
    assert silent.residuals["spring"] == pytest.approx(np.where(T < 1.0, 0.0, 2.0), abs=1e-9)


def test_parts_of_which_nothing_is_known() -> None:
    """One that declares nothing has unaccounted energy; one without a history, or of an unknown connector, is named once."""
    silent = part("silent", "2*w", declares=False, heat_in="w")
    lost, strange = part("lost", "x*w"), part("strange", "w", unknown=True)
    found = audit(silent, lost, strange, histories={"w": lambda t: t})
    assert found.unaccounted["silent"] == pytest.approx(1.5 * T**2)
    assert sorted(found.unknown) == ["lost", "strange"]
    assert (found.residuals, found.work, found.heat) == ({}, {}, {})


def test_panels_are_cut_until_the_powers_are_resolved() -> None:
    """A pulse of 1/100 of the span between two samples is found; a smooth power takes a single pass."""
    runs: list[int] = []
    pulse = {"w": lambda t: np.exp(-(((t - 0.77) / 0.01) ** 2)) + 0.1 * np.sin(40 * t) ** 2}
    found = audit(part("source", "-w", source=True), histories=pulse, runs=runs)
    exact = 0.01 * math.sqrt(math.pi) + 0.05 * (2.0 - math.sin(160.0) / 80.0)
    assert found.work["source"][-1] == pytest.approx(exact, rel=1e-7)
    assert found.quadrature < 1e-7 * exact
    assert len(runs) > 2
    assert sorted(runs) == runs
    runs.clear()
    audit(part("source", "-w", source=True), histories={"w": lambda t: t}, runs=runs)
    assert runs == [4 * 15 + 1]  # and the end


def test_many_samples_are_thinned_out_and_the_last_one_kept() -> None:
    samples = np.linspace(0.0, 1.0, 2502)
    found = audit(part("source", "-w", source=True), histories={"w": lambda t: t}, samples=samples)
    assert len(found.time) <= 1001
    assert (found.time[0], found.time[-1]) == (0.0, 1.0)
    assert found.time[:3] == pytest.approx([0.0, 3 / 2501, 6 / 2501])
    assert found.work["source"] == pytest.approx(found.time**2 / 2)


def test_events_at_one_place_make_no_panel() -> None:
    """Closer together than 1e-10 of the run; the work is the same."""
    events = [0.6, 0.6 + 1e-11, 0.6 + 2e-11]
    runs: list[int] = []
    found = audit(part("source", "-w", source=True), histories={"w": lambda t: t}, events=events, runs=runs)
    assert runs == [5 * 15 + 1]  # and the end
    assert found.work["source"] == pytest.approx(T**2 / 2)
    just_before = audit(part("source", "-w", source=True), histories={"w": lambda t: t}, events=[1.0 - 8e-11])
    assert just_before.work["source"] == pytest.approx(T**2 / 2)


def test_exchange_at_the_speed_of_the_tolerance() -> None:
    """A torque of 3 at a speed of 1e-3 over 2 s exchanges 6e-3 J, half of which is counted."""
    moved = Term(("der(phi)", "tau"), Formula(tuple(sympy.symbols("a b")), sympy.Symbol("a") * sympy.Symbol("b")))
    body = SimpleNamespace(**vars(part("body")) | {"through": moved})
    found = audit(body, histories={"der(phi)": lambda t: 0.0 * t, "tau": lambda t: 3.0 + 0.0 * t}, slowest=1e-3)  # type: ignore[arg-type]
    assert found.unresolved == pytest.approx(3e-3)
    assert found.throughput == 0.0
    assert found.scale == pytest.approx(3e-3)


def residual(size: float, scale: float = 1.0, quadrature: float = 0.0, rtol: float = 1e-6, **more: Any) -> EnergyBalance:
    """A balance of which only the residual of the whole is known, and the energy that was exchanged."""
    known: dict[str, Any] = {kind: {} for kind in ("work", "stored", "heat", "jumps", "unaccounted", "residuals")}
    found = {"time": np.array([0.0, 1.0]), "returned": np.zeros(2), "unknown": (), "residual": np.array([0.0, size])}
    return EnergyBalance(**{**known, **found, "throughput": scale, "quadrature": quadrature, "rtol": rtol, **more})


@pytest.mark.parametrize(
    ("size", "quadrature", "at_once"),
    [(0.99e-4, 0.0, True), (1.01e-4, 0.0, False), (1.009e-2, 1e-3, True), (1.011e-2, 1e-3, False), (0.0, 0.0, True)],
)
@pytest.mark.parametrize(("exchanged", "at_rest"), [(1.0, 0.0), (100.0, 0.0), (0.25, 0.75)])
def test_a_residual_that_the_tolerance_explains_at_once(
    size: float, quadrature: float, at_once: bool, exchanged: float, at_rest: float
) -> None:
    """A hundred tolerances, and ten errors of the quadrature, of what was exchanged; without a second run."""
    asked: list[float] = []
    scale = exchanged + at_rest
    found = residual(size * scale, exchanged, quadrature * scale, unresolved=at_rest)

    def tighter(rtol: float) -> EnergyBalance:
        asked.append(rtol)
        return found

    assert explained(found, tighter) == at_once
    assert asked == ([] if at_once else [1e-8])


@pytest.mark.parametrize(("share", "is_explained"), [(0.099, True), (0.101, False), (1.0, False), (0.0, True)])
@pytest.mark.parametrize("size", [0.02, 3.0])
def test_a_residual_that_shrinks_with_the_tolerance(share: float, is_explained: bool, size: float) -> None:
    """To a tenth; what a tolerance of a tenth of that explains is small enough where more is exchanged."""
    assert explained(residual(size), lambda rtol: residual(share * size)) == is_explained
    assert explained(residual(1.0), lambda rtol: residual(9.0, 1e6))
    assert not explained(residual(1.0), lambda rtol: residual(11.0, 1e6))


def test_what_cannot_be_explained_or_told() -> None:
    """The tolerance of the second run is 1e-12 at least; one that fails explains nothing; an unknown power says nothing."""
    asked: list[float] = []

    def fails(rtol: float) -> EnergyBalance:
        asked.append(rtol)
        raise SolverError("too tight")

    assert not explained(residual(1.0, rtol=1e-11), fails)
    assert not explained(residual(1.0, rtol=1e-3), fails)
    assert asked == [1e-12, 1e-5]
    assert explained(residual(1.0, unknown=("wire",)), fails)
    assert len(asked) == 2


@pytest.mark.parametrize("before", [8e-11, 1.2e-10, 1.9e-10, 2.1e-10, 1e-9])
def test_an_event_just_before_a_sample_moves_no_energy(before: float) -> None:
    """Whether or not both are taken for one, which 1e-10 of the run decides; also of several events in a row."""
    for events in ([1.0 - before], [1.0 - 1.9 * before, 1.0 - before], [0.5 - before, 1.5 - before, 2.0 - before, before]):
        found = audit(part("source", "-w", source=True), histories={"w": lambda t: t}, events=events)
        assert found.time.tolist() == T.tolist()
        assert found.work["source"] == pytest.approx(T**2 / 2, abs=1e-8)


def test_a_power_that_is_never_resolved_ends_the_refinement() -> None:
    """A step at no event: panels are cut around it seven times, and the work is known to a part of the last one."""
    runs: list[int] = []
    found = audit(part("source", "-w", source=True), histories={"w": lambda t: 1.0 * (t > 0.7123)}, runs=runs)
    assert len(runs) == 8
    assert found.work["source"] == pytest.approx(np.maximum(T - 0.7123, 0.0), abs=1e-4)


def test_every_part_that_declares_nothing_is_listed() -> None:
    """Also one behind others, and what is declared behind them."""
    one, other = part("one", "2*w", declares=False), part("other", "-4*w", declares=False)
    found = audit(one, other, part("source", "-6*w", source=True), histories={"w": lambda t: t})
    assert {path: value[-1] for path, value in found.unaccounted.items()} == pytest.approx({"one": 4.0, "other": -8.0})
    assert found.work["source"] == pytest.approx(3.0 * T**2)
