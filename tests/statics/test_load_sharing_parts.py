"""Load sharing step by step: deflections and forces of springs, motions that balance themselves, and the preload that is taken out."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sparse

import gearlib as gl
import gearparts as gp
from gearlib.statics import load_sharing
from gearlib.statics.load_sharing import shared
from gearlib.statics.steady_motion import Given, Motion, solve


class Scaled(gl.Component):
    """A mesh whose law is written 5 times as large, with its force on either side of another equation."""

    flange_a, flange_b = gp.Flange("wheel"), gp.Flange("wheel")
    c = gl.Parameter("N/m")
    q, F, part = gl.Variable("m", start=0.0), gl.Variable("N"), gl.Variable("N")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.q), 0.05 * gl.der(self.flange_a.phi) + 0.1 * gl.der(self.flange_b.phi)),
            gl.Eq(5 * self.F, 5 * self.c * self.q),
            gl.Eq(4 * self.part, self.F + 3 * self.c * self.q),
            gl.Eq(self.flange_a.tau, 0.05 * self.F),
            gl.Eq(self.flange_b.tau, 0.1 * self.F),
        ]


class Paths(gl.Component):
    """Layshafts between two shafts, of a mesh and a torsional spring each; their losses are dampers."""

    count = gl.Structural(3)
    rigid = gl.Structural(0)

    def assemble(self) -> list[Any]:
        self.drive, self.load, self.first, self.last = gp.Torque(), gp.Torque(), gp.Inertia(J=0.01), gp.Inertia(J=0.04)
        self.mesh = [Scaled(c=1e7 * (1 + k)) for k in range(self.count)]
        self.shaft = [gp.SpringDamper(c=5e4 * (1 + k) ** 2, d=3.0) for k in range(self.count)]
        self.gear = [gp.IdealGear(ratio=-2.0) for _ in range(self.rigid)]
        links = [gl.connect(self.drive.flange, self.first.flange_a), gl.connect(self.last.flange_b, self.load.flange)]
        for mesh, shaft in zip(self.mesh, self.shaft, strict=True):
            links += [gl.connect(self.first.flange_b, mesh.flange_a), gl.connect(mesh.flange_b, shaft.flange_a)]
            links.append(gl.connect(shaft.flange_b, self.last.flange_a))
        for gear in self.gear:
            links += [gl.connect(self.first.flange_b, gear.flange_a), gl.connect(gear.flange_b, self.last.flange_a)]
        return links


class Loaded:
    """The train under a torque of the load, with the motion that a solution of all equations happens to have."""

    def __init__(self, count: int, rigid: int = 0, torque: float = -120.0) -> None:
        translation = gl.compile(Paths(count=count, rigid=rigid)).translation
        self.model, self.numbers = translation.structure.complete, translation.parameter_values({})
        self.translation = translation
        self.given = [self.named("last.w", 5.0), self.named("load.tau", torque)]
        self.motion = solve(self.model, self.numbers, self.given)
        flows = [self.model.variable(name) for name in self.model.names() if name.endswith(".tau")]
        self.torques = np.unique(self.model.representative[[v for v in flows if self.model.sign[v]]])

    def named(self, name: str, value: float) -> Given:
        v = self.model.variable(name)
        return Given(name, int(self.model.representative[v]), 0, float(self.model.sign[v]) * value)

    def value(self, name: str, constants: Any) -> float:
        v = self.model.variable(name)
        return float(constants[self.model.representative[v]] * self.model.sign[v])

    def free(self) -> Any:
        return load_sharing.self_balanced(self.motion.factors, self.torques)[: self.model.n_variables]

    def with_preload(self, weights: Any) -> Motion:
        return replace(self.motion, constants=self.motion.constants + self.free() @ weights)


@cache
def loaded(count: int, rigid: int = 0) -> Loaded:
    return Loaded(count, rigid)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_products_that_are_rounding_are_zero(size: float) -> None:
    """Relative to the sizes of their terms: up to 1e-12 of these."""
    matrix, near, far = np.array([[1.0, -1.0], [3.0, 1.0]]), 1.0 - 1.9e-12, 1.0 - 2.1e-12
    found = load_sharing.exact(size * matrix, np.array([[1.0, 1.0], [near, far]]))
    assert found[0].tolist() == [0.0, pytest.approx(size * 2.1e-12, rel=1e-3)]
    assert found[1] == pytest.approx([4 * size, 4 * size])
    assert load_sharing.exact(sparse.csr_matrix(size * matrix), np.array([[1.0], [near]]))[0, 0] == 0.0


def test_what_is_a_deflection_and_what_a_force() -> None:
    model = loaded(3).model
    for name, kind in (
        ("mesh[0].q", "m"), ("mesh[0].F", "N"), ("shaft[1].phi_rel", "rad"), ("shaft[1].tau", "N.m"), ("first.w", ""),
        ("mesh[2].part", "N"), ("load.tau", "N.m"), ("last.phi", "rad"), ("last.w", ""),
    ):  # fmt: skip
        v = int(model.representative[model.variable(name)])
        assert [load_sharing.kind_of(model, v, order) for order in (0, 1, 2)] == [kind, "", ""], name


def test_each_spring_counts_once_with_its_deflection_times_its_force() -> None:
    """However its equations are written: the work of what the rows give is force times deflection, with one sign for all."""
    one = loaded(3)
    deflection, force = load_sharing.elastic(one.model, one.numbers, one.motion)
    constants = np.random.default_rng(2).uniform(1.0, 2.0, one.model.n_variables)
    works = np.sort(np.abs((deflection @ constants) * (force @ constants)))
    pairs = [(f"mesh[{k}].q", f"mesh[{k}].F") for k in range(3)] + [
        (f"shaft[{k}].phi_rel", f"shaft[{k}].tau") for k in range(3)
    ]
    assert works == pytest.approx(np.sort([abs(one.value(q, constants) * one.value(f, constants)) for q, f in pairs]))
    assert deflection.shape == force.shape == (6, one.model.n_variables)
    at_rest = np.sign((deflection @ one.motion.constants) * (force @ one.motion.constants))
    assert len(set(at_rest[np.abs(deflection @ one.motion.constants) > 1e-9].tolist())) == 1


@pytest.mark.parametrize("k", [0, 1, 2])
def test_a_spring_without_stiffness_is_none_and_the_others_are_there(k: int) -> None:
    one = loaded(3)
    deflection, force = load_sharing.elastic(one.model, one.translation.parameter_values({f"mesh[{k}].c": 0.0}), one.motion)
    assert deflection.shape == force.shape == (5, one.model.n_variables)
    names = {one.model.name(int(v)) for v in deflection.indices[deflection.data != 0.0]}
    assert {name for name in names if name.startswith("mesh")} == {f"mesh[{i}].q" for i in range(3) if i != k}


class Root(gl.Component):
    """A mesh whose deflection is the square root of its force: endlessly soft without any."""

    flange_a, flange_b = gp.Flange("wheel"), gp.Flange("wheel")
    q, F = gl.Variable("m", start=0.0), gl.Variable("N")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.q), 0.05 * gl.der(self.flange_a.phi) + 0.1 * gl.der(self.flange_b.phi)),
            gl.Eq(self.q, 1e-5 * gl.sqrt(self.F)),
            gl.Eq(self.flange_a.tau, 0.05 * self.F),
            gl.Eq(self.flange_b.tau, 0.1 * self.F),
        ]


def test_a_spring_that_is_endlessly_soft_here_is_none() -> None:
    class Softened(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.mesh, self.shaft, self.b = (
                gp.Inertia(J=1.0),
                Root(guess={"F": 9.0}),
                gp.Spring(c=5e4),
                gp.Inertia(J=1.0),
            )
            row = (self.a.flange_b, self.mesh.flange_a), (self.mesh.flange_b, self.shaft.flange_a)
            return [gl.connect(*pair) for pair in (*row, (self.shaft.flange_b, self.b.flange_a))]

    translation = gl.compile(Softened()).translation
    model, numbers = translation.structure.complete, translation.parameter_values({})
    motion: Any = replace(loaded(1).motion, rates=np.zeros(model.n_variables), discrete=model.initial_discrete())
    force = int(model.representative[model.variable("mesh.F")])
    for size, count in ((0.0, 1), (9.0, 2)):
        constants = np.zeros(model.n_variables)
        constants[force] = size * model.sign[model.variable("mesh.F")]
        deflection, _ = load_sharing.elastic(model, numbers, replace(motion, constants=constants))
        assert deflection.shape == (count, model.n_variables)


@pytest.mark.parametrize(("count", "rigid"), [(1, 0), (3, 0), (9, 0), (2, 2)])
def test_forces_that_balance_themselves_leave_all_equations_as_they_are(count: int, rigid: int) -> None:
    """As many as there are paths, less one."""
    one = loaded(count, rigid)
    whole = load_sharing.self_balanced(one.motion.factors, one.torques)
    assert whole.shape == (2 * one.model.n_variables, count + rigid - 1)
    matrix = one.motion.factors.matrix
    assert np.abs(matrix @ whole).max(initial=0.0) <= 1e-9 * (abs(matrix) @ np.abs(whole)).max(initial=0.0)
    if count + rigid > 1:
        assert np.linalg.matrix_rank(whole[one.torques]) == count + rigid - 1


@pytest.mark.parametrize("count", [1, 3, 9])
def test_what_equilibrium_determines_is_changed_by_no_forces_that_balance_themselves(count: int) -> None:
    one = loaded(count)
    outside = one.model.representative[[one.model.variable(name) for name in ("load.tau", "drive.tau", "last.flange_b.tau")]]
    assert load_sharing.self_balanced(one.motion.factors, outside).shape == (2 * one.model.n_variables, 0)


def compliance(k: int) -> float:
    """Of a path, from a torque at the load to the turn of the load: the mesh's force is 10 per N.m."""
    return 10.0**2 / (1e7 * (1 + k)) + 1 / (5e4 * (1 + k) ** 2)


@pytest.mark.parametrize("count", [2, 3, 9])
def test_whatever_preload_is_there_is_taken_out(count: int) -> None:
    """By stiffness: from any motion in equilibrium the same one follows, in which each path carries its part."""
    one, draw = loaded(count), np.random.default_rng(count)
    parts = np.array([1 / compliance(k) for k in range(count)])
    for size in (0.0, 1.0, 30.0):
        motion = one.with_preload(size * draw.normal(size=count - 1))
        found = load_sharing.balanced(one.model, one.numbers, motion, one.free(), one.torques)
        torques = [one.value(f"shaft[{k}].tau", found) for k in range(count)]
        assert np.abs(torques) == pytest.approx(120.0 * parts / parts.sum(), rel=1e-9, abs=1e-6 * size)
        assert one.value("load.tau", found) == pytest.approx(-120.0, rel=1e-6)
    settled = shared(one.model, one.numbers, one.given, one.with_preload(np.ones(count - 1)), one.torques)
    assert [abs(one.value(f"shaft[{k}].tau", settled.constants)) for k in range(count)] == pytest.approx(
        120.0 * parts / parts.sum(), rel=1e-9, abs=1e-6
    )
    assert settled.rates == pytest.approx(one.motion.rates)


def test_rigid_paths_take_all_and_the_smallest_torques() -> None:
    """Two springs beside two equal gears: the springs are not deflected, and each gear carries half."""
    one = loaded(2, 2)
    for size in (0.0, 3.0):
        motion = one.with_preload(size * np.array([1.0, -2.0, 0.5]))
        found = load_sharing.balanced(one.model, one.numbers, motion, one.free(), one.torques)
        assert [one.value(f"gear[{k}].flange_b.tau", found) for k in range(2)] == pytest.approx([-60.0, -60.0])
        assert [one.value(f"shaft[{k}].tau", found) for k in range(2)] == pytest.approx([0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("torque", [-120e-30, -120e12])
def test_small_and_large_loads_are_shared_alike(torque: float) -> None:
    one = Loaded(2, torque=torque)
    parts = np.array([1 / compliance(k) for k in range(2)])
    found = shared(one.model, one.numbers, one.given, one.with_preload(np.array([abs(torque)])), one.torques)
    shares = [one.value(f"shaft[{k}].tau", found.constants) / torque for k in range(2)]
    assert np.abs(shares) == pytest.approx(parts / parts.sum(), rel=1e-9)


def test_paths_without_any_load_share_nothing() -> None:
    """No torque is open to be settled."""
    one = loaded(2)
    nothing = replace(one.motion, constants=np.zeros(one.model.n_variables))
    assert shared(one.model, one.numbers, one.given, nothing, one.torques) is nothing
