"""Backlash in linear analyses: open, closed and without a gap, against matrices by hand and free vibration."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import gearlib as gl
import gearparts as gp
from gearlib.linear.condition import conditions, described, matters_elsewhere
from gearlib.linear.operating_point import operating_point

C, D = 1e8, 400.0  # of the contact: N/m, N.s/m


class Held(gl.Component):
    """Two bodies, each on a spring to the ground, with a mesh or a coupling that has backlash between them."""

    J_a = gl.Parameter("kg.m2", default=0.01)
    J_b = gl.Parameter("kg.m2", default=0.1)
    k_a = gl.Parameter("N.m/rad", default=2e4)
    k_b = gl.Parameter("N.m/rad", default=5e4)
    b = gl.Parameter("1", default=0.0)
    twist = gl.Parameter("rad", "of the second spring where it has no torque", default=0.0)
    contact = gl.Structural("mesh")

    def assemble(self) -> list[gl.Connection]:
        self.t, self.t_b, self.ground = gp.Torque(), gp.Torque(), gp.Fixed()
        self.a, self.z = gp.Inertia(J=self.J_a), gp.Inertia(J=self.J_b)
        self.s, self.s_b = gp.SpringDamper(c=self.k_a, d=0.1), gp.SpringDamper(c=self.k_b, d=0.2, phi_rel0=self.twist)
        if self.contact == "mesh":
            self.m: Any = gp.DetailedExternalMesh(r_a=0.05, r_b=0.1, c=C, d=D, b=self.b, backlash=True)
        else:
            self.m = gp.ElastoBacklash2(c=C / 1e3, d=D / 1e3, b=self.b)
        return [
            gl.connect(self.t.flange, self.a.flange_a),
            gl.connect(self.a.flange_b, self.m.flange_a, self.s.flange_b),
            gl.connect(self.m.flange_b, self.z.flange_a, self.s_b.flange_b),
            gl.connect(self.z.flange_b, self.t_b.flange),
            gl.connect(self.s.flange_a, self.s_b.flange_a, self.ground.flange),
        ]


def by_hand(values: dict[str, float], row: Any, c: float, d: float) -> tuple[Any, Any]:
    """A of the states q, phi_a, phi_b, w_a, w_b with q' = row w, and the column of a torque on a."""
    J = np.array([values["J_a"], values["J_b"]])
    A = np.zeros((5, 5))
    A[0, 3:] = row
    A[1, 3] = A[2, 4] = 1.0
    A[3:, 0] = -row * c / J
    A[3:, 1:3] = -np.diag([values["k_a"], values["k_b"]]) / J[:, None]
    A[3:, 3:] = -(np.diag([0.1, 0.2]) + d * np.outer(row, row)) / J[:, None]
    B = np.zeros(5)
    B[3] = 1 / J[0]
    return A, B


@pytest.fixture(scope="module", params=["mesh", "coupling"])
def held(request: pytest.FixtureRequest) -> gl.System:
    return gl.compile(Held(contact=request.param))


@pytest.mark.parametrize("state", ["open", "closed", "no gap"])
@pytest.mark.parametrize("seed", range(3))
def test_all_linear_analyses_are_free_vibration(held: gl.System, state: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    mesh = "m.q" in held.states
    deflection, row = ("m.q", np.array([0.05, 0.1])) if mesh else ("m.phi_rel", np.array([-1.0, 1.0]))
    c, d = (C, D) if mesh else (C / 1e3, D / 1e3)
    b = 0.0 if state == "no gap" else 10 ** rng.uniform(-4, -3) * (1.0 if mesh else 10.0)
    press = float(rng.choice([-1.0, 1.0]) * b * rng.uniform(0.3, 1.0)) if state == "closed" else 0.0  # beyond the edge
    values = {"J_a": 10 ** rng.uniform(-2, -1), "J_b": 10 ** rng.uniform(-2, 0), "k_a": 10 ** rng.uniform(3, 5),
              "k_b": 10 ** rng.uniform(3, 5), "b": b}  # fmt: skip
    torques = c * press * row
    q0 = press + np.sign(press) * b / 2 if press else b * rng.uniform(-0.3, 0.3)
    acts = state != "open"
    A, B = by_hand(values, row, c * acts, d * acts)
    at = {deflection: q0, "s.phi_rel": 0.0, "s_b.phi_rel": 0.0} if mesh else {deflection: q0, "s.phi_rel": 0.0}
    values["twist"] = 0.0 if mesh else q0  # the angle of a coupling is that between its flanges, a mesh counts from contact
    right = np.linalg.eigvals(A)
    ringing = np.sort_complex(right[right.imag > 1e-6 * np.abs(right)])

    found = gl.modes(held, at=at, parameters=values)
    assert found.eigenvalues == pytest.approx(ringing[np.argsort(np.abs(ringing))], rel=1e-8)
    assert (found.free, found.preloads) == (0, int(acts and mesh))
    thing = "mesh m" if mesh else "coupling m"
    said = {
        "open": "open: ",
        "closed": "in contact, driven backwards: " if press < 0 else "in contact: ",
        "no gap": "in contact: ",
    }
    assert found.conditions == (said[state] + thing,)
    assert any(text.startswith(f"{deflection} (") for text in found.positions) == (state == "open" and mesh)
    report = gl.stability(held, at=at, parameters=values)
    assert said[state] + thing in str(report)
    assert ("a loop of meshes keeps a preload" in report.at_zero) == (acts and mesh)
    assert np.sort_complex(report.eigenvalues[report.eigenvalues.imag > 0]) == pytest.approx(ringing, rel=1e-8)

    model = held.linearize(["t.tau"], ["a.w"], at=at, parameters=values, sparse=True)
    mine = np.linalg.eigvals(model.A.toarray() if hasattr(model.A, "toarray") else model.A)
    assert np.sort_complex(mine[mine.imag > 1e-6 * np.abs(mine)]) == pytest.approx(ringing, rel=1e-8)
    omega = np.abs(ringing)
    response = gl.frequency_response(held, omega, ["t.tau"], ["a.w"], at=at, parameters=values)
    expected = [np.linalg.solve(1j * w * np.eye(5) - A, B)[3] for w in omega]
    assert response["a.w"] == pytest.approx(np.array(expected), rel=1e-8)

    kick = 1e-3 * (b or 1e-4) * omega.max()  # far from the edges
    run = held.simulate(
        10 / omega.max(), samples=11, rtol=1e-10, parameters=values, start={**at, "a.w": kick / row[0], "z.w": 0.0},
        inputs={"t.tau": torques[0], "t_b.tau": torques[1]},
    )  # fmt: skip
    x = np.array([expm(A * t) @ [0, 0, 0, kick / row[0], 0] for t in run.time])
    assert run[deflection] - q0 == pytest.approx(x[:, 0], abs=1e-6 * np.abs(x[:, 0]).max())
    assert run["z.w"] == pytest.approx(x[:, 4], abs=1e-6 * np.abs(x[:, 3:]).max())


class Free(gl.Component):
    """A pair of gears with nothing else."""

    def assemble(self) -> list[gl.Connection]:
        self.a, self.z = gp.Inertia(J=0.01), gp.Inertia(J=0.1)
        self.m = gp.DetailedExternalMesh(r_a=0.05, r_b=0.1, c=C, d=D, b=1e-4, backlash=True)
        return [gl.connect(self.a.flange_b, self.m.flange_a), gl.connect(self.m.flange_b, self.z.flange_a)]


def test_what_moves_across_an_open_mesh_is_called_so() -> None:
    system = gl.compile(Free())
    found = gl.modes(system, at={"m.q": 0.0})
    assert (len(found), found.free, found.preloads) == (2, 2, 0)
    assert set(found.gaps.values()) == {"m"}
    text = " ".join(str(found).split())
    assert "is a free relative motion across m." in text
    assert (
        "Nothing here depends on m.q (deflection along the line of action), m.turned (mesh phase beyond phase0)."
        in " ".join(text.split())
    )
    assert "open: mesh m" in text
    assert "preload" not in text
    assert "preload" not in str(gl.stability(system, at={"m.q": 0.0}))
    assert gl.transmission_error_response(system, [1.0], ["m.q"], at={"m.q": 0.0}).conditions == ("open: mesh m",)
    closed = gl.modes(system, at={"m.q": 6e-5})
    assert (len(closed), closed.free, closed.preloads, closed.gaps) == (2, 1, 0, {})
    assert "open" not in str(closed)
    diagram = gl.campbell(system, [1.0, 1e5], [1.0], at={"m.q": 6e-5})
    assert [c.frequency for c in diagram.crossings] == pytest.approx([closed.frequencies[1]])
    assert not gl.campbell(system, [1.0, 1e5], [1.0], at={"m.q": 0.0}).crossings
    assert "open: mesh m" in str(gl.campbell(system, [1.0, 1e5], [1.0], at={"m.q": 0.0}))


def test_contact_follows_a_run() -> None:
    system = gl.compile(Free())
    run = system.simulate(1e-3, samples=41, start={"m.q": 4e-5, "a.w": 2.0, "z.w": 0.0})
    assert {0.0, 1.0} == set(run["m.contact"])
    for k in (1, 20, 40):
        at = (run, float(run.time[k]))
        word = {1.0: "in contact: mesh m", 0.0: "open: mesh m", -1.0: "in contact, driven backwards: mesh m"}
        assert gl.modes(system, at=at).conditions == (word[run["m.contact"][k]],)


class Slipping(gl.Component):
    """A body on a spring, a friction part, and a load on another spring."""

    part = gl.Structural("clutch")
    pressed = gl.Parameter("1", "how hard the part is pressed", default=1.0, min=0)

    def assemble(self) -> list[gl.Connection]:
        self.t, self.ground = gp.Torque(), gp.Fixed()
        self.a, self.z = gp.Inertia(J=0.01), gp.Inertia(J=0.1)
        self.s, self.h = gp.SpringDamper(c=100.0, d=0.1), gp.SpringDamper(c=200.0, d=0.1)
        joints = [
            gl.connect(self.t.flange, self.a.flange_a),
            gl.connect(self.z.flange_b, self.h.flange_a),
            gl.connect(self.h.flange_b, self.ground.flange),
        ]
        if self.part in ("clutch", "one-way clutch"):
            kind = gp.Clutch if self.part == "clutch" else gp.OneWayClutch
            self.p = kind(fn_max=10.0, f_normalized=self.pressed)
            grounded = [
                gl.connect(self.a.flange_b, self.s.flange_a),
                gl.connect(self.s.flange_b, self.ground.flange),
            ]
            return [
                *joints,
                *grounded,
                gl.connect(self.a.flange_a, self.p.flange_a),
                gl.connect(self.p.flange_b, self.z.flange_a),
            ]
        if self.part == "brake":
            self.p = gp.Brake(fn_max=10.0, f_normalized=self.pressed)
        else:
            self.p = gp.BearingFriction(tau_pos=((0.0, 1.0), (10.0, 2.0)))
        return [
            *joints,
            gl.connect(self.a.flange_b, self.s.flange_a),
            gl.connect(self.s.flange_b, self.z.flange_a),
            gl.connect(self.z.flange_b, self.p.flange_a),
        ]


@pytest.mark.parametrize(("state", "pressed", "speed"), [("open", 0.0, 3.0), ("stuck", 1.0, 0.0), ("sliding", 1.0, 3.0)])
@pytest.mark.parametrize("part", ["clutch", "one-way clutch", "brake", "bearing"])
def test_friction_is_open_stuck_or_sliding(part: str, state: str, pressed: float, speed: float) -> None:
    """Not pressed, at rest relative to each other, and turning; in every linear analysis."""
    if part == "bearing" and state == "open":
        state = "sliding"  # a bearing's friction acts whenever it turns
    system = gl.compile(Slipping(part=part))
    at = {"z.w": speed, "z.phi": 0.0} if part in ("brake", "bearing") else {"z.w": speed, "z.phi": 0.0, "a.w": 0.0}
    values = {"pressed": pressed}
    said = f"{state}: {part} p"
    assert gl.modes(system, at=at, parameters=values).conditions == (said,)
    assert said in str(gl.stability(system, at=at, parameters=values))
    assert system.linearize(["t.tau"], ["a.w", "z.w"], at=at, parameters=values, sparse=True).conditions == (said,)
    found = gl.frequency_response(system, [1.0, 2.0], ["t.tau"], ["a.w", "z.w"], at=at, parameters=values)
    assert found.conditions == (said,)
    assert f"Operating point: {said}." in str(found)


class Valve(gl.Component):
    """Open or shut by a state of its own; said of it is whatever is declared."""

    x = gl.Variable("1", start=1.0)
    y = gl.Variable("1", start=0.0)
    shut = gl.Variable("1", words={0: "open: valve {}", 1: "shut: valve {}"})
    level = gl.Variable("1", words={2: "high: {}"})

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.shut, gl.Piecewise((1, self.x < 0.5), (0, True))),
            gl.Eq(self.level, 2 * self.shut),
            gl.Eq(gl.der(self.x), -self.x),
            gl.Eq(gl.der(self.y), (1 - self.shut) * self.x - self.y),
        ]


class Plant(gl.Component):
    def assemble(self) -> list[Any]:
        self.one, self.two, self.three = Valve(), Valve(start={"x": 0.2}), Valve()
        return []


@pytest.mark.parametrize(
    ("outputs", "said"),
    [
        (["one.y"], ("open: valve one",)),
        (["two.y"], ("shut: valve two", "high: two")),
        (["one.y", "two.y"], ("open: valve one", "shut: valve two", "high: two")),
        (["three.y", "one.y"], ("open: valve one, three",)),
        (["one.shut"], ("open: valve one",)),
        (["one.x"], ("open: valve one",)),
    ],
)
def test_only_what_the_outputs_need_is_said(outputs: list[str], said: tuple[str, ...]) -> None:
    """In the order of the model, for several together."""
    assert gl.compile(Plant()).linearize([], outputs, sparse=True).conditions == said


def test_steady_states_are_those_of_the_first_values_of_what_changes_with_time() -> None:
    class Loaded(gl.Component):
        amplitude = gl.Parameter("1", default=0.0)
        x, v = gl.Variable("1"), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            force = gl.Piecewise((3.0, gl.time < 1.0), (5.0, True)) + self.amplitude * gl.cos(gl.time)
            return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), force - self.x - self.x**3 - self.v)]

    system = gl.compile(Loaded())
    said = ("steady with the values at t = 0 of what changes with time: Loaded",)
    assert gl.modes(system, at="steady").conditions == said
    assert gl.modes(system, at={"x": 1.0}).conditions == ()
    assert system.linearize([], ["x"], at="steady", sparse=True).conditions == said

    class Shaken(gl.Component):
        x = gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), 2.0 + gl.cos(gl.time) - self.x - self.x**3)]

    steady = gl.compile(Shaken()).linearize([], ["x"], at="steady", sparse=True).conditions
    assert steady == (said[0].replace("Loaded", "Shaken"),), "not with the mean of a sinusoid"


def test_where_nothing_depends_on_the_point_nothing_is_said_of_it() -> None:
    class Loaded(gl.Component):
        x, v = gl.Variable("1"), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            force = gl.Piecewise((3.0, gl.time < 1.0), (5.0, True))
            return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), force - self.x - self.v)]

    system = gl.compile(Loaded())
    assert gl.modes(system, at="steady").conditions == ()
    assert system.linearize([], ["x"], at="steady", sparse=True).conditions == ()


def test_a_state_is_named_with_its_description_if_it_has_one() -> None:
    class Described(gl.Component):
        x, y = gl.Variable("1", "position of the slide", start=1.0), gl.Variable("1", start=1.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(gl.der(z)), -z) for z in (self.x, self.y)]

    structure = gl.compile(Described()).translation.structure
    assert {described(structure, node) for node in structure.states} == {
        "x (position of the slide)", "der(x)", "y", "der(y)",
    }  # fmt: skip


def test_nothing_is_said_of_what_is_not_needed() -> None:
    class Beside(gl.Component):
        z = gl.Variable("1", start=1.0)

        def assemble(self) -> list[Any]:
            self.valve = Valve()
            return []

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.z), -self.z)]

    system = gl.compile(Beside())
    assert system.linearize([], ["z"], sparse=True).conditions == ()
    assert gl.compile(Valve()).linearize([], ["y"], sparse=True).conditions == ("open: valve Valve",)


def test_a_model_with_parts_is_named_by_its_kind_and_constants_are_no_condition() -> None:
    class Station(gl.Component):
        """Words of its own beside those of its parts; a constant has words, too."""

        sum_ = gl.Variable("1", words={1: "one is shut: {}"})
        always = gl.Variable("1", words={3: "never said: {}"})
        size = gl.Parameter("1", default=3.0)

        def assemble(self) -> list[Any]:
            self.one, self.two = Valve(), Valve(start={"x": 0.2})
            return []

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.sum_, self.one.shut + self.two.shut), gl.Eq(self.always, self.size)]

    translation = gl.compile(Station()).translation
    scene, numbers, point = operating_point(translation, translation.scene.states)
    found = conditions(scene, numbers, point)
    assert sorted(found.said) == ["high: two", "one is shut: Station", "open: valve one", "shut: valve two"]
    assert found.open == {"one"}


class Turning(gl.Component):
    """A wheel whose weight is not in its middle, and a motor that changes the weight."""

    g = gl.Parameter("1/s2", default=9.0)
    depth = gl.Parameter("1", default=0.0)
    flat, n = gl.Parameter("1", default=0.0), gl.Parameter("1", "how often in a turn", default=1.0)
    phi, w = gl.Variable("rad"), gl.Variable("rad/s")

    def equations(self) -> list[gl.Eq]:
        weight = self.g * (1 + self.depth * gl.sin(5.0 * gl.time))
        law = (1 - self.flat) * gl.sin(self.n * self.phi) + self.flat * (1 - gl.cos(self.phi))
        return [gl.Eq(gl.der(self.phi), self.w), gl.Eq(gl.der(self.w), -weight * law)]


class Wheels(gl.Component):
    def assemble(self) -> list[Any]:
        self.wheel = [Turning() for _ in range(3)]
        return []


@pytest.mark.parametrize("most", [1, 2, 3])
def test_of_many_angles_the_fastest_are_tried(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """An angle that turns is named, at which the others stand as well: one at rest is not; a slow one is."""
    monkeypatch.setattr("gearlib.linear.condition.MOST_FROZEN", most)
    system = wheels()
    at = {f"wheel[{k}].{name}": x for k, (phi, w) in enumerate([(0.1, 3.0), (0.2, -7.0), (0.3, 5.0)])
          for name, x in (("phi", phi), ("w", w))}  # fmt: skip
    tried = ["wheel[1].phi = 0.2 rad", "wheel[2].phi = 0.3 rad", "wheel[0].phi = 0.1 rad"][:most]
    said = f"frozen at {', '.join(sorted(tried))}, with which the coefficients vary"
    model = system.linearize([], [f"wheel[{k}].w" for k in range(3)], at=at, sparse=True)
    assert model.conditions == (said,)


@pytest.mark.parametrize(
    ("at", "given", "said"),
    [
        ({"w": 0.9e-6}, {}, None), ({"w": -1.1e-6}, {}, "wheel[0].phi = 0.1 rad"), ({"w": 0.0}, {}, None),
        ({"w": 0.0, "phi": 0.0}, {"flat": 1.0}, "wheel[0].phi = 0 rad"),  # which nothing holds
        ({"w": 4.0}, {"n": 2.0}, "wheel[0].phi = 0.1 rad"), ({"w": 4.0}, {"n": 0.5}, None), ({"w": 4.0}, {"n": 1.2}, None),
        ({"w": 4.0}, {"g": 1e9}, "wheel[0].phi = 0.1 rad"),
        ({"w": 4.0}, {"g": 0.0}, None), ({"w": 0.0}, {"depth": 0.3}, "t = 0 s"),
        ({"w": 4.0}, {"depth": 0.3}, "t = 0 s, wheel[0].phi = 0.1 rad"), ({"w": 4.0}, {"depth": 0.3, "g": 0.0}, None),
    ],
)  # fmt: skip
def test_what_turns_and_what_changes_with_time_is_told(at: dict[str, float], given: dict[str, float], said: str | None) -> None:
    values = {f"wheel[0].{name}": x for name, x in given.items()}
    points = {"wheel[0].phi": 0.1, **{f"wheel[0].{name}": x for name, x in at.items()}}
    model = wheels().linearize([], ["wheel[0].w"], at=points, parameters=values, sparse=True)
    assert model.conditions == ((f"frozen at {said}, with which the coefficients vary",) if said else ())


@pytest.mark.parametrize(
    ("law", "said"),
    [
        (lambda x, t: gl.Piecewise((gl.sin(x), gl.sin(x) < 0), (0, True)), "x = 0.1 rad"),
        (lambda x, t: gl.Piecewise((gl.sin(x), gl.sin(x) > 0), (0, True)), "x = 0.1 rad"),
        (lambda x, t: gl.Piecewise((1, t > 8.0), (0, True)), "t = 0 s"), (lambda x, t: gl.Piecewise((1, t > 9.5), (0, True)), None),
        (lambda x, t: gl.Piecewise((1, t < -0.5), (0, True)), None),
    ],
)  # fmt: skip
def test_coefficients_are_looked_at_over_a_turn_and_ten_seconds(law: Any, said: str | None) -> None:
    """Also where they vary in one half of it only; what was before does not count."""

    class Wave(gl.Component):
        x, y, second = gl.Variable("rad", start=0.1), gl.Variable("1"), gl.Parameter("s", default=1.0)

        def equations(self) -> list[gl.Eq]:
            rate = -self.y * (2 + law(self.x, gl.time / self.second))
            return [gl.Eq(self.second * gl.der(self.x), 1.0), gl.Eq(self.second * gl.der(self.y), rate)]

    model = gl.compile(Wave()).linearize([], ["y"], at={"y": 3.0}, sparse=True)
    assert model.conditions == ((f"frozen at {said}, with which the coefficients vary",) if said else ())


@cache
def wheels() -> gl.System:
    return gl.compile(Wheels())


def test_a_state_matters_where_the_rate_of_another_depends_on_it() -> None:
    class Coasting(gl.Component):
        x, v, y, z = (gl.Variable("1") for _ in range(4))

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(gl.der(self.x), self.v),
                gl.Eq(gl.der(self.v), gl.sin(self.y) - self.v),
                gl.Eq(gl.der(self.y), -self.y),
                gl.Eq(gl.der(self.z), self.y - self.z),
            ]

    structure = gl.compile(Coasting()).translation.structure
    found = {structure.model.name(v): matters_elsewhere(structure, structure.states, (v, k)) for v, k in structure.states}
    assert found == {"x": False, "v": True, "y": True, "z": False}


@pytest.mark.parametrize("unit", ["rad", "1", "m"])
def test_only_angles_are_frozen(unit: str) -> None:
    """A state of another unit may have coefficients that repeat every 2 pi, too; and a speed is none, though it is the rate of an angle."""

    class Wave(gl.Component):
        one = gl.Parameter({"rad": "1", "1": "1", "m": "1/m"}[unit], default=1.0)
        rate = gl.Parameter(f"{unit}/s" if unit != "1" else "1/s", default=1.0)
        x, y = gl.Variable(unit, start=0.5), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), self.rate), gl.Eq(gl.der(self.y), -self.y * (2 + gl.sin(self.one * self.x)))]

    model = gl.compile(Wave()).linearize([], ["y"], at={"y": 3.0}, sparse=True)
    assert model.conditions == (("frozen at x = 0.5 rad, with which the coefficients vary",) if unit == "rad" else ())


def test_a_rate_of_an_angle_is_not_frozen() -> None:
    """Its own rate depends on it with a period of 2 pi 1/s, and it changes."""

    class Friction(gl.Component):
        phi, second = gl.Variable("rad", start=0.0), gl.Parameter("s", default=1.0)

        def equations(self) -> list[gl.Eq]:
            v = self.second * gl.der(self.phi)
            return [gl.Eq(self.second**2 * gl.der(gl.der(self.phi)), 1 - gl.sin(v))]

    model = gl.compile(Friction()).linearize([], ["der(phi)"], sparse=True)
    assert model.conditions == ()


@pytest.mark.parametrize(("g", "said"), [(0.0, ()), (1e-200, ("frozen at t = 0 s, with which the coefficients vary",))])
def test_derivatives_that_are_always_zero_do_not_vary(g: float, said: tuple[str, ...]) -> None:
    class Faint(gl.Component):
        g = gl.Parameter("1/s", default=1.0)
        y = gl.Variable("1", start=2.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.y), self.g * gl.cos(5.0 * gl.time) * self.y)]

    assert gl.compile(Faint()).linearize([], ["der(y)"], parameters={"g": g}, sparse=True).conditions == said


def test_what_depends_on_a_difference_of_angles_does_not_vary_while_they_turn_together() -> None:
    class Coupled(gl.Component):
        rate = gl.Parameter("1/s2", default=5.0)
        phi, psi = gl.Variable("rad", start=0.4), gl.Variable("rad", start=0.1)
        v, w = gl.Variable("rad/s", start=3.0), gl.Variable("rad/s", start=3.0)

        def equations(self) -> list[gl.Eq]:
            pull = self.rate * gl.sin(self.phi - self.psi)
            return [
                gl.Eq(gl.der(self.phi), self.v), gl.Eq(gl.der(self.psi), self.w),
                gl.Eq(gl.der(self.v), -pull), gl.Eq(gl.der(self.w), pull),
            ]  # fmt: skip

    assert gl.compile(Coupled()).linearize([], ["v"], sparse=True).conditions == ()


def test_an_output_alone_may_vary_with_an_angle() -> None:
    """The motion does not: its modes have no condition."""

    class Dial(gl.Component):
        d = gl.Parameter("1/s", default=0.5)
        phi, w, y = gl.Variable("rad", start=0.25), gl.Variable("rad/s", start=3.0), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.phi), self.w), gl.Eq(gl.der(self.w), -self.d * self.w), gl.Eq(self.y, gl.sin(self.phi))]

    system, said = gl.compile(Dial()), ("frozen at phi = 0.25 rad, with which the coefficients vary",)
    assert system.linearize([], ["y"], sparse=True).conditions == said
    assert system.linearize([], ["w"], sparse=True).conditions == gl.modes(system).conditions == ()
    assert gl.modes(wheels(), at={"wheel[0].w": 3.0, "wheel[0].phi": 0.25}).conditions == (
        "frozen at wheel[0].phi = 0.25 rad, with which the coefficients vary",
    )
