"""Bond graphs as components: bonds driven by sources become flanges, everything else becomes equations.

The equations are those of the individual elements and junctions, without causality: states and the matching are determined as for any
other component. :func:`gearlib.bondgraph.state_equations` derives its equations independently from the same graph.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, cast

import sympy as sp

import gearlib as gl
from gearlib.arguments import by_name, is_real, shown
from gearlib.bondgraph import GY, TF, BondGraph, C, I, R, Se, Sf, Zero
from gearlib.bondgraph import time as graph_time
from gearlib.bondgraph.elements import Element, Junction, Storage, checked, expression
from gearlib.errors import ArgumentError, DeclarationError, nearest
from gearparts.interfaces import Flange, TranslationalFlange

if TYPE_CHECKING:
    from gearlib.bondgraph import Bond

SAMPLE = sp.Dummy("first", real=True), sp.Dummy("second", real=True)
"""What laws are called with to see which parameters they hold."""
RESERVED = frozenset({"time", "start", "guess", "equations", "assemble", "graph", "ports"})


class BondGraphPart(gl.Component):
    """Base of the classes that :func:`from_bond_graph` makes.

    Every bond has an effort ``e_<number>`` and a flow ``f_<number>``, counted along its half arrow; every I stores ``p_<number>``,
    every C ``q_<number>``.
    """

    graph: ClassVar[BondGraph]
    ports: ClassVar[Mapping[str, int]]

    def equations(self) -> list[gl.Eq]:
        """Equations of all elements, including ports."""
        port_at = {number: name for name, number in self.ports.items()}
        found: list[gl.Eq] = []
        for element in self.graph.elements:
            bonds = self.graph.at(element)
            if isinstance(element, Se | Sf) and bonds[0].number in port_at:
                found += self._port_equations(port_at[bonds[0].number], bonds[0].number)
            else:
                found += _equations(self, element, bonds)
        return found

    def energies(self) -> gl.Energy | None:
        """Energy of all elements; None if the law of a storage element has no closed-form integral."""
        stored = heat = supplied = sp.S.Zero
        for element in self.graph.elements:
            number = self.graph.at(element)[0].number
            power = self._effort(number) * self._flow(number)
            if isinstance(element, Storage):
                content = getattr(self, f"{'p' if isinstance(element, I) else 'q'}_{number}")
                integral = sp.integrate(self._in_model(_law(element, SAMPLE[0], number)), SAMPLE[0])
                if integral.has(sp.Integral):
                    return None
                stored += integral.subs(SAMPLE[0], content) - integral.subs(SAMPLE[0], 0)
            elif isinstance(element, R):
                heat += power
            elif isinstance(element, Se | Sf) and number not in self.ports.values():
                supplied += power
        return gl.Energy(stored=stored, heat=heat, supplied=supplied)

    def _port_equations(self, name: str, number: int) -> list[gl.Eq]:
        """Source bonds point into the graph, as connector flows point into the component: no sign change."""
        port = getattr(self, name)
        rotational = isinstance(type(self)._declarations[name], Flange)
        potential, flow = (port.phi, port.tau) if rotational else (port.s, port.f)
        return [gl.Eq(flow, self._effort(number)), gl.Eq(gl.der(potential), self._flow(number))]

    def _effort(self, number: int) -> Any:
        return getattr(self, f"e_{number}")

    def _flow(self, number: int) -> Any:
        return getattr(self, f"f_{number}")

    def _in_model(self, value: Any) -> Any:
        """An expression of the graph in the component's symbols, matched by name."""
        names = {s: gl.time if s == graph_time else getattr(self, s.name) for s in value.free_symbols if s not in SAMPLE}
        return value.xreplace(names)


def from_bond_graph(
    graph: BondGraph,
    ports: Mapping[str, int] | None = None,
    *,
    translational_ports: Mapping[str, int] | None = None,
    defaults: Mapping[str, float] | None = None,
    nominal: Mapping[str, float] | None = None,
    name: str = "",
) -> type[BondGraphPart]:
    """Component class of a bond graph.

    Parameters
    ----------
    graph : BondGraph
        The graph.
    ports : mapping, optional
        Maps flange names to the numbers of bonds driven by sources without a value. The flange replaces the source: effort is its
        torque (N.m), flow its angular velocity (rad/s).
    translational_ports : mapping, optional
        The same for translational flanges: force (N) and velocity (m/s).
    defaults : mapping, optional
        Default values of parameters.
    nominal : mapping, optional
        Typical magnitudes of variables, such as ``{"q_6": 1e-6}``; the absolute tolerance of a state is ``rtol`` times it.
    name : str
        Class name; by default derived from the graph's name.

    Returns
    -------
    type
        A subclass of :class:`BondGraphPart`. Its parameters are the graph's symbols (``I_2``, ``m_1``, ...); its inputs are the other
        sources without a value (``Se_1``, ``Sf_8``); its variables are ``e_1``, ``f_1``, ... of all bonds and the stored ``p_2``,
        ``q_6``, .... Units are SI, whatever the bond carries.

    Raises
    ------
    ArgumentError
        A port names a bond without such a source, or a default or nominal value has an unknown name.
    DeclarationError
        A name clash, or a parameter name that cannot be an attribute.

    Examples
    --------
    A DC motor as a bond graph, driving a load made of components; in the final steady state the back-EMF 0.2 w equals 24 V:

    >>> import gearlib as gl, gearparts as gp
    >>> from gearlib.bondgraph import GY, BondGraph, I, One, R, Se
    >>> current, rotor, motor = One("current"), One("rotor"), GY("K")
    >>> graph = BondGraph(
    ...     (1, Se(), current), (2, current, I("L")), (3, current, R("R_a")), (4, current, motor), (5, motor, rotor),
    ...     (6, rotor, I("J")), (7, Se(), rotor), name="DC motor")
    >>> Motor = gp.from_bond_graph(graph, ports={"shaft": 7}, defaults={"L": 0.01, "R_a": 0.5, "K": 0.2})
    >>> class Drive(gl.Component):
    ...     def assemble(self):
    ...         self.motor = Motor(J=0.1, Se_1=24.0)
    ...         self.load = gp.Inertia(J=0.3)
    ...         return [gl.connect(self.motor.shaft, self.load.flange_a)]
    >>> float(round(gl.simulate(Drive(), t_end=100.0, samples=2)["load.w"][-1], 6))
    120.0
    """
    if not isinstance(graph, BondGraph):
        raise ArgumentError(f"from_bond_graph({shown(graph)}): expected a BondGraph")
    names = "bonds by name, such as {'shaft': 7}"
    turned = by_name(f"{graph.name}: ports", ports, names, "shaft")
    pushed = by_name(f"{graph.name}: translational_ports", translational_ports, names, "hub")
    nominal = by_name(f"{graph.name}: nominal", nominal, "sizes by name, such as {'p_2': 10.0}", "p_2")
    defaults = by_name(f"{graph.name}: defaults", defaults, "values by name, such as {'L': 0.01}", "L")
    if not isinstance(name, str) or not name.isprintable():
        raise ArgumentError(f"{graph.name}: name is {shown(name)}; expected the name of the class")
    if both := sorted(turned.keys() & pushed.keys()):
        raise ArgumentError(f"{graph.name}: '{both[0]}' is named as a port of both kinds")
    connectors = [(n, Flange, b) for n, b in turned.items()] + [(n, TranslationalFlange, b) for n, b in pushed.items()]
    _check_ports(graph, {**turned, **pushed})
    variables = _variables(graph, nominal)
    inputs = [n for n in _open_sources(graph) if n not in {b for _, _, b in connectors}]
    declared: list[tuple[str, Any]] = [(n, kind(f"bond {b}")) for n, kind, b in connectors]
    declared += [(_source_name(graph, n), gl.Input("any", f"source on bond {n}")) for n in inputs]
    lower = dict.fromkeys(_stored_values(graph), 0.0)
    declared += [
        (p, gl.Parameter("any", "parameter of the bond graph", min=lower.get(p, -math.inf)))
        for p in _parameters(graph, variables)
    ]
    members: dict[str, Any] = {}
    for key, declaration in declared:
        if key in members or key in variables or key in RESERVED or not key.isidentifier() or key.startswith("_"):
            raise DeclarationError(f"{graph.name}: '{key}' cannot be a name here: it is in use, or no name of an attribute")
        members[key] = declaration
    for key, value in defaults.items():
        if not isinstance(members.get(key), gl.Parameter):
            valid = [n for n, d in members.items() if isinstance(d, gl.Parameter)]
            raise ArgumentError(f"{graph.name}: defaults: no parameter '{key}'; {nearest(key, valid)}")
        members[key] = gl.Parameter("any", "parameter of the bond graph", default=value, min=lower.get(key, -math.inf))
    members |= variables
    words = "".join(c if c.isalnum() else " " for c in graph.name).split()
    title = name or "".join(word[:1].upper() + word[1:] for word in words)
    members |= {"__doc__": f"Bond graph '{graph.name}'.", "__module__": __name__, "graph": graph, "ports": {**turned, **pushed}}
    return cast("type[BondGraphPart]", type(title, (BondGraphPart,), members))


# ---------------------------------------------------------------- declarations


def _open_sources(graph: BondGraph) -> list[int]:
    return [n for n in graph.of_kind(Se, Sf) if cast("Se | Sf", graph.element(n, Se, Sf)).value is None]


def _stored_values(graph: BondGraph) -> list[str]:
    """Parameters that are inertias or compliances, and so cannot be negative."""
    found = ((n, cast("Storage", graph.element(n, I, C))) for n in graph.of_kind(I, C))
    return [str(expression(element.value, f"{element.kind}_{n}")) for n, element in found if element.law is None]


def _source_name(graph: BondGraph, number: int) -> str:
    return f"{'Se' if isinstance(graph.element(number, Se, Sf), Se) else 'Sf'}_{number}"


def _check_ports(graph: BondGraph, ports: Mapping[str, int]) -> None:
    valid = _open_sources(graph)
    for name, number in ports.items():
        if not is_real(number) or number not in valid:
            found = ", ".join(map(str, valid)) or "none"
            raise ArgumentError(
                f"{graph.name}: port '{name}': bond {shown(number)} has no source without a value; such bonds: {found}"
            )
    if len(set(ports.values())) < len(ports):
        raise ArgumentError(
            f"{graph.name}: two ports are on the same bond: {', '.join(f'{n} on {b}' for n, b in ports.items())}"
        )


def _variables(graph: BondGraph, nominal: dict[str, float]) -> dict[str, Any]:
    """Stored p and q, followed by effort and flow of every bond."""
    stored = {n: "p" if isinstance(graph.element(n, I, C), I) else "q" for n in graph.of_kind(I, C)}
    # A deflection cannot be computed from other variables; momenta can be computed from each other, so their choice is free.
    plain: dict[str, tuple[str, Any]] = {
        f"{kind}_{n}": (f"stored on bond {n}", "prefer" if kind == "q" else "default") for n, kind in stored.items()
    }
    plain |= {f"{word[0]}_{n}": (f"{word} of bond {n}", "avoid") for word in ("effort", "flow") for n in graph.bonds}
    if unknown := [key for key in nominal if key not in plain]:
        raise ArgumentError(f"{graph.name}: nominal: no variable '{unknown[0]}'; {nearest(unknown[0], plain)}")
    return {key: gl.Variable("any", text, state=wish, nominal=nominal.get(key, 1.0)) for key, (text, wish) in plain.items()}


def _parameters(graph: BondGraph, variables: Mapping[str, Any]) -> list[str]:
    """Names of all other symbols in the elements' values and laws."""
    symbols = {s for element in graph.elements for value in _values(graph, element) for s in value.free_symbols}
    return sorted({s.name for s in symbols if s not in (graph_time, *SAMPLE)} - set(variables))


def _values(graph: BondGraph, element: Element) -> Iterator[Any]:
    """The expressions in an element."""
    number = graph.at(element)[0].number
    if isinstance(element, TF | GY):
        yield expression(element.modulus, "")
    elif isinstance(element, Se | Sf):
        if element.value is not None:
            yield expression(element.value, "")
    elif isinstance(element, Storage):
        yield _law(element, SAMPLE[0], number)
    elif isinstance(element, R):
        yield from _resistance(element, *SAMPLE, number)


def _law(element: Storage, stored: Any, number: int) -> Any:
    """Output of a storage element as a function of its energy variable."""
    if element.law is not None:
        return checked(element.law(stored), f"the law of {element.kind}_{number}")
    return stored / expression(element.value, f"{element.kind}_{number}")


def _resistance(element: R, effort: Any, flow: Any, number: int) -> tuple[Any, Any]:
    """The two sides of a resistance's law."""
    if element.law is not None:
        return effort, checked(element.law(flow), f"the law of R_{number}")
    if element.conductance is not None:
        return flow, checked(element.conductance(effort), f"the conductance of R_{number}")
    return effort, flow * expression(element.value, f"R_{number}")


# ---------------------------------------------------------------- equations


def _equations(part: BondGraphPart, element: Element, bonds: tuple[Bond, ...]) -> list[gl.Eq]:
    if isinstance(element, Junction):
        return _junction(part, element, bonds)
    if isinstance(element, TF | GY):
        m = part._in_model(expression(element.modulus, ""))
        into, out = bonds if bonds[0].head is element else bonds[::-1]
        e_in, f_in, e_out, f_out = (get(b.number) for b in (into, out) for get in (part._effort, part._flow))
        if isinstance(element, TF):
            return [gl.Eq(f_out, m * f_in), gl.Eq(e_in, m * e_out)]
        return [gl.Eq(e_in, m * f_out), gl.Eq(e_out, m * f_in)]
    (bond,) = bonds
    number = bond.number
    e, f = part._effort(number), part._flow(number)
    if isinstance(element, Storage):
        stored = getattr(part, f"{'p' if isinstance(element, I) else 'q'}_{number}")
        given, taken = (f, e) if isinstance(element, I) else (e, f)
        return [gl.Eq(gl.der(stored), taken), gl.Eq(given, part._in_model(_law(element, stored, number)))]
    if isinstance(element, R):
        left, right = _resistance(element, e, f, number)
        return [gl.Eq(left, part._in_model(right))]
    assert isinstance(element, Se | Sf)
    name = _source_name(part.graph, number)
    value = getattr(part, name) if element.value is None else part._in_model(expression(element.value, name))
    return [gl.Eq(e if isinstance(element, Se) else f, value)]


def _junction(part: BondGraphPart, junction: Junction, bonds: tuple[Bond, ...]) -> list[gl.Eq]:
    """One common variable, and a sum along the half arrows that is zero."""
    shared, summed = (part._effort, part._flow) if isinstance(junction, Zero) else (part._flow, part._effort)
    first = shared(bonds[0].number)
    total = sum(bond.sign(junction) * summed(bond.number) for bond in bonds)
    return [*(gl.Eq(shared(bond.number), first) for bond in bonds[1:]), gl.Eq(total, 0)]
