"""What holds for every component that is exported: documented, with units, balanced, and true to energy."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.language.component import equations_of
from gearlib.language.declarations import declared_by
from tests.gearparts.bench import bench, structural_choices

MADE_FROM_DATA = {"BondGraphPart", "FMU"}  # a base class, of no use by itself; made of a file
EXPORTED = [getattr(gp, name) for name in gp.__all__ if name not in MADE_FROM_DATA]
COMPONENTS = [c for c in EXPORTED if isinstance(c, type) and issubclass(c, gl.Component)]
# PlanetaryUnit has neither parts nor equations: it makes one of the classes that have them.
LEAVES = [c for c in COMPONENTS if c.assemble is gl.Component.assemble and c.equations is not gl.Component.equations]
CASES = [
    pytest.param(c, g, id="-".join([c.__name__, *(f"{k}={v}" for k, v in g.items())]))
    for c in COMPONENTS
    for g in structural_choices(c)
]
SYMBOL = r"(1|rad|m|s|kg|N|K|W|J|Hz)\d?"
UNIT = re.compile(rf"{SYMBOL}(\.{SYMBOL})*(/{SYMBOL})?")


def test_every_export_is_listed_once_and_found() -> None:
    assert len(COMPONENTS) >= 50
    assert sorted(set(gp.__all__)) == gp.__all__
    assert set(gp.__all__) <= set(dir(gp))
    with pytest.raises(AttributeError, match="no attribute 'Inerta'"):
        gp.Inerta  # noqa: B018


@pytest.mark.parametrize("kind", COMPONENTS)
def test_declarations_have_units_and_descriptions(kind: type[gl.Component]) -> None:
    for name, declared in kind._declarations.items():
        assert declared.description.strip(), name  # type: ignore[attr-defined]
        if isinstance(declared, (gl.Variable, gl.Parameter)):
            assert declared.unit == "any" or UNIT.fullmatch(declared.unit), (name, declared.unit)


@pytest.mark.parametrize("kind", COMPONENTS)
def test_docstrings_state_the_equation(kind: type[gl.Component]) -> None:
    assert kind.__doc__
    if kind in LEAVES:
        assert re.search(r"``[^`]*[= ][^`]*``|::\n.*=", kind.__doc__, re.DOTALL)


@pytest.mark.parametrize("kind", LEAVES)
def test_a_leaf_has_one_equation_for_each_of_its_own_unknowns(kind: type[gl.Component]) -> None:
    for choice in structural_choices(kind):
        part = kind(**choice)
        declared = declared_by(part)
        unknowns = [v for v in declared.variables.values() if not isinstance(v, gl.Input)]
        given_by_connections = sum(isinstance(v, gl.Flow) for v in unknowns)
        equations = [e for e in equations_of(part) if isinstance(e, gl.Eq)]
        assert len(equations) == len(unknowns) - given_by_connections + len(declared.discretes), choice


@pytest.mark.parametrize(("kind", "choice"), CASES)
def test_it_is_balanced_between_bodies(kind: type[gl.Component], choice: dict[str, Any]) -> None:
    system = gl.compile(bench(kind, **choice))
    model = system.translation.variants.model
    assert model.n_equations + len(model.inputs) == model.n_variables
    assert system.name == "Bench"


def test_losses_are_positive_and_leave_through_the_heat_port(probe: Callable[..., Any]) -> None:
    for kind in (gp.Damper, gp.SpringDamper, gp.TranslationalDamper, gp.TranslationalSpringDamper, gp.EddyCurrentTorque):
        p = probe(bench(kind, use_heat_port=True))
        value = p.values({s: 2.5 * (-1) ** i for i, s in enumerate(p.states)})
        assert value("part.loss_power") > 0
        assert value("part.heat_port.Q_flow") == -value("part.loss_power")
        assert 2.3 * value("der(at_heat_port.T)") == pytest.approx(value("part.loss_power"))


def test_the_page_for_users_of_modelica_names_parts_that_exist() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "modelica.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`gp\.(\w+)`", page))
    assert len(named) > 45
    assert named <= set(gp.__all__)
