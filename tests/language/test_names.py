"""What a user calls a variable, a parameter or a part does not matter, also where the library uses the same name inside."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import GearlibError

INSIDE = (
    "p0", "p1", "p2", "a0", "a1", "v0", "v1", "x0", "x1", "d0", "q0", "r0", "s0", "when_0", "when_0_before", "sample_0", "relation_0",
    "initial", "t", "x", "dx", "y", "u", "f", "rhs", "data", "index", "state", "slots", "rates", "jac", "floats", "ints", "unknown",
    "sin", "pre", "der", "sqrt", "E", "I", "N", "O", "Q", "S", "pi", "oo", "beta", "gamma", "zeta", "np",
)  # fmt: skip
ROLES = ("angle", "speed", "torque", "sine", "gain", "loss", "mode", "drive", "level", "first", "second")


def oscillator(names: dict[str, str]) -> type[gl.Component]:
    """A driven pendulum with a spring that switches, a loop-free algebraic sine, a hysteresis and a speed that events change."""

    def equations(self: Any) -> list[Any]:
        angle, speed, torque, sine, gain, loss, mode, drive = (getattr(self, names[role]) for role in ROLES[:8])
        return [
            gl.Eq(gl.der(angle), speed),
            gl.Eq(gl.der(speed), torque),
            gl.Eq(torque, -gain * sine - loss * speed + drive + gl.Piecewise((0.3, gl.holds(mode)), (-0.2, True))),
            gl.Eq(sine, gl.sin(angle) + 0.1 * gl.cos(3 * gl.time)),
            gl.Eq(mode, gl.Piecewise((0, angle < -0.2), (1, angle > 0.2), (gl.pre(mode), True))),
            gl.When(speed > 0.7, gl.reinit(speed, 0.9 * speed)),
        ]

    declared = {
        "angle": gl.Variable("rad", start=0.5), "speed": gl.Variable("rad/s", start=0.0), "torque": gl.Variable("any"),
        "sine": gl.Variable("any"), "gain": gl.Parameter("any", default=4.0), "loss": gl.Parameter("any", default=0.2),
        "mode": gl.Discrete(start=1), "drive": gl.Input("any"),
    }  # fmt: skip
    return type(
        "Oscillator", (gl.Component,), {names[role]: made for role, made in declared.items()} | {"equations": equations}
    )


def two(names: dict[str, str]) -> type[gl.Component]:
    """Two of them, with parameters and drives that are bound to expressions with numbers and a parameter of the whole."""

    def assemble(self: Any) -> list[Any]:
        level, kind = getattr(self, names["level"]), oscillator(names)
        setattr(
            self,
            names["first"],
            kind(**{names["gain"]: 2.5 * level + 1.5, names["drive"]: 0.2 * level + 0.1 * gl.sin(2.0 * gl.time)}),
        )
        setattr(self, names["second"], kind(**{names["loss"]: level / 10.0, names["drive"]: 0.5}))
        return []

    level = gl.Parameter("any", default=1.5)
    return type("Two", (gl.Component,), {names["level"]: level, "assemble": assemble})


def moved(names: dict[str, str], method: str) -> dict[str, Any]:
    """Histories, changes with the parameter of the whole, and poles, by role."""
    system = gl.compile(two(names)())
    run = system.simulate(2.0, samples=9, method=method, rtol=1e-9, sensitivities=[names["level"]])
    found: dict[str, Any] = {}
    for part, path in ((part, names[part]) for part in ("first", "second")):
        found |= {
            f"{part}.{role}": run[f"{path}.{names[role]}"] for role in ("angle", "speed", "torque", "sine", "mode", "drive")
        }
        found[f"der({part}.sine)"] = run[f"der({path}.{names['sine']})"]
        found[f"{part}.angle by level"] = run.sensitivity(f"{path}.{names['angle']}", names["level"])
    inputs = [f"{names[part]}.{names['drive']}" for part in ROLES[-2:]]
    linear = system.linearize(inputs, [f"{names['second']}.{names['sine']}"])
    found["poles"] = np.sort_complex(np.linalg.eigvals(linear.A))
    found["response"] = np.ravel(linear(2.0j))
    return found


@cache
def plainly(method: str) -> dict[str, Any]:
    return moved(dict(zip(ROLES, ROLES, strict=True)), method)


def renamed(first: int) -> dict[str, str]:
    return {role: INSIDE[(first + 5 * k) % len(INSIDE)] for k, role in enumerate(ROLES)}


@pytest.mark.parametrize("method", ["rk", "ida"])
@pytest.mark.parametrize("first", [0, 7, 13, 29])
def test_a_model_moves_alike_whatever_its_names_are(first: int, method: str) -> None:
    """Or a name is refused, by itself."""
    names = renamed(first)
    try:
        found = moved(names, method)
    except GearlibError as refusal:
        assert any(f".{name}: this name is reserved" in str(refusal) for name in names.values()), refusal
        return
    for role, values in plainly(method).items():
        assert found[role] == pytest.approx(values, rel=1e-6, abs=1e-7), (role, names)


@pytest.mark.stress
@pytest.mark.parametrize("first", range(len(INSIDE)))
def test_a_model_moves_alike_under_many_names(first: int) -> None:
    test_a_model_moves_alike_whatever_its_names_are(first, "rk")
