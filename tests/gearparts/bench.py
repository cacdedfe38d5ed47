"""A test bench: any component, with a body at each of its connectors."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from typing import Any

import gearlib as gl
import gearparts as gp
from gearlib.language.declarations import NO_VALUE, declared_by

# At each kind of connector: a body, its connector to the part, its other connector, and a force on that.
ENDS: dict[type[gl.Connector], tuple[Any, str, str, Any]] = {
    gp.Flange: (lambda: gp.Inertia(J=1.3), "flange_a", "flange_b", lambda x: gp.Torque(tau=x)),
    gp.TranslationalFlange: (lambda: gp.Mass(m=1.7), "flange_a", "flange_b", lambda x: gp.Force(f=x)),
    gp.HeatPort: (lambda: gp.HeatCapacitor(C=2.3), "port", "", None),
    gp.PlanarFlange: (lambda: gp.PlanarBody(m=1.7, J=1.3), "centre", "", None),
}


def needed_values(kind: type[gl.Component], signal: Any) -> dict[str, Any]:
    """Numbers for the parameters that have no default, and a signal for the inputs."""
    values: dict[str, Any] = {}
    made = type(kind.__new__(kind))  # a class may make one of its own models
    for name, declared in made._declarations.items():
        if isinstance(declared, gl.Parameter) and declared.default is NO_VALUE:
            values[name] = min(0.7 + 0.1 * len(values), declared.max)
        elif isinstance(declared, gl.Input) and declared.default is NO_VALUE:
            values[name] = signal
    return values


# Choices that are refused, since another choice leaves nothing to choose.
WITHOUT_EFFECT: dict[str, Callable[[dict[str, Any]], bool]] = {
    "LossyGear": lambda c: c["smoothness"] != "linear",  # one row is not interpolated
}


def structural_choices(kind: type[gl.Component]) -> Iterator[dict[str, Any]]:
    """All combinations of a class's yes-or-no choices and of those from a list; numbers keep their default."""
    options: dict[str, tuple[Any, ...]] = {}
    for name, declared in kind._declarations.items():
        if isinstance(declared, gl.Structural):
            options[name] = declared.choices or ((False, True) if isinstance(declared.default, bool) else (declared.default,))
    for values in itertools.product(*options.values()):
        choice = dict(zip(options, values, strict=True))
        if not WITHOUT_EFFECT.get(kind.__name__, lambda c: False)(choice):
            yield choice


class Bench(gl.Component):
    """``part``, and at each of its connectors a body of the connector's name, with a force on it: ``at_flange_a``, ..."""

    kind = gl.Structural(None, "class of the part")
    given = gl.Structural((), "its structural choices and values, as pairs")

    def assemble(self) -> Any:
        signal = gl.sin(3 * gl.time)
        self.part = self.kind(**{**needed_values(self.kind, signal), **dict(self.given)})
        links = []
        for name, connector in declared_by(self.part).connectors.items():
            make_body, near, far, drive = ENDS[type(connector)]
            body = make_body()
            setattr(self, f"at_{name}", body)
            links.append(gl.connect(getattr(self.part, name), getattr(body, near)))
            if drive is not None:
                force = drive(2.3 - 1.9 * len(links))
                setattr(self, f"on_{name}", force)
                links.append(gl.connect(getattr(body, far), force.flange))
        return links


def bench(kind: type[gl.Component], **given: Any) -> Bench:
    return Bench(kind=kind, given=tuple(given.items()))
