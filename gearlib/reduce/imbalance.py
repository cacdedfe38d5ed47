"""Diagnosis of unbalanced models: the class, connector or equation at fault, by name.

Each class must have as many equations as variables of its own plus flows in its connectors: the potentials are set from outside, or
equated to others. A class that satisfies this can only be connected wrongly.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from gearlib.equations.template import Template
from gearlib.flatten.model import FlatModel, Instance
from gearlib.language.declarations import Flow, Input, Potential
from gearlib.reduce.coefficients import listed, some
from gearlib.structure.dulmage_mendelsohn import Imbalance

MOST_NAMED = 3  # causes listed per kind


@dataclass(frozen=True)
class Account:
    """Balance of a class: its equations, and the unknowns that it must determine.

    Attributes
    ----------
    kind : str
        The class.
    equations : tuple of str
        As written; those between a composite's connectors and its parts read "connection of flange_a".
    unknowns : tuple of str
        Own variables except inputs, and flows of connectors.
    untouched : tuple of str
        Unknowns that occur in none of the equations.
    """

    kind: str
    equations: tuple[str, ...]
    unknowns: tuple[str, ...]
    untouched: tuple[str, ...]

    @property
    def surplus(self) -> int:
        return len(self.equations) - len(self.unknowns)

    def __str__(self) -> str:
        n, m = len(self.equations), len(self.unknowns)
        over = abs(self.surplus)
        text = f"{n or 'no'} equation{'s' * (n != 1)} for {m or 'no'} unknown{'s' * (m != 1)}"
        text += f" ({some(list(self.unknowns))})" if self.unknowns else ""
        text += f", {over} {'is' if over == 1 else 'are'} {'too many' if self.surplus > 0 else 'missing'}"
        if self.surplus > 0:
            return f"{text}: {some(list(self.equations))}"
        return f"{text}: none of them holds {', '.join(self.untouched)}" if self.untouched else text


def account(instance: Instance, inner: Iterable[str]) -> Account:
    """Balance of a component's class; ``inner`` are the connectors that are connected to its parts."""
    outside = {
        n for n, v in instance.declared.variables.items() if isinstance(v, Input) or (isinstance(v, Potential) and "." in n)
    }
    unknowns = tuple(n for n in instance.declared.variables if n not in outside)
    joined = [f"{c}.{n}" for c in inner for n, v in instance.declared.connectors[c].variables.items() if isinstance(v, Flow)]
    written = tuple(t.label.removeprefix(f"{instance.kind}: ") for t in instance.record.templates)
    occurring = {n for t in instance.record.templates for n in t.locals}.union(joined)
    untouched = tuple(n for n in unknowns if n not in occurring)
    return Account(
        instance.kind, (*written, *(f"connection of {flow.rpartition('.')[0]}" for flow in joined)), unknowns, untouched
    )


def unbalanced_classes(model: FlatModel) -> list[tuple[list[str], Account]]:
    """The classes with too many or too few equations, with the paths of their instances."""
    inner: dict[int, list[str]] = {}
    for number, connector in model.inner_ports:
        inner.setdefault(number, []).append(connector)
    found: dict[Account, list[str]] = {}
    for number, instance in enumerate(model.instances):
        balance = account(instance, inner.get(number, ()))
        if balance.surplus:
            found.setdefault(balance, []).append(instance.path)
    return [(paths, balance) for balance, paths in found.items()]


def explained(model: FlatModel, balance: Imbalance) -> str:
    """The message for an unbalanced model: causes first, then the Dulmage-Mendelsohn parts."""
    classes = [
        f"{', '.join([*paths[:MOST_NAMED], *(['...'] if len(paths) > MOST_NAMED else [])]) or 'the model'} ({tally.kind}) has {tally}."
        for paths, tally in unbalanced_classes(model)
        if (balance.surplus if tally.surplus > 0 else balance.deficit)
    ]
    causes = [*classes[:MOST_NAMED], *_given_twice(model, balance), *_loose_ends(model, balance, not classes)]
    text = list(causes)
    if balance.surplus:
        text.append(
            f"over-determined: {len(balance.excess_equations)} equations for {len(balance.excess_variables)} variables, "
            f"{balance.surplus} too many. The equations: {listed(model, balance.excess_equations)}. "
            f"The variables: {some([model.name(v) for v in balance.excess_variables]) or 'none that is not given or zero'}."
        )
        if not causes:
            text.append(
                "Is something held or driven twice (two sources or grounds on one rigid shaft), or a source not connected?"
            )
    if balance.deficit:
        text.append(
            f"under-determined: {len(balance.undetermined)} variables in {len(balance.missing_equations)} equations, "
            f"{balance.deficit} too few. The variables: {some([model.name(v) for v in balance.undetermined])}."
        )
        if not causes:
            text.append("Is a flange left unconnected inside a composite, or a variable without an equation?")
    return "the model is not balanced. " + " ".join(text)


def _given_twice(model: FlatModel, balance: Imbalance) -> list[str]:
    """Inputs, bound or given from outside, that an equation of their own or of an enclosing component would have to determine."""
    excess = [e for e in balance.excess_equations if _owner(model, e) is not None]
    bound = {v for e in excess if _template(model, e).binds for v, _ in model.rows[e]}
    text: dict[str, None] = {}
    for e in excess:
        owner, template = _owner(model, e), _template(model, e)
        if owner is None or template.binds:
            continue
        label = template.label
        here = {v for v, _ in model.rows[e]}
        for v in sorted(here & {*bound, *model.inputs.tolist()}):
            for same in np.flatnonzero(model.representative == v).tolist():
                if not isinstance(model.declaration(same), Input):
                    continue
                name = model.name(same)
                part, _, local = name.rpartition(".")
                if part == owner.path and here <= set(model.inputs.tolist()):
                    text[
                        f"{name} is an input, which is given from outside; declare it as a variable if {label} is to determine it."
                    ] = None
                elif part != owner.path and part.startswith(f"{owner.path}." if owner.path else ""):
                    given = "bound to something already" if v in bound else "given from outside"
                    text[
                        f"{name} is an input and {given}; if it is to obey {label}, bind it: {local}=... where {part} is made."
                    ] = None
    return list(text)[:MOST_NAMED]


def _is_of_connector(model: FlatModel, variable: str) -> bool:
    """Whether a variable belongs to a connector, rather than to the component itself."""
    owner, _, local = variable.rpartition(".")[0].rpartition(".")
    return any(instance.path == owner and local in instance.declared.connectors for instance in model.instances)


def _loose_ends(model: FlatModel, balance: Imbalance, guess: bool) -> Iterator[str]:
    """Unconnected connectors that cause the imbalance; harmless free ends are omitted.

    With ``guess``, also those on which a massless law depends: their zero flow leaves the law one unknown short.
    """
    loose: dict[int, list[str]] = {}
    for number, connector in model.loose_ports:
        if model.instances[number].path:
            loose.setdefault(number, []).append(connector)
    open_ = set(balance.undetermined)
    text: dict[str, str] = {}  # by connector
    used = {v for row in model.rows for v, _ in row}
    for v in balance.undetermined:  # potentials that occur in no equation
        if len(text) < MOST_NAMED and v not in used:
            equal = np.flatnonzero(model.representative == v).tolist()
            alike = [model.name(same) for same in equal if isinstance(model.declaration(same), Potential)]
            alike = [n for n in alike if _is_of_connector(model, n)]  # not an equal variable of the component itself
            if not alike:
                continue
            name = min(alike, key=lambda n: n.count("."))
            connector = name.rpartition(".")[0]
            owner, _, local = connector.rpartition(".")
            number = next(k for k, i in enumerate(model.instances) if i.path == owner)
            instance = model.instances[number]
            if local in loose.get(number, ()):
                text[connector] = _unconnected(instance, [local])
            else:
                off = _switch(instance, local)
                text[connector] = f"Nothing determines {name}: connect {connector} to a component that does{off}."
    blamed = {_number(model, e) for e in balance.excess_equations if guess and _massless(model, e, loose)}
    forgotten: list[str] = []
    for number, connectors in loose.items():
        instance = model.instances[number]
        path = instance.path
        inside = path.startswith(tuple(f"{f}." for f in forgotten))
        alone = len(connectors) == len(instance.declared.connectors)
        own = range(instance.first_variable, instance.first_variable + len(instance.declared.variables))
        undetermined = any(int(model.representative[v]) in open_ and model.sign[v] for v in own)
        if alone and (undetermined or number in blamed):
            forgotten.append(path)
        if not inside and ((alone and undetermined and guess) or number in blamed):
            for c in connectors:
                text.pop(f"{path}.{c}", None)
            text[path] = _unconnected(instance, connectors)
    yield from list(text.values())[:MOST_NAMED]


def _massless(model: FlatModel, e: int, loose: dict[int, list[str]]) -> bool:
    """Whether an equation without derivatives contains the flow of an unconnected connector, or is a binding without unknowns."""
    g, i = model.places[e]
    group = model.groups[g]
    connectors = loose.get(int(group.owners[i]), ())
    if not connectors or any(order for _, order in group.template.columns):
        return False
    if group.template.binds:
        return {v for v, _ in model.rows[e]} <= set(model.inputs.tolist())
    instance = model.instances[int(group.owners[i])]
    flows = {
        f"{c}.{n}" for c in connectors for n, v in instance.declared.connectors[c].variables.items() if isinstance(v, Flow)
    }
    return any(name in flows for t in instance.record.templates if t.label == group.template.label for name in t.locals)


def _unconnected(instance: Instance, connectors: list[str]) -> str:
    paths = [f"{instance.path}.{c}" for c in connectors]
    verb = "is" if len(paths) == 1 else "are"
    off = _switch(instance, connectors[0]) if len(paths) == 1 else f", or leave {instance.path} out"
    return f"{' and '.join(paths)} {verb} connected to nothing; connect {'it' if len(paths) == 1 else 'them'}{off}."


def _switch(instance: Instance, connector: str) -> str:
    switch = instance.declared.connectors[connector].when
    return f", or leave it switched off ({switch}=False of {instance.path or instance.kind})" if switch else ""


def _number(model: FlatModel, e: int) -> int:
    g, i = model.places[e]
    return int(model.groups[g].owners[i])


def _owner(model: FlatModel, e: int) -> Instance | None:
    number = _number(model, e)
    return model.instances[number] if number >= 0 else None


def _template(model: FlatModel, e: int) -> Template:
    return model.groups[model.places[e][0]].template
