"""Every run can be audited: work put in, energy stored, heat, jumps at events, over time and in sum."""

from __future__ import annotations

import pickle
import warnings
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.bondgraph import BondGraph, C, I, One, R, Se
from gearlib.errors import DeclarationError
from gearlib.flatten.energies import audited
from gearlib.run.energy.audit import energy_balance, explained
from gearlib.run.energy.energy_balance import EnergyBalance
from tests.gearparts.bench import bench, structural_choices

EXPORTED = [getattr(gp, name) for name in gp.__all__ if name not in ("BondGraphPart", "FMU")]
COMPONENTS = [c for c in EXPORTED if isinstance(c, type) and issubclass(c, gl.Component)]


def chain(*parts: gl.Component) -> gl.Component:
    """Parts in a row, named a, b, c, ..., joined from flange_b (or flange) to flange_a (or flange)."""

    class Chain(gl.Component):
        def assemble(self) -> Any:
            names = "abcdefgh"[: len(parts)]
            for name, part in zip(names, parts, strict=True):
                setattr(self, name, part)

            def end(part: gl.Component, side: str) -> Any:
                return getattr(part, side if side in part._declarations else "flange")

            return [gl.connect(end(x, "flange_b"), end(y, "flange_a")) for x, y in zip(parts[:-1], parts[1:], strict=True)]

    return Chain()


@pytest.mark.parametrize("samples", [2, 3, 11])
def test_a_flywheel_in_its_bearing_by_hand(samples: int) -> None:
    """w = 3 exp(-t / 2): the damper takes what the body had, however few samples there are."""
    result = gl.simulate(
        chain(gp.Inertia(J=2.0, start={"w": 3.0}), gp.Damper(d=1.0), gp.Fixed()), 2.0, samples=samples, rtol=1e-9
    )
    found, t = result.energy_balance(), np.linspace(0.0, 2.0, samples)
    assert found.time == pytest.approx(t)
    assert found.stored["a"] == pytest.approx(9.0 * np.exp(-t), rel=1e-8)
    assert found.heat["b"] == pytest.approx(9.0 * (1 - np.exp(-t)), abs=1e-8)
    assert found.work["c"] == pytest.approx(np.zeros(samples), abs=1e-12)
    assert np.abs(found.residual).max() < 1e-8
    assert (found.jumps, found.unaccounted, found.unknown) == ({}, {}, ())
    rows = dict(line.rsplit(maxsplit=1) for line in str(found).splitlines()[1:-1])
    assert list(rows) == ["work put in", "  c", "heat", "  b", "stored, change", "  a"]
    lost = 9.0 * (1 - np.exp(-2.0))
    assert [float(number) for number in rows.values()] == pytest.approx([0, 0, lost, lost, -lost, -lost], rel=1e-5, abs=1e-12)


def test_work_of_a_source_by_hand() -> None:
    """tau = 3 sin(2 t) on J = 0.5: w = 3 (1 - cos(2 t)), and all work is in the body; 40 turns between two samples."""
    result = gl.simulate(chain(gp.Torque(tau=3 * gl.sin(2 * gl.time)), gp.Inertia(J=0.5)), 40.0, samples=2, rtol=1e-10)
    w = 3 * (1 - np.cos(80.0))
    found = result.energy_balance()
    assert found.work["a"][-1] == pytest.approx(0.25 * w**2, rel=1e-7)
    assert found.stored["b"][-1] == pytest.approx(0.25 * w**2, rel=1e-7)


@pytest.mark.parametrize("times", [[2.0], [1.0, 2.0]])
def test_it_counts_from_the_start_of_the_run_wherever_the_samples_begin(times: list[float]) -> None:
    class Drive(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.load = gp.Torque(tau=3.0), gp.Inertia(J=1.0)
            return [gl.connect(self.torque.flange, self.load.flange_a)]

    found = gl.compile(Drive(), outputs=["load.w"]).simulate(2.0, times=times).energy_balance()
    assert found.time.tolist() == [0.0, *times]
    assert found.work["torque"] == pytest.approx(4.5 * found.time**2)
    assert found.stored["load"] == pytest.approx(4.5 * found.time**2)


def test_a_source_between_two_bodies_puts_its_work_into_both() -> None:
    """tau = 3 sin(2 t) on 0.5 and against 1.5: the speeds are 3 (1 - cos(2 t)) and a third of that, the other way."""
    parts = gp.Inertia(J=1.5), gp.Torque2(tau=3 * gl.sin(2 * gl.time)), gp.Inertia(J=0.5)
    found = gl.simulate(chain(*parts), 1.0, samples=2, rtol=1e-10).energy_balance()
    w = 3 * (1 - np.cos(2.0))
    assert list(found.work) == ["b"]
    assert found.work["b"][-1] == pytest.approx(0.25 * w**2 + 0.75 * (w / 3) ** 2, rel=1e-7)
    assert (found.heat, found.unaccounted, found.unknown) == ({}, {}, ())


def test_a_clutch_that_engages_turns_speed_into_heat() -> None:
    """Two bodies that come to one speed: the heat is J_a J_b / (2 (J_a + J_b)) w**2, whatever the torque."""
    clutch = gp.Clutch(fn_max=20.0, f_normalized=gl.Piecewise((0, gl.time < 0.3), (1, True)))
    result = gl.simulate(chain(gp.Inertia(J=1.0, start={"w": 10.0}), clutch, gp.Inertia(J=2.0)), 3.0, samples=4)
    found = result.energy_balance()
    assert found.heat["b"][-1] == pytest.approx(0.5 * (1.0 * 2.0 / 3.0) * 100.0, rel=1e-5)
    assert found.relative_residual < 1e-5
    assert found.jumps == {}


class Ball(gl.Component):
    """Falls on the ground and bounces: a user's part that says what it stores."""

    m = gl.Parameter("kg", default=2.0)
    h = gl.Variable("m", start=1.0)
    v = gl.Variable("m/s")
    at = gp.TranslationalFlange("ball")

    def equations(self) -> Any:
        return [
            gl.Eq(self.h, self.at.s),
            gl.Eq(self.v, gl.der(self.h)),
            gl.Eq(self.m * gl.der(self.v), self.at.f - 9.81 * self.m),
            gl.When(self.h < 0, gl.reinit(self.v, -0.8 * self.v)),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy(stored=self.m * self.v**2 / 2 + self.m * 9.81 * self.h)


def test_impacts_are_jumps() -> None:
    found = gl.simulate(Ball(), 1.5, samples=3).energy_balance()  # bounces at 0.4515 s and 1.174 s
    height = 2.0 * 9.81 * np.array([1.0, 0.8**2, 0.8**4])
    assert found.stored["Ball"] == pytest.approx(height, rel=1e-6)
    assert found.jumps["Ball"] == pytest.approx(height - height[0], rel=1e-6, abs=1e-9)
    assert np.abs(found.residual).max() < 1e-6


@pytest.mark.parametrize("beside", [-1e-12, -2e-16, 0.0, 2e-16, 1e-12, 1e-9])
@pytest.mark.parametrize("method", ["rk5", "ida"])
def test_an_impact_at_a_sample_or_at_the_end_is_a_jump(method: str, beside: float) -> None:
    """The run finds the impact at the root of 2/9.81 with a rounding of its own; its last sample has the energy behind the impact."""
    impact = np.sqrt(2 / 9.81) * (1 + beside)
    found = gl.simulate(Ball(), 0.6, times=[0.0, impact, 0.6], method=method).energy_balance()
    assert found.stored["Ball"] == pytest.approx(2.0 * 9.81 * np.array([1.0, 0.64, 0.64]), rel=1e-6)
    assert found.jumps["Ball"] == pytest.approx(2.0 * 9.81 * np.array([0.0, -0.36, -0.36]), rel=1e-6, abs=1e-9)
    assert np.abs(found.residual).max() < 1e-6
    run = gl.simulate(Ball(), impact, samples=2, method=method)
    last, found = run["v"][-1] ** 2 + 2.0 * 9.81 * run["h"][-1], run.energy_balance()
    assert found.stored["Ball"] == pytest.approx([2.0 * 9.81, last], rel=1e-9)
    assert found.jumps.get("Ball", [0.0])[-1] == pytest.approx(last - 2.0 * 9.81, rel=1e-6, abs=1e-6)
    assert np.abs(found.residual).max() < 1e-6


def test_heat_that_goes_into_a_body_stays_in_the_model() -> None:
    class Warm(gl.Component):
        def assemble(self) -> Any:
            self.body, self.damper, self.ground = (
                gp.Inertia(J=2.0, start={"w": 3.0}),
                gp.Damper(d=1.0, use_heat_port=True),
                gp.Fixed(),
            )
            self.mass, self.path, self.air = gp.HeatCapacitor(C=4.0), gp.ThermalConductor(G=2.0), gp.FixedTemperature(T=293.15)
            return [
                gl.connect(self.body.flange_b, self.damper.flange_a),
                gl.connect(self.damper.flange_b, self.ground.flange),
                gl.connect(self.damper.heat_port, self.mass.port, self.path.port_a),
                gl.connect(self.path.port_b, self.air.port),
            ]

    result = gl.simulate(Warm(), 3.0, samples=4, rtol=1e-9)
    found, t = result.energy_balance(), np.linspace(0.0, 3.0, 4)
    assert found.heat["damper"] == pytest.approx(9.0 * (1 - np.exp(-t)), abs=1e-7)
    assert found.returned == pytest.approx(found.heat["damper"], abs=1e-9)
    assert found.heat["air"] == pytest.approx(found.heat["damper"] - 4.0 * (result["mass.T"] - 293.15), abs=1e-6)
    assert "heat that stays" in str(found)


# ---------------------------------------------------------------- all components


STILL = (  # on the bench nothing moves, or all is at one temperature
    gp.Convection, gp.Fixed, gp.FixedTemperature, gp.HeatCapacitor, gp.ThermalConductor, gp.TranslationalFixed,
)  # fmt: skip


PRESENT = gl.offered({  # what is zero unless it is given
    "b": 0.02, "c_3": 4.0, "phi_rel0": 0.1, "s_rel0": 0.1, "delta_phi": 0.3, "phi0": 0.2, "s0": 0.2, "L": 0.4, "d_phi": 0.6, "k_phi": 3.0,
    "z_a": 30.0, "d": 0.5, "d_sp": 0.5, "d_rp": 0.4, "C_ring": 0.5, "C_sun": 0.4, "C_v": 0.3,
})  # fmt: skip


def test_every_library_part_declares_its_energies() -> None:
    silent = {
        kind.__name__ for kind in COMPONENTS for p in audited(bench(kind, **next(structural_choices(kind)))) if not p.declares
    }
    assert silent == set()


@pytest.mark.parametrize("kind", COMPONENTS)
def test_between_bodies_it_keeps_its_balance(kind: type[gl.Component]) -> None:
    """With the first and the last of its choices, driven by torques and signals."""
    choices = list(structural_choices(kind))
    if kind is gp.InitializeFlange:  # with all of them the start is over-determined
        choices = choices[:1]
    for choice in [choices[0], choices[-1]] if len(choices) > 1 else choices:
        system = gl.compile(bench(kind, **choice, **{n: v for n, v in PRESENT.items() if n in kind._declarations}))
        planar = any(isinstance(d, gp.PlanarFlange) for d in kind._declarations.values())  # which no source drives
        start = {name: 0.01 * (i + 1) for i, name in enumerate(system.states)} if planar else None
        found = system.simulate(0.1, samples=3, rtol=1e-8, start=start).energy_balance()
        assert found.throughput > 0 or kind in STILL
        assert (found.unaccounted, found.unknown) == ({}, ()), choice
        assert found.relative_residual < 1e-6, (choice, found.worst, str(found))
        assert all(np.diff(heat).min() >= -1e-9 * found.throughput for path, heat in found.heat.items() if "air" not in path)


@pytest.mark.parametrize("stiffness", ["constant", "sinusoidal", "rectangular", "fourier", "table"])
@pytest.mark.parametrize("backlash", [False, True])
def test_a_mesh_that_varies(stiffness: str, backlash: bool) -> None:
    """The transmission error and the stiffness do work; where the stiffness jumps, so does what is stored."""
    more: dict[str, Any] = {
        "sinusoidal": {"c_amplitude": 0.3},
        "rectangular": {"contact_ratio": 1.6},
        "fourier": {"stiffness_terms": ((1.0, 0.2, 0.3), (2.0, 0.1, 0.0))},
        "table": {"stiffness_table": ((0.0, 0.8), (2.0, 1.1), (4.0, 1.2))},
    }.get(stiffness, {})
    more |= {"backlash": True, "b": 1e-4} if backlash else {}
    mesh = gp.DetailedExternalMesh(
        r_a=0.05, r_b=0.1, z_a=20.0, c=1e7, d=200.0, stiffness=stiffness, error_terms=((1.0, 2e-5, 0.4),), friction=True, mu=0.05,
        **more,
    )  # fmt: skip
    load = gp.LinearSpeedDependentTorque(tau_nominal=-20.0, w_nominal=10.0, torque_direction=False)
    model = chain(gp.Torque(tau=10.0), gp.Inertia(J=0.01, start={"w": 20.0}), mesh, gp.Inertia(J=0.05), load)
    found = gl.compile(model).simulate(0.05, samples=3, rtol=1e-9).energy_balance()
    assert found.relative_residual < 1e-6, str(found)
    assert abs(found.work["c"][-1]) > 1e-4
    assert bool(found.jumps) == (stiffness == "rectangular")


def test_xp_train() -> None:
    found = gl.simulate(gp.ZhouCui2022(tau_in=137.0), 0.05, samples=2).energy_balance()
    assert found.relative_residual < 1e-7
    assert found.work["drive"][-1] == pytest.approx(
        sum(h[-1] for h in found.heat.values())
        + sum(e[-1] - e[0] for e in found.stored.values())
        - sum(w[-1] for path, w in found.work.items() if path != "drive"),
        rel=1e-7,
    )


class Flipped(gp.interfaces.TwoFlanges):
    """A spring with a slip: its torque on flange_a has the wrong sign."""

    c = gl.Parameter("N.m/rad")
    d = gl.Parameter("N.m.s/rad")
    phi_rel = gl.Variable("rad", state="prefer")
    tau = gl.Variable("N.m")

    def equations(self) -> Any:
        return [
            gl.Eq(self.phi_rel, self.flange_b.phi - self.flange_a.phi),
            gl.Eq(self.tau, self.c * self.phi_rel + self.d * gl.der(self.phi_rel)),
            gl.Eq(self.flange_b.tau, self.tau),
            gl.Eq(self.flange_a.tau, self.tau),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy(stored=self.c * self.phi_rel**2 / 2, heat=self.d * gl.der(self.phi_rel) ** 2)


class FlippedGear(gp.interfaces.TwoFlanges):
    """A gear with a slip: the torques have the same sign."""

    ratio = gl.Parameter("1")

    def equations(self) -> Any:
        return [
            gl.Eq(self.flange_b.tau, self.ratio * self.flange_a.tau),
            gl.Eq(self.flange_a.phi, self.ratio * self.flange_b.phi),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy()


class FlippedMesh(gp.ExternalMesh):
    """A mesh that says it loses what its damping takes, but whose damping drives."""

    def energies(self) -> gl.Energy:
        return gl.Energy(stored=self.c * self.q**2 / 2, heat=-self.d * self.v**2)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Flipped(c=50.0, d=0.3),
        lambda: FlippedGear(ratio=2.0),
        lambda: FlippedMesh(r_a=0.1, r_b=0.2, c=1e3, d=20.0),
    ],
    ids=["spring", "gear", "mesh"],
)
def test_a_wrong_sign_is_noticed(wrong: Any) -> None:
    model = chain(gp.Torque(tau=3.0), gp.Inertia(J=1.0), wrong(), gp.Inertia(J=2.0), gp.Damper(d=0.5), gp.Fixed())
    with pytest.warns(RuntimeWarning, match=r"the energy balance is off by .* most of all in c"):
        result = gl.compile(model).simulate(1.0, samples=3, audit=True)
    assert result.stats["energy_residual"] > 1e-3
    assert result.energy_balance().worst == "c"


def test_a_sound_run_is_audited_without_a_word() -> None:
    model = chain(gp.Torque(tau=3.0), gp.Inertia(J=1.0), gp.SpringDamper(c=50.0, d=0.3), gp.Inertia(J=2.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = gl.compile(model).simulate(10.0, samples=3, audit=True, rtol=1e-4, method="rk")
    assert result.stats["energy_residual"] < 1e-2


def test_the_residual_is_there_as_soon_as_it_is_read() -> None:
    wrong = chain(gp.Torque(tau=3.0), gp.Inertia(J=1.0), Flipped(c=50.0, d=0.3), gp.Inertia(J=2.0))
    result = gl.compile(wrong).simulate(1.0, samples=3)
    assert "energy_residual" not in result.stats
    with pytest.warns(RuntimeWarning, match="the energy balance is off by .* most of all in c"):
        residual = result.stats["energy_residual"]
    assert residual == result.stats["energy_residual"] == result.energy_balance().relative_residual > 1e-3
    again = pickle.loads(pickle.dumps(gl.simulate(gp.Inertia(J=1.0, start={"w": 2.0}), 1.0, samples=3)))
    assert again.stats["energy_residual"] < 1e-6
    with pytest.raises(KeyError):
        _ = result.stats["no such thing"]


# ---------------------------------------------------------------- users' parts


class Silent(gl.Component):
    """A damper that does not say what becomes of its power."""

    flange = gp.Flange("shaft")

    def equations(self) -> Any:
        return [gl.Eq(self.flange.tau, 0.5 * gl.der(self.flange.phi))]


def test_a_part_that_declares_nothing_is_named() -> None:
    found = gl.simulate(chain(gp.Torque(tau=3.0), gp.Inertia(J=1.0), Silent()), 2.0, samples=3, rtol=1e-9).energy_balance()
    w = 6.0 * (1 - np.exp(-0.5 * 2.0))
    lost = found.work["a"][-1] - 0.5 * w**2
    assert found.unaccounted["c"][-1] == pytest.approx(lost, rel=1e-6)
    assert np.abs(found.residual).max() < 1e-7
    assert "unaccounted" in str(found)


class Wire(gl.Connector):
    """Of a kind whose power is not known."""

    level = gl.Potential("1", "level")
    stream = gl.Flow("1", "stream")


class Strange(gl.Component):
    flange = gp.Flange("shaft")
    wire = Wire("end")

    def equations(self) -> Any:
        return [gl.Eq(self.flange.tau, 0.5 * gl.der(self.flange.phi)), gl.Eq(self.wire.level, 1)]


def test_a_connector_of_unknown_power_is_named() -> None:
    found = gl.simulate(chain(gp.Torque(tau=3.0), gp.Inertia(J=1.0), Strange()), 2.0, samples=3).energy_balance()
    assert found.unknown == ("c",)
    assert str(found).endswith("not known how much power flows into c")


def test_a_bond_graph_declares_its_energies() -> None:
    graph = BondGraph((1, Se(), v := One("v")), (2, v, I("m")), (3, v, C("k")), (4, v, R("r")), name="oscillator")
    part = gp.from_bond_graph(graph, defaults={"m": 2.0, "k": 0.1, "r": 0.7})
    found = gl.simulate(part(Se_1=gl.sin(gl.time)), 5.0, samples=2, rtol=1e-9).energy_balance()
    assert found.relative_residual < 1e-7
    (path,) = found.heat
    assert found.heat[path][-1] > 0
    assert found.work[path][-1] > found.heat[path][-1]


def test_what_energies_returns_is_checked() -> None:
    class Wrong(Silent):
        def energies(self) -> Any:
            return 3.0

    class Misspelt(Silent):
        def energies(self) -> Any:
            return gl.Energy(stored=gl.der(self.flange.phi) * self.flange.tauu)

    with pytest.raises(DeclarationError, match=r"Wrong.energies\(\) must return gl.Energy"):
        audited(Wrong())
    with pytest.raises(gl.GearlibError, match="tauu"):
        audited(Misspelt())


def residual_of(residual: float, *, throughput: float, quadrature: float, rtol: float = 1e-6) -> EnergyBalance:
    time, zero = np.array([0.0, 1.0]), np.zeros(2)
    return EnergyBalance(
        time, {}, {}, {}, zero, {}, {}, (), {}, np.array([0.0, residual]), throughput, quadrature, rtol
    )  # fmt: skip


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_a_residual_is_explained_whatever_the_energies(size: float) -> None:
    """By the tolerance, by the quadrature, or because it shrinks with the tolerance; not by how small the energies are."""

    def never(rtol: float) -> EnergyBalance:
        raise AssertionError("nothing to look for")

    def same(rtol: float) -> EnergyBalance:
        return residual_of(1e-3 * size, throughput=size, quadrature=0.0, rtol=rtol)

    def finer(rtol: float) -> EnergyBalance:
        return residual_of(1e-3 * size * rtol / 1e-6, throughput=size, quadrature=0.0, rtol=rtol)

    assert explained(residual_of(0.9e-4 * size, throughput=size, quadrature=0.0), never)
    assert explained(residual_of(0.9e-2 * size, throughput=size, quadrature=1e-3 * size), never)
    assert explained(same(1e-6), finer)
    assert not explained(same(1e-6), same)


def test_an_audit_takes_no_tangents_along() -> None:
    made = gl.compile(chain(gp.Torque(tau=1.0), gp.Inertia(J=2.0), gp.SpringDamper(c=3.0, d=0.1), gp.Fixed()))
    found = made.simulate(1.0, samples=3, sensitivities=["c.c"])
    asked: list[Any] = []

    def run(translation: Any, request: Any, scene: Any) -> Any:
        asked.append(request)
        return found._run(translation, request, scene)

    again = energy_balance(found.translation, found.request, found.time, [], run)
    assert found.request.directions is not None
    assert [request.directions for request in asked] == [None] * len(asked) != []
    np.testing.assert_allclose(again.residual, found.energy_balance().residual, rtol=0, atol=1e-9)


def test_a_second_audit_derives_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Energies are derived once for a compiled model, and what several parts of a class declare is one formula."""
    parts = chain(
        gp.Torque(tau=1.0), *(p for J in (2.0, 3.0) for p in (gp.Inertia(J=J), gp.SpringDamper(c=J, d=0.1))), gp.Fixed()
    )
    system = gl.compile(parts)
    first = system.simulate(1.0, samples=3, audit=True)
    b, d = (next(p for p in system.translation.energies if p.path == path) for path in "bd")
    assert b.stored is not None
    assert d.stored is not None
    assert b.stored.formula is d.stored.formula
    assert b.through.formula is d.through.formula

    def derived(*_: Any) -> Any:
        raise AssertionError("derived again")

    monkeypatch.setattr("gearlib.flatten.energies._components", derived)
    monkeypatch.setattr("gearlib.flatten.energies.array_function", derived)
    again = system.simulate(2.0, samples=5, audit=True, parameters={"b.J": 2.5})
    assert first.stats["energy_residual"] < 1e-6 > again.stats["energy_residual"]
    assert len(system.translation.scenes) <= 1


@pytest.mark.parametrize("J", [(0.07, 0.328), (3.0, 1e-3)])
def test_where_nothing_moves_rounding_is_no_residual(J: tuple[float, float]) -> None:
    """A torque presses a freewheel against its lock: speeds of 1e-14 rad/s are all that is left of cancelling torques."""

    class Pressed(gl.Component):
        def assemble(self) -> Any:
            self.a, self.b = gp.Inertia(J=J[0]), gp.Inertia(J=J[1])
            self.lock = gp.OneWayClutch(mu_pos=((0.0, 0.679),), fn_max=5.25, f_normalized=1.0)
            self.push = gp.Torque2(tau=-4.536345838664548 - gl.Piecewise((0, gl.time < 0.357), (2.966945171233, True)))
            return [
                gl.connect(self.b.flange_b, self.lock.flange_a, self.push.flange_a),
                gl.connect(self.a.flange_b, self.lock.flange_b, self.push.flange_b),
            ]

    found = gl.compile(Pressed()).simulate(1.0, samples=2, audit=True)
    assert abs(found["a.w"]).max() < 1e-12
    assert found.stats["energy_residual"] < 1e-6
    pressing = 4.536345838664548 + 0.643 * 2.966945171233
    four_flanges = 4 * 1e-6 * pressing / 2  # of the lock and of the torque; each exchange counts once
    assert found.energy_balance().unresolved == pytest.approx(four_flanges, rel=1e-6)


class Driven(gl.Component):
    """A driven body on a damped shaft."""

    def assemble(self) -> list[Any]:
        self.drive, self.body = self.torque(), gp.Inertia(J=1.0)
        self.shaft, self.ground = gp.SpringDamper(c=177.0, d=1.0), gp.Fixed()
        return [
            gl.connect(self.drive.flange, self.body.flange_a),
            gl.connect(self.body.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.ground.flange),
        ]

    def torque(self) -> gl.Component:
        return gp.Torque()


class Stepped(Driven):
    """The torque jumps twice, which the exact method crosses without an event."""

    def torque(self) -> gl.Component:
        return gp.Torque(tau=gl.Piecewise((1.0, gl.time < 0.5623), (5.0, gl.time < 0.8748), (-2.0, True)))


@pytest.mark.parametrize("samples", [2, 5, 33])
def test_torques_that_jump_between_samples_of_the_exact_method(samples: int) -> None:
    run = gl.compile(Stepped()).simulate(1.0, samples=samples, method="exact")
    assert run.energy_balance().relative_residual < 1e-8


@pytest.mark.parametrize("held", [True, False], ids=["previous", "linear"])
def test_tables_that_jump_between_samples_of_the_exact_method(held: bool) -> None:
    t, y = (
        ([0.0, 0.4321, 0.8], [1.0, 5.0, -2.0])
        if held
        else ([0.0, 0.4321, 0.4321, 0.8, 0.8, 1.0], [1.0, 1.5, 5.0, 4.0, -2.0, 0.0])
    )
    table = gl.Table(t, y, interpolation="previous" if held else "linear")
    run = gl.compile(Driven()).simulate(1.0, samples=3, method="exact", inputs={"drive.tau": table})
    assert run.energy_balance().relative_residual < 1e-8
