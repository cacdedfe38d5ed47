"""Coefficients that are zero where an equation would be divided by them, against equations written by hand."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gearlib as gl
import gearparts as gp
from gearlib.errors import ModelError, SingularError
from gearlib.run.zeros import can_be_solved, factors, nothing_special, special_values, sums

c = gl.connect


class Train(gl.Component):
    """A torque on a body, a spring-damper, a body n that may have no mass, another spring-damper, a body."""

    J = gl.Parameter("kg.m2", "of n", default=1.0, min=0)
    d1 = gl.Parameter("N.m.s/rad", "damping", default=2.0, min=0)
    d2 = gl.Parameter("N.m.s/rad", "damping", default=1.0, min=0)
    c1 = gl.Parameter("N.m/rad", "stiffness", default=100.0, min=0)
    c2 = gl.Parameter("N.m/rad", "stiffness", default=50.0, min=0)

    def assemble(self) -> list[Any]:
        self.torque, self.a = gp.Torque(tau=3.0), gp.Inertia(J=1.0)
        self.s, self.n = gp.SpringDamper(c=self.c1, d=self.d1), gp.Inertia(J=self.J)
        self.k, self.b = gp.SpringDamper(c=self.c2, d=self.d2), gp.Inertia(J=2.0)
        return [
            c(self.torque.flange, self.a.flange_a), c(self.a.flange_b, self.s.flange_a), c(self.s.flange_b, self.n.flange_a),
            c(self.n.flange_b, self.k.flange_a), c(self.k.flange_b, self.b.flange_a),
        ]  # fmt: skip


def by_hand(J: float = 1.0, d1: float = 2.0, d2: float = 1.0, c1: float = 100.0, c2: float = 50.0) -> list[float]:
    """Speeds of a and b after 2 s; n follows from what pulls at it where it has no mass."""

    def rates(t: float, x: Any) -> Any:
        a, b, n, wa, wb, wn = x
        if J == 0.0:
            if d1 + d2 == 0.0:
                n, wn = (c1 * a + c2 * b) / (c1 + c2), (c1 * wa + c2 * wb) / (c1 + c2)
            else:
                wn = (d1 * wa + d2 * wb + c1 * (a - n) + c2 * (b - n)) / (d1 + d2)
        left, right = c1 * (n - a) + d1 * (wn - wa), c2 * (b - n) + d2 * (wb - wn)
        return [wa, wb, wn, 3.0 + left, -right / 2.0, (right - left) / J if J else 0.0]

    found = solve_ivp(rates, (0.0, 2.0), np.zeros(6), method="DOP853", rtol=1e-11, atol=1e-12)
    return [float(found.y[3, -1]), float(found.y[4, -1])]


CASES: list[dict[str, float]] = [
    {}, {"J": 0}, {"d1": 0}, {"d1": 0, "d2": 0}, {"J": 0, "d1": 0}, {"J": 0, "d1": 0, "d2": 0}, {"J": 0, "c1": 0},
    {"J": 0, "c1": 0, "c2": 0}, {"J": 0, "c1": 0, "d2": 0}, {"J": 0, "c2": 0, "d2": 0},
]  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_node_without_mass_damping_or_stiffness(case: dict[str, float]) -> None:
    right = by_hand(**case)
    one = gl.compile(Train())
    other = gl.compile(Train(**case))
    for system, parameters in ((one, case), (other, {})):
        for method in ("rk", "ida", "auto"):
            result = system.simulate(2.0, samples=3, rtol=1e-9, method=method, parameters=parameters)
            assert [result["a.w"][-1], result["b.w"][-1]] == pytest.approx(right, rel=1e-5, abs=1e-7)
            assert result["n.flange_a.tau"][-1] + result["n.flange_b.tau"][-1] == pytest.approx(
                case.get("J", 1.0) * result["der(n.w)"][-1] if case.get("J", 1.0) else 0.0, abs=1e-9
            )


def test_every_set_of_zeros_is_translated_once_and_said_in_the_summary() -> None:
    system = gl.compile(Train())
    whole = system.translation
    assert whole.fitted({})[0] is whole
    assert whole.fitted({"d1": 0.0})[0] is whole  # nothing is divided by it
    without = whole.fitted({"J": 0.0})[0]
    assert without is not whole
    assert without is whole.fitted({"J": 0.0})[0] is without.fitted({"J": 0.0})[0]
    assert without.fitted({})[0] is whole
    for given in ({}, {"J": 0.0}, {"d1": 0.0, "J": 2.0}):  # all have one table of parameters
        found, numbers = whole.fitted(given)
        assert numbers.tolist() == found.parameter_values(given).tolist()
        assert [*found.model.parameters.index] == [*whole.model.parameters.index]
    massless = gl.System(without)
    assert "zeros       translated with these values, at which a coefficient is zero: n.J = 0" in massless.summary()
    assert "zeros" not in system.summary()
    poles = [
        np.sort_complex(np.linalg.eigvals(s.linearize(["torque.tau"], ["a.w"], parameters={"J": J}).A))
        for s, J in ((system, 0.0), (massless, 0.0), (gl.compile(Train(J=0.0)), 0.0))
    ]
    assert poles[0] == pytest.approx(poles[2], abs=1e-9)
    assert poles[1] == pytest.approx(poles[2], abs=1e-9)
    assert gl.modes(system, parameters={"J": 0.0}).frequencies == pytest.approx(gl.modes(gl.compile(Train(J=0.0))).frequencies)


class Supported(gl.Component):
    """Two bodies joined by a gear whose support, without inertia, hangs on a spring: a spring of ``c / (1 - ratio)**2`` between them."""

    ratio = gl.Parameter("1", "of the gear", default=0.5)

    def assemble(self) -> list[Any]:
        self.torque, self.a, self.b = gp.Torque(tau=3.0), gp.Inertia(J=1.0), gp.Inertia(J=1.0)
        self.gear, self.spring = gp.IdealGear(ratio=self.ratio, use_support=True), gp.Spring(c=2.0)
        return [
            c(self.torque.flange, self.a.flange_a), c(self.a.flange_b, self.gear.flange_a), c(self.gear.flange_b, self.b.flange_a),
            c(self.gear.support, self.spring.flange_a), c(self.spring.flange_b, self.b.flange_b),
        ]  # fmt: skip


@pytest.mark.parametrize("method", ["rk", "ida", "exact", "auto"])
def test_a_sum_that_cancels(method: str) -> None:
    """A gear with ratio 1 says nothing of its support, whose coefficient is 1 - ratio: both bodies turn as one."""
    systems = [gl.compile(Supported()), gl.compile(Supported(ratio=1.0))]
    for system in systems:
        for ratio, right in ((0.5, 3.0 + 0.375 * np.sin(8.0)), (1.0, 3.0)):
            result = system.simulate(2.0, samples=3, rtol=1e-9, method=method, parameters={"ratio": ratio})
            assert result["a.w"][-1] == pytest.approx(right, rel=1e-7)
            assert result["gear.support.tau"] == pytest.approx(-result["spring.flange_a.tau"], abs=1e-9)
    assert "zeros       translated with these values, at which a coefficient is zero: gear.ratio = 1" in systems[1].summary()
    assert gl.modes(systems[0]).frequencies[-1] == pytest.approx(4 / (2 * np.pi))
    assert not np.any(gl.modes(systems[0], parameters={"ratio": 1.0}).frequencies)


def test_results_with_zeros_survive_pickling() -> None:
    result = gl.compile(Train()).simulate(1.0, samples=3, parameters={"J": 0.0})
    again = pickle.loads(pickle.dumps(result))
    assert again["n.w"].tolist() == result["n.w"].tolist()
    assert again["k.tau"] == pytest.approx(result["k.tau"])
    result = gl.compile(Supported()).simulate(1.0, samples=3, parameters={"ratio": 1.0})
    assert pickle.loads(pickle.dumps(result))["b.w"].tolist() == result["b.w"].tolist()


def test_a_run_with_zeros_goes_on() -> None:
    system = gl.compile(Train())
    half = system.simulate(1.0, samples=3, parameters={"J": 0.0}, rtol=1e-9)
    rest = system.simulate(2.0, samples=2, start=half, rtol=1e-9)
    assert [rest["a.w"][-1], rest["b.w"][-1]] == pytest.approx(by_hand(J=0.0), rel=1e-6)


def test_a_massless_node_that_nothing_holds_is_refused_by_name() -> None:
    class Loose(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.a, self.n = gp.Torque(tau=1.0), gp.Inertia(J=1.0), gp.Inertia(J=0.0)
            return [c(self.torque.flange, self.a.flange_a)]

    with pytest.raises(ModelError, match=r"with n\.J = 0: .*n\."):
        gl.compile(Loose()).simulate(1.0)
    result = gl.compile(Loose()).simulate(1.0, samples=2, parameters={"n.J": 1.0})  # a default that is to be replaced
    assert result["n.w"].tolist() == [0.0, 0.0]


class First(gl.Component):
    x = gl.Variable("1", "")
    p, q = gl.Parameter("1", default=3.0), gl.Parameter("1", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq((self.p - self.q) * gl.der(self.x), 1)]


class Second(gl.Component):
    y = gl.Variable("1", "")
    p, q = gl.Parameter("1", default=3.0), gl.Parameter("1", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq((self.p + self.q) * gl.der(self.y), 1)]


@pytest.mark.parametrize(
    ("parameters", "named"),
    [
        ({"one[1].q": 3.0}, r"one\[1\]: First: .* with one\[1\]\.p = 3, one\[1\]\.q = 3; division by zero"),
        ({"other[0].q": -3.0}, r"other\[0\]: Second: .* with other\[0\]\.p = 3, other\[0\]\.q = -3; division by zero"),
        ({"other[1].q": -3.0}, r"other\[1\]: Second: .* with other\[1\]\.p = 3, other\[1\]\.q = -3; division by zero"),
    ],
)
def test_a_zero_divisor_is_named_in_whichever_batch_it_stands(parameters: dict[str, float], named: str) -> None:
    class Both(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.other = [First(), First(), First()], [Second(), Second()]
            return []

    with pytest.raises(SingularError, match=named):
        gl.compile(Both()).simulate(1.0, parameters=parameters)


@pytest.mark.parametrize("zeros", [{"J": 0.0}, {"d1": 0.0}, {"J": 0.0, "c1": 0.0}])
def test_a_run_with_zeros_is_audited(zeros: dict[str, float]) -> None:
    """The energies are those of the translation that fits: what has no inertia stores nothing, what has no damping loses nothing."""
    system = gl.compile(Train())
    result = system.simulate(2.0, samples=5, audit=True, parameters=zeros, rtol=1e-9)
    balance = result.energy_balance()
    bodies = (result["a.w"] ** 2 + zeros.get("J", 1.0) * result["n.w"] ** 2 + 2.0 * result["b.w"] ** 2) / 2
    springs = (zeros.get("c1", 100.0) * result["s.phi_rel"] ** 2 + 50.0 * result["k.phi_rel"] ** 2) / 2
    assert sum(balance.stored.values()) == pytest.approx(bodies + springs, rel=1e-6, abs=1e-9)
    assert np.abs(balance.residual).max() < 1e-7
    assert result.stats["energy_residual"] < 1e-7
    if "d1" in zeros:
        assert not np.any(balance.heat.get("s", 0.0))


def test_values_at_which_a_coefficient_vanishes() -> None:
    """A factor that is zero; a sum that cancels, with all of its parameters, unless one of them is a zero factor already."""
    model = gl.compile(Supported()).translation.model
    multiplied, added = factors(model), sums(model)
    names, table = list(model.parameters.names), model.parameters.defaults.copy()
    assert special_values(multiplied, added, table) == frozenset()
    both = np.stack([table, table], axis=1)
    place = names.index("gear.ratio")
    both[place, 1] = 1.0
    assert special_values(multiplied, added, both[:, 1]) == {(place, 1.0)}
    assert nothing_special(multiplied, added, both).tolist() == [True, False]
    zero = int(next(p for p in multiplied if names[p].endswith(".J")))
    both[zero, 0] = 0.0
    assert special_values(multiplied, added, both[:, 0]) == {(zero, 0.0)}
    both[zero, 1] = 0.0
    assert special_values(multiplied, added, both[:, 1]) == {(zero, 0.0), (place, 1.0)}
    assert nothing_special(multiplied, added, both).tolist() == [False, False]


class Iterated(gl.Component):
    """Two unknowns of nonlinear equations: one has a factor that varies, the other a constant one."""

    p, q, k = (gl.Parameter("any", default=v) for v in (1.0, 2.0, 3.0))
    x, y, z = gl.Variable("any", start=1.0), gl.Variable("any"), gl.Variable("any")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), -self.y),
            gl.Eq(self.p * self.y + self.q * self.y**3 + self.z, self.x),
            gl.Eq(self.k * self.z + self.y * self.z**2, self.x),
        ]


@pytest.mark.parametrize(
    ("values", "solved"), [({}, True), ({"p": 0.0}, True), ({"q": 0.0}, True), ({"p": 0.0, "q": 0.0}, True)]
)
def test_factors_that_vary_in_a_run_are_not_judged_before_it(values: dict[str, float], solved: bool) -> None:
    translation = gl.compile(Iterated()).translation
    assert can_be_solved(translation.scene, translation.parameter_values(values)) == solved


def test_a_constant_factor_in_equations_that_are_iterated() -> None:
    """Zero, it is a divisor of the matrix: k, which multiplies z alone."""

    class Mixed(gl.Component):
        k = gl.Parameter("any", default=3.0)
        x, y, z = gl.Variable("any", start=1.0), gl.Variable("any"), gl.Variable("any")

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(gl.der(self.x), -self.y),
                gl.Eq(self.y + self.y**3 + self.z, self.x),
                gl.Eq(self.k * self.z + self.y**2, self.x),
            ]

    translation = gl.compile(Mixed()).translation
    assert can_be_solved(translation.scene, translation.parameter_values({}))
    assert not can_be_solved(translation.scene, translation.parameter_values({"k": 0.0}))
    alone = gl.compile(First()).translation
    assert can_be_solved(alone.scene, alone.parameter_values({}))
    assert not can_be_solved(alone.scene, alone.parameter_values({"q": 3.0}))


def test_a_constant_factor_in_what_decides_a_relation() -> None:
    """The rate follows from the relation alone, this from equations that are iterated."""

    class Decided(gl.Component):
        k = gl.Parameter("any", default=3.0)
        x, y, z = gl.Variable("any", start=1.0), gl.Variable("any"), gl.Variable("any")

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(gl.der(self.x), gl.Piecewise((1.0, self.z > 0.1), (2.0, True))),
                gl.Eq(self.y + self.y**3 + self.z, self.x),
                gl.Eq(self.k * self.z + self.y**2, self.x),
            ]

    translation = gl.compile(Decided(), outputs=["x"]).translation
    assert can_be_solved(translation.scene, translation.parameter_values({}))
    assert not can_be_solved(translation.scene, translation.parameter_values({"k": 0.0}))
