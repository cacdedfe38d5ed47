"""What a branch of periodic motions begins with: forcing, the states that repeat, the first motion, and what is refused."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import GearlibError, SolverError
from gearlib.periodic.first_motion import Forced
from tests.periodic.test_fourier_balance import oscillator

ZETA = 0.05


class Forced1(gl.Component):
    """``x'' + 2 zeta x' + x = F + A cos(w t) + B cos(2 pi f t)``, beside it what depends on x and what depends on nothing."""

    w = gl.Parameter("rad/s", default=0.5)
    f = gl.Parameter("Hz", default=0.1)
    A, B, k = gl.Parameter("1", default=0.0), gl.Parameter("1", default=0.0), gl.Parameter("1", default=1.0)
    F, G = gl.Input("1"), gl.Input("1")
    x, v = gl.Variable("1", start=0.25), gl.Variable("1")
    y, clock, p = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        force = self.F + 3 * self.G + self.A * gl.cos(self.w * gl.time) + self.B * gl.cos(2 * gl.pi * self.f * gl.time)
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), force - 2 * ZETA * self.v - self.k * self.x),
            gl.Eq(self.y, 2 * self.x),
            gl.Eq(self.clock, gl.sin(gl.time)),
            gl.Eq(gl.der(self.p), self.v**2),
        ]


@cache
def system() -> gl.System:
    return gl.compile(Forced1())


def forced(
    frequency: str | None = None, harmonics: int = 2, turning: Any = None, parameters: Any = None, **inputs: Any
) -> Forced:
    return Forced(system().translation, frequency, parameters or {}, inputs, harmonics, turning or {})


def response(omega: float) -> complex:
    return complex(1 / (1 - omega**2 + 2j * ZETA * omega))


def test_a_frequency_is_set_in_the_unit_of_its_parameter() -> None:
    assert forced(parameters={"A": 2.0}).values(0.7) == {"A": 2.0}
    assert forced("w", parameters={"A": 2.0}).values(0.7) == {"A": 2.0, "w": 0.7}
    assert forced("f").values(0.7) == {"f": pytest.approx(0.7 / (2 * np.pi))}

    class Box(gl.Component):
        def assemble(self) -> list[Any]:
            self.inside = Forced1()
            return []

    for name, value in (("inside.w", 0.7), ("inside.f", 0.7 / (2 * np.pi))):
        task = Forced(gl.compile(Box()).translation, name, {}, {}, 2, {})
        assert task.values(0.7) == {name: pytest.approx(value)}


def test_integrals_on_which_nothing_depends_do_not_repeat() -> None:
    assert forced().repeating() == ("x", "v")
    assert forced(turning={"v": 1.0}).repeating() == ("x",)

    class Chain(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b, self.shaft = gp.Inertia(J=1.0), gp.Inertia(J=1.0), gp.SpringDamper(c=1.0, d=0.1)
            return [gl.connect(self.a.flange_b, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.b.flange_a)]

    chain = gl.compile(Chain(), outputs=["a.w", "b.w", "shaft.phi_rel", "a.phi"])
    assert set(Forced(chain.translation, None, {}, {}, 2, {}).repeating()) == {"a.w", "b.w", "shaft.phi_rel"}


class Struck(gl.Component):
    """An oscillator, its turns, and an integral that is set to their sine where the oscillator goes far."""

    F = gl.Input("1")
    x, v = gl.Variable("1"), gl.Variable("1")
    turned, told = gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), self.F - 2 * ZETA * self.v - self.x),
            gl.Eq(gl.der(self.turned), 1 + self.v),
            gl.Eq(gl.der(self.told), self.x**2),
            gl.When(self.x > 0.25, gl.reinit(self.told, gl.sin(self.turned))),
        ]


def test_an_angle_that_only_the_reinit_of_an_integral_reads_does_not_repeat() -> None:
    """Nothing that repeats depends on either of them; a run has both."""
    struck = gl.compile(Struck())
    assert set(struck.translation.states) == {"x", "v", "turned", "told"}
    assert set(Forced(struck.translation, None, {}, {}, 2, {}).repeating()) == {"x", "v"}
    found = gl.harmonic_balance(struck, 0.5, 1.5, inputs={"F": lambda p, w: 0.1 * np.cos(p)})
    assert found.amplitude("x") == pytest.approx([0.1 * abs(response(w)) for w in found.omega], rel=1e-8)
    run = struck.simulate(1.0, samples=3, inputs={"F": 1.0}, rtol=1e-9)
    (at, _), *more = run.events
    assert more == []
    fine = np.linspace(at, 1.0, 2001)
    x = struck.simulate(1.0, times=[0.0, *fine], inputs={"F": 1.0}, rtol=1e-9)["x"]
    assert x[1] == pytest.approx(0.25, abs=1e-6)
    assert run["told"][-1] == pytest.approx(np.sin(at + 0.25) + np.trapezoid(x[1:] ** 2, fine), rel=1e-5)


@pytest.mark.parametrize(
    ("turning", "expected"), [({}, [0.0, 0.0]), ({"x": 2.0}, [2.0, 0.0]), ({"v": -1, "x": 0.5}, [0.5, -1.0])]
)
def test_growth_is_given_by_state(turning: Any, expected: list[float]) -> None:
    task = forced(turning=turning)
    scene = task.scene(["x"])
    found = dict(zip(scene.state_names, task.growth(scene).tolist(), strict=True))
    assert [found["x"], found["v"]] == expected


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: forced().scene([]), r"^outputs is \[\]; expected a list of names, such as \['mesh\.q'\]$"),
        (lambda: forced().scene(["clock"]), "^clock depend on no states, so there is nothing to balance$"),
        (lambda: forced(turning={"q": 1.0}).growth(forced().scene(["x"])), r"^the system has no state 'q'; "),
        (lambda: forced(turning={"x": "once"}).growth(forced().scene(["x"])), r"^turning\['x'\] is 'once'; expected the periods of 2 pi"),
        (lambda: forced(turning={"x": 0}).growth(forced().scene(["x"])), r"^turning\['x'\] is 0; expected"),
        (lambda: forced(H=1.0).driven(forced().scene(["x"])), "'H'"),
    ],
)  # fmt: skip
def test_what_is_no_forcing_is_refused_by_name(call: Any, said: str) -> None:
    with pytest.raises(GearlibError, match=said):
        call()


def test_inputs_are_numbers_or_functions_of_phase_and_frequency() -> None:
    task = forced(F=lambda phase, w: phase + 10 * w, G=4.0)
    at = task.driven(task.scene(["x"]))
    phase = np.array([0.0, 1.0, 2 * np.pi + 1.0, -0.5])
    found = at(0.7).inputs(phase, 0.7)
    assert found == pytest.approx(np.array([[7.0, 8.0, 8.0, 2 * np.pi - 0.5 + 7.0], [4.0] * 4]))
    assert at(0.7).omega == 0.7
    swept = forced("w").driven(forced().scene(["x"]))
    assert swept(0.7) is swept(0.7)
    assert swept(0.7).omega == 0.7


def first(task: Forced, omega: float, **how: Any) -> Any:
    scene = task.scene(["x"])
    found = task.first(scene, omega, 16, how.get("guess"), how.get("known"))
    return found, dict(zip(scene.state_names, found.balance.coefficients(found.z).T, strict=True)), scene


@pytest.mark.parametrize(("frequency", "omega"), [(None, 0.7), ("w", 0.4), ("f", 0.6)])
def test_the_first_motion_of_a_linear_train_is_its_response(frequency: str | None, omega: float) -> None:
    """Forced by an input or by a function of time; each state is scaled by its vibration."""
    amplitude = 0.5
    given = {"w": {"A": amplitude}, "f": {"B": amplitude}}.get(frequency or "", {})
    drive = {} if frequency else {"F": lambda phase, w: 2.0 + amplitude * np.cos(phase)}
    found, c, scene = first(forced(frequency, parameters=given, **drive), omega)
    wave = amplitude * response(omega)
    assert c["x"] == pytest.approx([0.0 if frequency else 2.0, wave.real, -wave.imag, 0.0, 0.0], abs=1e-9)
    assert c["v"] == pytest.approx([0.0, -omega * wave.imag, -omega * wave.real, 0.0, 0.0], abs=1e-9)
    spread = {name: np.abs(value[1:]).max() for name, value in c.items()}
    assert dict(zip(scene.state_names, found.balance.scale.tolist(), strict=True)) == pytest.approx(spread)
    assert found.balance.varies
    assert found.balance.harmonics == 2
    again, same, _ = first(forced(frequency, parameters=given, **drive), omega, known=found.balance.coefficients(found.z)[:3])
    assert same["x"] == pytest.approx(c["x"], abs=1e-9)
    assert again.z == pytest.approx(found.z, abs=1e-9)


class Wells(gl.Component):
    """``x'' + 0.3 x' = x - x^3 + 0.05 cos(w t)``: a weak vibration about 1 or -1; y starts with what tells x at the time 0."""

    w = gl.Parameter("any", default=3.0)
    x, v, y = gl.Variable("any"), gl.Variable("any"), gl.Variable("any", start=-1.0)

    def equations(self) -> list[gl.Eq]:
        force, wave = self.x - self.x**3 - 0.3 * self.v, gl.cos(self.w * gl.time)
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), force + 0.05 * wave),
            gl.Eq(self.y, self.x - 2 * wave),
        ]


@pytest.mark.parametrize(("guess", "well"), [(None, 1.0), ({"y": -1.0}, 1.0), ({"y": -3.0}, -1.0)])
def test_the_first_motion_is_that_of_the_start_values_at_the_begin_of_a_period(
    guess: dict[str, float] | None, well: float
) -> None:
    translation = gl.compile(Wells()).translation
    scene = translation.scene
    found = Forced(translation, "w", {}, {}, 3, {}).first(scene, 3.0, 32, guess)
    c = dict(zip(scene.state_names, found.balance.coefficients(found.z).T, strict=True))
    wave = 0.05 / (2.0 - 9.0 + 0.9j)
    assert c["x"][:3] == pytest.approx([well, wave.real, -wave.imag], abs=5e-4)
    assert c["v"][:3] == pytest.approx([0.0, -3.0 * wave.imag, -3.0 * wave.real], abs=2e-3)


@pytest.mark.parametrize(
    ("task", "said"),
    [
        (lambda: forced(), "^nothing varies over the period: bind an input to a function of the phase, give frequency"),
        (lambda: forced(F=lambda phase, w: 0.0 * phase + 3.0), "^nothing varies over the period"),
        (lambda: forced(parameters={"A": 1.0}), r"^der\(v\) does not repeat after 2 pi / 0\.7 rad/s; name the parameter that is"),
        (lambda: forced("w", parameters={"A": 1.0, "B": 1.0}),
         r"^der\(v\) does not repeat after 2 pi / 0\.7 rad/s; w was set to that frequency, and something varies with time otherwise"),
        (lambda: forced(F=lambda phase, w: np.inf), "the input F returned"),
        (lambda: forced(F=lambda phase, w: np.cos(phase), G=1e309), "G"),
    ],
)  # fmt: skip
def test_a_forcing_varies_and_repeats(task: Any, said: str) -> None:
    with pytest.raises(GearlibError, match=said):
        first(task(), 0.7)


@pytest.mark.parametrize("size", [1.0, 1e-4, 1e-7])
def test_a_small_forcing_beside_a_large_constant_force_repeats_as_well(size: float) -> None:
    drive = {"F": lambda phase, w: 1e4 + size * np.cos(phase)}
    for amplitude in (size, 0.1 * size):
        with pytest.raises(GearlibError, match=r"^der\(v\) does not repeat after 2 pi / 0\.7 rad/s"):
            first(forced(parameters={"A": amplitude}, **drive), 0.7)
    _, c, _ = first(forced(**drive), 0.7)
    assert np.hypot(*c["x"][1:3]) == pytest.approx(size * abs(response(0.7)), rel=1e-4)


@pytest.mark.parametrize(("omega", "harmonic"), [(1.0, 1), (0.5, 2), (1 / 3, 3)])
def test_undamped_vibration_at_a_multiple_of_the_frequency_is_refused_as_such(omega: float, harmonic: int) -> None:
    task = Forced(oscillator().translation, None, {"zeta": 0.0}, {"F": lambda phase, w: 1.0 + np.cos(phase)}, 4, {})
    said = rf"the {harmonic}\. harmonic of [xv] is undetermined: the train vibrates freely at 1 rad/s, and nothing damps that"
    with pytest.raises(SolverError, match=said):
        task.first(task.scene(["x"]), omega, 16, None, None)


class Bent(gl.Component):
    """A force that is infinite at the start; a mode that is kept."""

    F = gl.Input("1")
    kind = gl.Structural("pole")
    x = gl.Variable("1", guess=1.0)
    kept = gl.Discrete(start=1.0)

    def equations(self) -> list[Any]:
        rate = {"pole": self.F / (self.x - 1), "kept": self.F - self.x * self.kept}[self.kind]
        mode = gl.Piecewise((1 - gl.pre(self.kept), self.x > 5), (gl.pre(self.kept), True)) if self.kind == "kept" else 1.0
        return [gl.Eq(gl.der(self.x), rate), gl.Eq(self.kept, mode)]


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("pole", r"^der\(x\) is not finite at the start values; give a guess of the means$"),
        ("kept", r"^the system has a memory \(kept\), which harmonic balance cannot take; simulate it$"),
    ],
)
def test_motions_that_cannot_begin_are_refused(kind: str, said: str) -> None:
    task = Forced(gl.compile(Bent(kind=kind)).translation, None, {}, {"F": lambda phase, w: np.cos(phase)}, 2, {})
    with pytest.raises(GearlibError, match=said):
        task.first(task.scene(["x"]), 0.7, 16, None, None)


def test_each_discrete_variable_with_a_memory_is_named() -> None:
    class Counting(gl.Component):
        F = gl.Input("1")
        x, v = gl.Variable("1", start=0.0), gl.Variable("1", start=0.0)
        first, second, third = gl.Discrete(start=0.0), gl.Discrete(start=0.0), gl.Discrete(start=0.0)

        def equations(self) -> list[Any]:
            counted = [gl.pre(n) + gl.Piecewise((1, self.x > k), (0, True)) for k, n in ((1, self.first), (3, self.third))]
            return [
                gl.Eq(gl.der(self.x), self.v),
                gl.Eq(gl.der(self.v), self.F - 0.2 * self.v - self.x * (self.first + self.third + self.second)),
                gl.Eq(self.first, counted[0]),
                gl.Eq(self.second, self.x > 2),
                gl.Eq(self.third, counted[1]),
            ]

    with pytest.raises(GearlibError, match=r"a memory \(first, third\),"):
        gl.harmonic_balance(gl.compile(Counting()), 2.0, 2.1, inputs={"F": lambda phase, w: np.cos(phase)}, outputs=["x"])


class Sided(gl.Component):
    """A spring that is three times as stiff on one side; which side it is on may be a discrete variable, which has no memory."""

    F = gl.Input("1")
    named = gl.Structural(False)
    x, v = gl.Variable("1", start=0.0), gl.Variable("1", start=0.0)
    side, other = gl.Discrete(start=0.0), gl.Discrete(start=0.0)

    def equations(self) -> list[Any]:
        side = gl.Piecewise((3, self.x > 0), (1, True))
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), self.F - 0.2 * self.v - self.x * (self.side * self.other if self.named else side)),
            gl.Eq(self.other, 1.0),
            gl.Eq(self.side, side),
        ]


def test_a_discrete_variable_without_memory_is_no_hindrance() -> None:
    found = [
        gl.harmonic_balance(
            gl.compile(Sided(named=named)), 2.0, 2.1, harmonics=3, inputs={"F": lambda phase, w: np.cos(phase)}, outputs=["x"]
        )
        for named in (False, True)
    ]
    assert found[1].coefficients == pytest.approx(found[0].coefficients, rel=1e-9)
    assert found[0].mean("x")[0] < -0.1


class Loaded(gl.Component):
    """A phase that turns with a speed that its own load determines, with a ripple."""

    p = gl.Variable("rad", state="prefer")
    w = gl.Variable("rad/s", start=2.0)
    tau = gl.Parameter("s", default=1.0)
    rate = gl.Parameter("rad/s", default=2.0)
    ripple = gl.Parameter("rad/s", default=0.1)

    def equations(self) -> list[gl.Eq]:
        torque = self.rate + self.ripple * gl.cos(self.p)
        return [gl.Eq(gl.der(self.p), self.w), gl.Eq(self.tau * gl.der(self.w), torque - self.w)]


class Row(gl.Component):
    """Two bodies that turn at the speed of each other but for an error that one phase makes, and two phases."""

    p, q = gl.Variable("1", state="prefer"), gl.Variable("1", state="prefer")
    d = gl.Variable("1")
    w, v = gl.Variable("1", start=2.0), gl.Variable("1", start=2.0)

    def equations(self) -> list[gl.Eq]:
        between = self.d + 0.1 * (self.w - self.v)
        return [
            gl.Eq(gl.der(self.p), self.w),
            gl.Eq(gl.der(self.q), self.v),
            gl.Eq(gl.der(self.d), (1 + 0.01 * gl.cos(self.p)) * self.w - self.v),
            gl.Eq(gl.der(self.w), -between),
            gl.Eq(gl.der(self.v), between),
        ]


def test_phases_that_an_error_ties_to_each_other_are_refused_as_such() -> None:
    task = Forced(gl.compile(Row()).translation, None, {}, {}, 2, {"p": 1.0, "q": 1.0})
    said = r"^the train turns with p, q at a speed .* Transmission errors of meshes in a row determine it as well: give them as functions"
    with pytest.raises(SolverError, match=said):
        task.first(task.scene(["w", "d", "q"]), 2.0, 16, None, None)


def test_a_train_that_chooses_its_speed_cannot_be_told_another() -> None:
    task = Forced(gl.compile(Loaded()).translation, None, {}, {}, 2, {"p": 1.0})
    said = r"^the train turns with p at a speed that its torques determine, which is not the one that 2 rad/s asks for; make the torques"
    with pytest.raises(SolverError, match=said):
        task.first(task.scene(["w"]), 2.0, 16, None, None)
