"""A value that is given where it has no meaning is refused by name, with the choice that would give it one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError
from gearlib.flatten.flatten import flatten
from gearlib.flatten.instances import walk
from gearlib.flatten.unused import Used, refuse_unused
from tests.gearparts.bench import needed_values, structural_choices

SET = {"R_s": 0.0285, "R_p": 0.0465, "I_s": 0.0015, "I_r": 0.151, "I_h": 0.0491, "I_spin": 0.0094, "I_orbit": 0.0094}
MESH = {"r_a": 0.03, "r_b": 0.06, "c": 1e8, "d": 10.0}
ROWS = ((0.0, 0.9, 0.9),)
CASES: list[tuple[Callable[..., gl.Component], dict[str, Any], str, str]] = [
    (gp.PlanetaryUnit, {**SET, "level": "planar", "sun_details": (("b", 1e-4),)}, "sun_details", "level='elastic'"),
    (gp.PlanetaryUnit, {**SET, "level": "ideal", "K_ring": 1e8}, "K_ring", "level='elastic' or level='planar'"),
    (gp.PlanetaryUnit, {**SET, "sun_efficiency": ROWS}, "sun_efficiency", "level='lossy'"),
    (gp.PlanetaryUnit, {**SET, "planet_meshes": "separate", "C_v": 3.0}, "C_v", "planet_meshes='lumped'"),
    (gp.PlanetaryUnit, {**SET, "level": "planar", "planet_meshes": "separate"}, "planet_meshes", "level='elastic'"),
    (gp.PlanetaryUnit, {**SET, "level": "ideal", "e_rate": gl.sin(gl.time)}, "e_rate", "level='elastic'"),
    (gp.DetailedExternalMesh, {**MESH, "b": 1e-4}, "b", "backlash=True"),
    (gp.DetailedExternalMesh, {**MESH, "mu": 0.1}, "mu", "friction=True"),
    (gp.DetailedExternalMesh, {**MESH, "contact_ratio": 1.7}, "contact_ratio", "stiffness='rectangular' or friction=True"),
    (gp.DetailedInternalMesh, {**MESH, "c_amplitude": 0.1}, "c_amplitude", "stiffness='sinusoidal'"),
    (gp.ZhouCui2022, {"K_s": 1e8}, "K_s", "elastic_shafts=True"),
    (gp.XPTrain, {"planet_meshes": "separate", "C_v": 3.0}, "C_v", "planet_meshes='lumped'"),
    (gp.XXTrain, {"C_v": 3.0}, "C_v", "planet_meshes='lumped'"),
    (gp.LossyGear, {"ratio": 2.0, "smoothness": "akima"}, "smoothness", "leave it out"),
    (gp.InitializeFlange, {"use_w_start": False, "w_start": 3.0}, "w_start", "use_w_start=True"),
    (gp.ElasticCoupling, {"J_a": 1.0, "J_b": 1.0, "c": 1.0, "d": 1.0, "b": 0.1}, "b", "element='backlash'"),
    (gp.Position, {"exact": True, "phi_ref": 0.0, "f_crit": 5.0}, "f_crit", "exact=False"),
    (gp.EddyCurrentTorque, {"tau_nominal": 1.0, "w_nominal": 1.0, "use_heat_port": True, "T": 300.0}, "T", "use_heat_port=False"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "given", "name", "advice"), CASES, ids=[f"{c[0].__name__}-{c[2]}" for c in CASES])
def test_it_is_refused_with_the_choice_that_gives_it_a_meaning(
    kind: Callable[..., gl.Component], given: dict[str, Any], name: str, advice: str
) -> None:
    class Outer(gl.Component):
        def assemble(self) -> Any:
            self.part = kind(**given)
            return []

    with pytest.raises(BindingError) as refused:
        gl.compile(Outer())
    text = str(refused.value)
    assert text.startswith(f"part ({kind.__name__}): {name}=")
    assert "has no effect" in text
    assert text.endswith(advice)


LEVELS = [
    kind for kind in (getattr(gp, name) for name in gp.__all__) if isinstance(kind, type) and issubclass(kind, gl.Component)
]


@pytest.mark.parametrize("kind", [kind for kind in LEVELS if kind not in (gp.BondGraphPart, gp.FMU)])
def test_every_parameter_of_a_library_part_counts_with_some_choice_and_is_refused_with_all_others(kind: Any) -> None:
    """Over all combinations of choices; each name is given once where it counts and once where it does not, one more for each choice."""
    names = [n for n, d in kind._declarations.items() if isinstance(d, (gl.Parameter, gl.Input))]
    seen = set[tuple[str, bool]]()
    for k, choice in enumerate(structural_choices(kind)):
        needed = needed_values(kind, 1.0)
        used = Used(walk(kind(**needed, **choice)))
        for i, name in enumerate(names):
            counts = used.has(0, name)
            if (name, counts) in seen and i != k % len(names):
                continue
            seen.add((name, counts))
            part = kind(**{**gl.offered(needed), name: 0.7}, **choice)
            tree = walk(part)
            if counts:
                refuse_unused(tree, part)
            else:
                with pytest.raises(BindingError, match=f"{name}=0.7 has no effect"):
                    refuse_unused(tree, part)
    counted = {name for name, counts in seen if counts}
    assert set(names) - counted <= {"ring_phase", "k_ring_phi"}  # need numbers of teeth, or a stiffness of their own


class Own(gl.Component):
    """A user's part."""

    heavy = gl.Structural(False)
    law = gl.Structural("none", choices=("none", "table"))
    table = gl.Structural(((0.0, 1.0),))
    m = gl.Parameter("kg", default=1.0)
    u = gl.Input("1", default=0.0)
    x = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        slope = self.table[0][1] if self.law == "table" else 1.0
        return [gl.Eq(gl.der(self.x), self.m * self.u if self.heavy else slope)]


class Passing(gl.Component):
    """Hands its values down, whether the part uses them or not."""

    heavy = gl.Structural(False)
    m = gl.Parameter("kg", default=2.0)
    u = gl.Input("1", default=0.0)

    def assemble(self) -> Any:
        self.part = Own(heavy=self.heavy, m=2 * self.m, u=self.u + 1)
        return []


def test_users_components_and_composites() -> None:
    for part in (
        Own(),
        Own(heavy=True, m=2.0, u=3.0),
        Own(law="table", table=((0.0, 2.0),)),
        Passing(),
        Passing(heavy=True, m=3.0, u=1.0),
    ):
        gl.compile(part)
    with pytest.raises(
        BindingError, match=r"Own: m=2\.0 has no effect with heavy=False, law='none'; it counts with heavy=True"
    ):
        gl.compile(Own(m=2.0))
    with pytest.raises(BindingError, match=r"Own: u=2 has no effect .* it counts with heavy=True"):
        gl.compile(Own(u=2))
    with pytest.raises(BindingError, match=r"Own: table=.* has no effect .* it counts with law='table'"):
        gl.compile(Own(table=((0.0, 2.0),)))
    with pytest.raises(
        BindingError, match=r"Own: table=.* has no effect with heavy=True, law=.none.; it counts with law=.table."
    ):
        gl.compile(Own(heavy=True, table=((0.0, 2.0),), m=2.0, u=3.0))
    with pytest.raises(BindingError, match=r"Passing: m=3\.0 has no effect with heavy=False; it counts with heavy=True"):
        gl.compile(Passing(m=3.0))
    with pytest.raises(BindingError, match=r"Passing: u=1\.0 has no effect"):
        gl.compile(Passing(u=1.0))


def test_what_is_offered_may_go_unused() -> None:
    pair = gp.GearPair(20, 40, m_n=3e-3, width=0.02)
    for friction in (False, True):
        walk(gp.DetailedExternalMesh(**pair.mesh_values(), d=1.0, friction=friction))
    part = Own(**gl.offered({"m": 2.0, "u": 1.0}))
    gl.compile(part)
    assert gl.compile(Own(heavy=True, **gl.offered({"m": 2.0, "u": 3.0}))).simulate(1.0, samples=2)["x"][-1] == pytest.approx(
        6.0
    )


class Sized(gl.Component):
    """A choice that nothing but the default of a parameter asks for, which counts in one kind of model."""

    heavy = gl.Structural(False)
    bodies = gl.Structural(1)
    m = gl.Parameter("kg", default=lambda part: 0.5 * part.bodies)
    x = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.m if self.heavy else 1.0)]


def test_a_choice_that_the_default_of_a_parameter_asks_for_counts_where_the_parameter_does() -> None:
    assert gl.simulate(Sized(heavy=True, bodies=3), 1.0, samples=2)["x"][-1] == pytest.approx(1.5)
    with pytest.raises(BindingError, match=r"Sized: bodies=3 has no effect with heavy=False; it counts with heavy=True"):
        gl.compile(Sized(bodies=3))
    with pytest.raises(BindingError, match=r"Sized: bodies=3 has no effect"):
        gl.compile(Sized(heavy=True, bodies=3, m=2.0))


class Kinds(gl.Component):
    """A parameter that counts with the last of many kinds, and another choice."""

    kind = gl.Structural(0, choices=tuple(range(12)))
    on = gl.Structural(False)
    m = gl.Parameter("1", default=1.0)
    x = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.m if self.on and self.kind == 11 else 1.0)]


def test_two_choices_together_are_advised_however_many_values_one_of_them_has() -> None:
    with pytest.raises(BindingError) as refused:
        gl.compile(Kinds(m=2.0))
    assert str(refused.value) == "Kinds: m=2.0 has no effect with kind=0, on=False; it counts with kind=11 and on=True"


class Broken(gl.Component):
    """Reads a number in a kind whose equations are wrong."""

    kind = gl.Structural("sound", choices=("sound", "wrong"))
    bodies = gl.Structural(1)
    x = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), 1.0)] if self.kind == "sound" else [gl.Eq(self.missing, self.bodies)]


class Made(gl.Component):
    """Needs more than its parameters to be made, so that no other choice can be tried."""

    heavy = gl.Structural(False)
    m = gl.Parameter("kg", default=1.0)
    x = gl.Variable("1")

    def __init__(self, size: int, **values: Any) -> None:
        super().__init__(**values)
        self.size = size

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.m if self.heavy else self.size)]


def test_advice_is_what_other_choices_show() -> None:
    """Where they fail, what was read before that counts; where none can be tried, there is none."""
    with pytest.raises(BindingError) as refused:
        gl.compile(Broken(bodies=2))
    assert str(refused.value) == "Broken: bodies=2 has no effect with kind='sound'; leave it out"
    with pytest.raises(BindingError) as refused:
        gl.compile(Made(3, m=2.0))
    assert str(refused.value) == "Made: m=2.0 has no effect with heavy=False; leave it out"


@pytest.mark.parametrize("length", [58, 59])
def test_long_values_are_cut(length: int) -> None:
    """A text of up to 60 letters, with its quotes, is shown whole."""
    value = "x" * length
    with pytest.raises(BindingError) as refused:
        gl.compile(
            type(
                "Named",
                (Own,),
                {
                    "note": gl.Structural(
                        "",
                    )
                },
            )(note=value)
        )
    shown = repr(value) if length == 58 else f"{repr(value)[:55]} ..."
    assert f"note={shown} has no effect" in str(refused.value)


class Inner(gl.Component):
    """Uses what it is told to, through a parameter that follows from another one, and from an input."""

    law = gl.Structural("none", choices=("none", "all"))
    a = gl.Parameter("1", default=1.0)
    b = gl.Parameter("1", default=lambda part: 2 * part.a)
    u = gl.Input("1", default=0.0)
    x = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.b + self.u if self.law == "all" else 1.0)]


class Paths(gl.Component):
    """A parameter for each way in which one may count, and one for each in which it does not."""

    names = ("law", "event", "reset", "begin", "chain", "bound", "twice", "idle_chain", "idle_bound", "none")
    law, event, reset, begin, chain, bound, twice, idle_chain, idle_bound, none = (
        gl.Parameter("1", default=1.0) for _ in range(10)
    )
    signal, idle = gl.Input("1", default=0.0), gl.Input("1", default=0.0)
    y = gl.Variable("1", start=0.0)
    n = gl.Discrete()

    def assemble(self) -> list[Any]:
        self.inner = Inner(law="all", a=self.chain, u=self.bound + self.signal, start={"x": 3 * self.begin})
        self.idle_inner = Inner(a=self.idle_chain, u=self.idle_bound * self.idle)
        self.deeper = [Through(a=self.twice), Through(law="none")]
        return []

    def equations(self) -> list[Any]:
        when = gl.When(self.y > 1, gl.reinit(self.y, self.reset), gl.Eq(self.n, gl.pre(self.n) + self.event))
        return [gl.Eq(gl.der(self.y), self.law), when]


class Through(gl.Component):
    law = gl.Structural("all", choices=("none", "all"))
    a = gl.Parameter("1", default=1.0)

    def assemble(self) -> list[Any]:
        self.inner = Inner(law=self.law, a=2 * self.a)
        return []


def test_what_counts_is_found_by_all_ways_to_an_equation() -> None:
    """In equations, at events, in start values, and by way of other parameters and of inputs that count."""
    tree = walk(Paths())
    used = Used(tree)
    number = {instance.path: k for k, instance in enumerate(tree.instances)}
    counts = {name for name in Paths.names if used.has(0, name)}
    assert counts == {"law", "event", "reset", "begin", "chain", "bound", "twice"}
    assert (used.has(0, "signal"), used.has(0, "idle")) == (True, False)
    for path, here in (("inner", True), ("idle_inner", False), ("deeper[0].inner", True), ("deeper[1].inner", False)):
        assert {name: used.has(number[path], name) for name in "abu"} == dict.fromkeys("abu", here)
    assert (used.has(number["deeper[0]"], "a"), used.has(number["deeper[1]"], "a")) == (True, False)
    for name in Paths.names:
        part = Paths(**{name: 2.0})
        if name in counts:
            refuse_unused(walk(part), part)
        else:
            with pytest.raises(BindingError, match=rf"^Paths: {name}=2\.0 has no effect.*; leave it out$"):
                refuse_unused(walk(part), part)


def test_values_behind_one_that_counts_are_looked_at() -> None:
    """Values that may go unused, that count, or that are the default, do not end the search; nor do choices."""
    offered = gl.offered({"m": 2.0, "u": 1.0})
    table = ((0.0, 2.0),)
    for given in ({**offered, "table": table}, {"table": np.array(table)}, {"law": "none", "heavy": False, "table": table}):
        with pytest.raises(BindingError, match=r"^Own: table=.* has no effect"):
            flatten(Own(**given))

    class Two(gl.Component):
        k = gl.Parameter("1", default=1.0)

        def assemble(self) -> list[Any]:
            self.first = Own(heavy=True, m=2.0, u=self.k)
            self.second = Own(**gl.offered({"m": 3.0}), u=4.0)
            return []

    with pytest.raises(BindingError, match=r"^second \(Own\): u=4\.0 has no effect"):
        flatten(Two())


class Both(gl.Component):
    """Its number counts where two choices are made, of three."""

    cold = gl.Structural(False)
    heavy = gl.Structural(False)
    law = gl.Structural("none", choices=("none", "one", "two"))
    m = gl.Parameter("kg", default=1.0)
    x = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.m if self.heavy and self.law == "two" else 2.0 if self.cold else 1.0)]


def test_advice_may_be_two_choices() -> None:
    with pytest.raises(BindingError) as refused:
        flatten(Both(m=3.0))
    assert str(refused.value) == (
        "Both: m=3.0 has no effect with cold=False, heavy=False, law='none'; it counts with heavy=True and law='two'"
    )


def test_an_input_that_is_left_to_the_run_and_values_that_are_functions_may_go_unused() -> None:
    class Two(gl.Component):
        k = gl.Parameter("kg", default=1.0)

        def assemble(self) -> list[Any]:
            self.first = Own(u=None)
            self.second = Own(m=lambda part: 2.0)
            self.third = Own(heavy=True, m=self.k)
            return []

    part = Two()
    refuse_unused(walk(part), part)


def test_advice_for_a_composite_is_by_its_own_parameters() -> None:
    """Whatever those of its parts are called."""

    class Renaming(gl.Component):
        heavy, mass = gl.Structural(False), gl.Parameter("kg", default=2.0)

        def assemble(self) -> list[Any]:
            self.part = Own(heavy=self.heavy, m=self.mass)
            return []

    with pytest.raises(BindingError) as refused:
        flatten(Renaming(mass=3.0))
    assert str(refused.value) == "Renaming: mass=3.0 has no effect with heavy=False; it counts with heavy=True"


def test_choices_count_in_every_part_of_a_class_though_its_equations_are_written_once() -> None:
    class Three(gl.Component):
        def assemble(self) -> list[Any]:
            self.part = [Own(law="table", table=((0.0, 2.0),)) for _ in range(3)]
            return []

    three = Three()
    refuse_unused(walk(three), three)
