"""States whose rates would need the derivative of what jumps give way to others; kinks are no jumps."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

import gearlib as gl
import gearparts as gp
from gearlib.errors import ModelError, NameLookupError, StartError
from gearlib.flatten.flatten import flatten
from gearlib.reduce.discontinuities import may_jump

T = gl.time
RISES = gl.Piecewise((1.0, T < 0.4), (3.0, True))  # the torque of all trains here
TABLE = gl.Table([0.0, 0.4, 0.4, 1.0], [1.0, 1.0, 3.0, 3.0])
TIMES = [0.0, 0.2, 0.39, 0.41, 0.6, 1.0]


@dataclass(frozen=True)
class Drawn:
    """Nodes in a row, some with inertia; springs and dampers between neighbours; pairs of nodes whose relative motion is preferred."""

    inertia: tuple[float, ...]
    shafts: tuple[tuple[float, float], ...]
    driven: int
    pairs: tuple[tuple[int, int], ...]
    order: int

    @classmethod
    def by(cls, seed: int) -> Drawn:
        rng = random.Random(seed)
        n = rng.randint(2, 5)
        inertia = [rng.choice([0.0, rng.uniform(0.2, 2.0)]) for _ in range(n)]
        driven = rng.randrange(n)
        inertia[driven], inertia[driven - 1] = 0.0, 1.0
        shafts = tuple((rng.uniform(1, 100), rng.uniform(0.5, 5)) for _ in range(n - 1))
        others = [k for k in range(n) if k != driven]
        pairs = [rng.sample([driven, rng.choice(others)], 2), *(rng.sample(range(n), 2) for _ in range(rng.randint(0, 2)))]
        return cls(tuple(inertia), shafts, driven, tuple((a, b) for a, b in pairs), seed)

    def speeds(self) -> Any:
        """The nodes' speeds at `TIMES`, by matrix exponentials: C v + K q = torques, where v of bodies are states."""
        n, body = len(self.inertia), np.flatnonzero(self.inertia)
        free = np.setdiff1d(np.arange(n), body)
        K, D = np.zeros((n, n)), np.zeros((n, n))
        for k, (c, d) in enumerate(self.shafts):
            pair, one = np.ix_([k, k + 1], [k, k + 1]), np.array([[1, -1], [-1, 1]])
            K[pair] += c * one
            D[pair] += d * one
        torque, m = np.eye(n)[self.driven], len(body)
        v = np.zeros((n, n + m + 1))  # from angles, speeds of bodies, and the torque
        v[body, n + np.arange(m)] = 1.0
        known = np.hstack([-K, -D[:, body], torque[:, None]])
        v[free] = np.linalg.solve(D[np.ix_(free, free)], known[free])
        a = (np.hstack([-K, np.zeros((n, m)), torque[:, None]]) - D @ v)[body] / np.array(self.inertia)[body, None]
        A = np.vstack([v, a, np.zeros(n + m + 1)])

        def after(x: Any, tau: float, t: float) -> Any:
            return scipy.linalg.expm(A * t) @ np.append(x[:-1], tau)

        first = after(np.zeros(n + m + 1), 1.0, 0.4)
        return np.array([v @ (after(np.zeros(n + m + 1), 1.0, t) if t < 0.4 else after(first, 3.0, t - 0.4)) for t in TIMES])


class TwoPoint(gl.Component):
    """A torque that rises for good when its shaft has turned far enough."""

    flange = gp.Flange("driven shaft")
    on = gl.Discrete("whether it has risen")

    def equations(self) -> list[Any]:
        far = gl.Piecewise((1, self.flange.phi > 0.02), (gl.pre(self.on), True))
        return [gl.Eq(self.on, far), gl.Eq(self.flange.tau, -1 - 2 * self.on)]


class Line(gl.Component):
    """A drawn train, declared and connected in any order."""

    drawn = gl.Structural(None)
    source = gl.Structural("step")
    wish = gl.Structural("prefer")

    def assemble(self) -> list[Any]:
        line, rng = self.drawn, random.Random(self.drawn.order)
        nodes: list[list[tuple[str, str]]] = [[] for _ in line.inertia]
        parts: dict[str, gl.Component] = {}

        def put(name: str, part: gl.Component, *at: int, flanges: tuple[str, ...] = ("flange_a", "flange_b")) -> None:
            parts[name] = part
            for node, flange in zip(at, flanges, strict=False):
                nodes[node].append((name, flange))

        for k, J in enumerate(line.inertia):
            start = {"phi": 0.0, "w": 0.0} if J else {"phi": 0.0}
            node, flange = (gp.Inertia(J=J, start=start), "flange_a") if J else (gp.AngleSensor(start=start), "flange")
            put(f"node{k}", node, k, flanges=(flange,))
            put(f"speed{k}", gp.SpeedSensor(), k, flanges=("flange",))
        for k, (c, d) in enumerate(line.shafts):
            put(f"shaft{k}", gp.SpringDamper(c=c, d=d), k, k + 1)
        for k, pair in enumerate(line.pairs):
            put(f"relative{k}", gp.RelativeStates(state=dict.fromkeys(("phi_rel", "w_rel"), self.wish)), *pair)
        if self.source == "clutch":
            self.clutch = gp.Clutch(fn_max=1.0, mu_pos=((0.0, 1.0),), f_normalized=RISES)
            for flange, w in (("flange_a", 3.0), ("flange_b", 0.0)):
                parts[f"beside_{flange}"] = gp.Inertia(J=1.0, start={"w": w})
                nodes.append([("clutch", flange), (f"beside_{flange}", "flange_a")])
            put("torque", gp.Torque(tau=self.clutch.tau), line.driven, flanges=("flange",))
        elif self.source == "discrete":
            put("torque", TwoPoint(), line.driven, flanges=("flange",))
        else:
            turned = gl.Piecewise((1.0, gl.sin(T) < 0.3), (3.0, True)) if self.source == "wave" else RISES
            bound = {"step": RISES, "table": TABLE, "wave": turned}
            put(
                "torque",
                gp.Torque(**({"tau": bound[self.source]} if self.source in bound else {})),
                line.driven,
                flanges=("flange",),
            )
        names = list(parts)
        rng.shuffle(names)
        for name in names:
            setattr(self, name, parts[name])
        if self.source == "sampled":
            self.sampler = gl.Sampled(lambda t, values: 1.0 if t < 0.3 else 3.0, 0.4, outputs=[parts["torque"].tau])
        rng.shuffle(nodes)
        return [gl.connect(*(getattr(getattr(self, name), flange) for name, flange in node)) for node in nodes]


@given(st.integers(0, 10**6), st.sampled_from(["step", "table", "input", "sampled"]))
@settings(max_examples=16, deadline=None, phases=[Phase.generate])
def test_relative_motion_behind_a_torque_that_jumps(seed: int, source: str) -> None:
    """Preferred or not, it moves as the matrix exponential says."""
    drawn = Drawn.by(seed)
    right = drawn.speeds()
    system = gl.compile(Line(drawn=drawn, source=source))
    given = {"torque.tau": TABLE} if source == "input" else {}
    for method in ("auto", "ida"):
        result = system.simulate(TIMES[-1], times=TIMES, inputs=given, method=method, rtol=1e-9)
        found = np.array([result[f"speed{k}.w"] for k in range(len(drawn.inertia))]).T
        assert found == pytest.approx(right, rel=1e-6, abs=1e-6 * np.abs(right).max()), method


@given(st.integers(0, 10**6), st.sampled_from(["discrete", "clutch", "wave"]))
@settings(max_examples=10, deadline=None, phases=[Phase.generate])
def test_relative_motion_behind_a_mode(seed: int, source: str) -> None:
    """As without the preference, at a tight tolerance."""
    drawn = Drawn.by(seed)
    found = gl.compile(Line(drawn=drawn, source=source)).simulate(TIMES[-1], times=TIMES, rtol=1e-9)
    right = gl.compile(Line(drawn=drawn, source=source, wish="never")).simulate(
        TIMES[-1], times=TIMES, method="rk8", rtol=1e-11
    )
    for k in range(len(drawn.inertia)):
        name = f"speed{k}.w"
        assert found[name] == pytest.approx(right[name], rel=1e-6, abs=1e-6)


class Laws(gl.Component):
    """One equation of each kind."""

    x = gl.Variable("1", start=0.0)
    y = gl.Variable("1")
    k = gl.Parameter("1", default=2e9)
    b = gl.Parameter("1", default=0.3)
    on = gl.Discrete("mode")
    law = gl.Structural("")

    def equations(self) -> list[Any]:
        x, k, b, far = self.x, self.k, self.b, self.x > self.b
        laws = {
            "step": RISES, "ramp": gl.Piecewise((b, b > T), (T, True)), "wave": gl.sign(gl.sin(3 * T)), "table": TABLE(T),
            "rectified": abs(gl.sin(3 * T)), "spring": gl.Piecewise((k * (x - b), far), (0, True)), "least": gl.Min(x, 2 * b - x, T),
            "damped": gl.Piecewise((x - b + k * 1e-9 * gl.der(x), far), (0, True)), "small": gl.Piecewise((x, far), (x + 1e-3, True)),
            "inner": gl.Piecewise((gl.Piecewise((1.0, x > 2 * b), (2.0, True)), far), (2.0, True)), "mode": x + self.on,
            "inside": gl.Piecewise((gl.Piecewise((x - b, x > b / 2), (5.0, True)), far), (0, True)),
            "parabola": gl.Piecewise(((x - b) ** 2, far), (0, True)), "start": x * gl.Piecewise((2, gl.initial()), (1, True)),
            "fixed": gl.Piecewise((x, k > b), (x + 1, True)), "root": gl.Piecewise((gl.sqrt(x - b), far), (0, True)),
        }  # fmt: skip
        return [gl.Eq(gl.der(x), 1.0), gl.Eq(self.on, gl.Piecewise((1, far), (0, True))), gl.Eq(self.y, laws[self.law])]


@pytest.mark.parametrize(
    ("law", "first", "second"),
    [
        ("step", True, True), ("ramp", False, True), ("wave", True, True), ("table", True, True), ("rectified", False, True),
        ("spring", False, True), ("least", False, True), ("damped", True, True), ("small", True, True), ("inner", True, True),
        ("mode", True, True), ("inside", False, True),
        ("parabola", False, False), ("start", False, False), ("fixed", False, False), ("root", False, True),
    ],
)  # fmt: skip
def test_what_may_jump(law: str, first: bool, second: bool) -> None:
    """The law itself, and its derivative."""
    model = flatten(Laws(law=law))
    (e,) = [e for e, row in enumerate(model.rows) if (model.variable("y"), 0) in row]
    assert [may_jump(model, e, times, model.parameters.defaults) for times in (1, 2)] == [first, second]


class Nothing(gl.Component):
    """What is zero, in an equation that switches."""

    x, none, other = gl.Variable("1", start=0.0), gl.Variable("1"), gl.Variable("1")
    rate = gl.Parameter("1/s", default=1.0)

    def equations(self) -> list[Any]:
        law = gl.Piecewise((self.none, self.x > 0.3), (-self.none, True))
        return [gl.Eq(gl.der(self.x), self.rate), gl.Eq(self.none, 0), gl.Eq(self.other, 0), gl.Eq(self.other, law)]


def test_what_is_zero_on_both_sides_does_not_jump() -> None:
    model = flatten(Nothing())
    (switching,) = [
        first for first, group in zip(model.first_equations, model.groups, strict=False) if group.template.relations
    ]
    assert not may_jump(model, switching, 2, model.parameters.defaults)


class Driven(gl.Component):
    """A torque on a node without inertia, between a damped spring and preferred relative motion."""

    tau = gl.Structural(None)

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque() if self.tau is None else gp.Torque(tau=self.tau)
        self.shaft, self.body, self.other = gp.SpringDamper(c=50.0, d=6.0), gp.Inertia(J=1.0), gp.Inertia(J=2.0)
        self.relative = gp.RelativeStates()
        return [
            gl.connect(self.torque.flange, self.shaft.flange_a, self.relative.flange_b),
            gl.connect(self.shaft.flange_b, self.body.flange_a),
            gl.connect(self.relative.flange_a, self.other.flange_a),
        ]


def test_a_preference_holds_where_nothing_jumps() -> None:
    assert "relative.w_rel" in gl.compile(Driven(tau=gl.sin(T))).states
    assert "relative.w_rel" in gl.compile(Driven(tau=gl.Max(T - 0.4, 0))).states
    assert set(gl.compile(Driven(tau=RISES)).states) == {"body.w", "other.w", "shaft.phi_rel"}


def test_an_acceleration_that_needs_the_derivative_of_an_input_is_refused_by_name() -> None:
    system = gl.compile(Driven())
    result = system.simulate(1.0, inputs={"torque.tau": 2.0})
    assert result["relative.w_rel"][0] == pytest.approx(1 / 3)
    for name in ("relative.a_rel", "der(relative.w_rel)"):
        with pytest.raises(NameLookupError, match="needs the derivative of an input, so it is not computed"):
            result[name]
        with pytest.raises(NameLookupError, match="needs the derivative of an input, so it cannot be an output"):
            gl.compile(Driven(), outputs=[name])
    with pytest.raises(StartError, match=r"start of relative\.a_rel: it needs the derivative of an input"):
        system.simulate(1.0, inputs={"torque.tau": 2.0}, start={"relative.a_rel": 1.0})


class Set(gl.Component):
    """A value that follows an input that jumps, and which is set at an event: it has to be a state."""

    u = gl.Input("1")
    x = gl.Variable("1")
    rate = gl.Variable("1")
    v = gl.Variable("1", state="prefer")
    sets = gl.Structural(False)

    def equations(self) -> list[Any]:
        known = [gl.Eq(self.v, self.x + self.u), gl.Eq(gl.der(self.v), -self.x), gl.Eq(self.rate, gl.der(self.x))]
        return [*known, gl.When(T > 0.5, gl.reinit(self.x, 1.0))] if self.sets else known


def test_a_state_that_is_demanded_does_not_give_way() -> None:
    assert gl.compile(Set(u=RISES, state={"x": "prefer", "v": "never"})).states == ("v",)
    with pytest.raises(ModelError, match=r"Set: u has a jump at t = 0\.4 s, but must be differentiated"):
        gl.simulate(Set(u=RISES, sets=True), 1.0)
    with pytest.raises(ModelError, match="the input u would have to be differentiated"):
        gl.compile(Set(sets=True))
