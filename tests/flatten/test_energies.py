"""Energy terms of components: which product of a potential and a flow is a power."""

from __future__ import annotations

from typing import Any

import pytest
import sympy

import gearlib as gl
import gearparts as gp
from gearlib.errors import DeclarationError
from gearlib.flatten.energies import Audited, audited


def connector(*pairs: tuple[str, str]) -> Any:
    """A connector with a potential and a flow for each pair of units."""
    declared: dict[str, Any] = {}
    for k, (across, through) in enumerate(pairs):
        declared |= {f"e{k}": gl.Potential(across, "across"), f"f{k}": gl.Flow(through, "through")}
    return type("Plug", (gl.Connector,), declared)


def part(**declared: Any) -> Audited:
    found = audited(type("Part", (gl.Component,), declared)())
    assert len(found) == 1, "a component with a connector, or with energies, is examined"
    return found[0]


def said(term: Any) -> Any:
    return None if term is None else term.formula.expression


def symbol(name: str) -> Any:
    return sympy.Symbol(name, real=True)


@pytest.mark.parametrize(
    ("units", "power"),
    [
        (("rad", "N.m"), symbol("der(p.e0)") * symbol("p.f0")), (("m", "N"), symbol("der(p.e0)") * symbol("p.f0")),
        (("V", "A"), symbol("p.e0") * symbol("p.f0")),
        (("rad/s", "N.m"), symbol("p.e0") * symbol("p.f0")), (("K", "W"), symbol("p.f0")),
        (("Pa", "m3/s"), symbol("p.e0") * symbol("p.f0")),
    ],
)  # fmt: skip
def test_power_through_a_connector_by_its_units(units: tuple[str, str], power: Any) -> None:
    found = part(p=connector(units)("one"))
    assert said(found.through) == power
    assert (found.heat_in, found.unknown, found.declares, found.source) == (None, False, False, False)


@pytest.mark.parametrize("units", [("rad", "W.s"), ("any", "N"), ("K", "J"), ("m", "any")])
def test_power_that_is_not_known(units: tuple[str, str]) -> None:
    found = part(p=connector(units)("one"))
    assert found.unknown == (units != ("rad", "W.s"))  # W.s is N.m
    one_known = part(p=connector(units, ("rad", "N.m"))("one"), q=gp.Flange("other"))
    assert one_known.unknown == found.unknown
    assert part(
        p=type("Odd", (gl.Connector,), {"e": gl.Potential("rad"), "f": gl.Flow("N.m"), "g": gl.Flow("N")})("odd")
    ).unknown


def test_heat_beside_work_is_counted_apart() -> None:
    heat, turn = connector(("K", "W")), connector(("rad", "N.m"))
    found = part(a=turn("one"), b=turn("other"), c=heat("heat"), d=heat("more heat"))
    assert said(found.through) == symbol("der(a.e0)") * symbol("a.f0") + symbol("der(b.e0)") * symbol("b.f0")
    assert said(found.heat_in) == symbol("c.f0") + symbol("d.f0")
    wired = part(a=connector(("V", "A"))("one"), b=connector(("rad/s", "N.m"))("other"), c=heat("heat"), d=turn("third"))
    across = [symbol(f"{plug}.e0") * symbol(f"{plug}.f0") for plug in "ab"]
    assert said(wired.through) == sum(across) + symbol("der(d.e0)") * symbol("d.f0")
    assert said(wired.heat_in) == symbol("c.f0")
    alone = part(c=heat("heat"), d=heat("more heat"))
    assert (said(alone.through), alone.heat_in) == (symbol("c.f0") + symbol("d.f0"), None)


def test_what_a_component_declares() -> None:
    w, J = symbol("w"), symbol("J")
    declared = {
        "w": gl.Variable("rad/s"),
        "J": gl.Parameter("kg.m2", default=2.0),
        "d": gl.Parameter("N.m.s", default=0.5),
        "flange": gp.Flange("shaft"),
    }
    found = part(
        **declared, energies=lambda s: gl.Energy(stored=s.J * s.w**2 / 2, heat=s.d * gl.no_event(abs(s.w)), source=True)
    )
    assert (said(found.stored), found.supplied, found.source, found.declares) == (J * w**2 / 2, None, True, True)
    assert found.heat is not None
    assert found.heat.names == ("d", "w")
    assert [float(found.heat.function(0.5, v)) for v in (-4.0, 4.0)] == [2.0, 2.0]
    assert found.terms == [found.through, found.stored, found.heat]
    nothing = part(**declared, energies=lambda s: gl.Energy())
    assert (nothing.stored, nothing.heat, nothing.declares) == (None, None, True)
    rate = part(**declared, energies=lambda s: gl.Energy(supplied=gl.der(s.w) * gl.time))
    assert rate.supplied is not None
    assert rate.supplied.names == ("der(w)", "time")


def test_names_are_paths_and_composites_only_pass_power_on() -> None:
    class Box(gl.Component):
        flange = gp.Flange("outside")

        def assemble(self) -> list[Any]:
            self.body = gp.Inertia(J=1.0)
            return [gl.connect(self.flange, self.body.flange_a)]

    class Whole(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.box = gp.Torque(tau=1.0), Box()
            return [gl.connect(self.torque.flange, self.box.flange)]

    found = {a.path: a for a in audited(Whole())}
    assert list(found) == ["torque", "box.body"]
    assert found["torque"].source
    assert not found["box.body"].source
    assert all(name.removeprefix("der(").startswith("box.body.") for term in found["box.body"].terms for name in term.names)
    assert audited(gp.Inertia(J=1.0))[0].path == "Inertia"


def test_names_that_are_not_declared_are_refused() -> None:
    with pytest.raises(DeclarationError, match=r"Part: stored energy holds 'v', which is not declared; .*speed"):
        part(speed=gl.Variable("m/s"), energies=lambda s: gl.Energy(stored=sympy.Symbol("v") ** 2))
