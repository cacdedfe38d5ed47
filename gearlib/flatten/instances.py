"""Instantiation: traverses the component tree and numbers variables and parameters; collects equations and connections.

All instances of a class with the same structural choices share one analysis (`gearlib.equations.class_record`); an instance only adds
numbers.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from typing import Any

from gearlib.arguments import shown
from gearlib.equations.bindings import bind_input, canonical, is_computable, is_expression, number
from gearlib.equations.class_record import ClassRecord, Met, check_values, class_record, descend
from gearlib.errors import ArgumentError, BindingError, ConnectionError, ModelError, nearest
from gearlib.flatten.attributes import choices_of
from gearlib.flatten.model import Instance
from gearlib.flatten.signals import joined_signals
from gearlib.flatten.tree import Tree
from gearlib.language import interior
from gearlib.language.component import Component, Connection, inside, reads_of
from gearlib.language.declarations import NO_VALUE, Input
from gearlib.language.expressions import check_depth, time
from gearlib.language.tabulated import Tabulated

DEEPEST = 200  # nesting depth of components


def walk(root: Component, anew: bool = True) -> Tree:
    """Instantiate a component and its parts, depth-first, in order of creation; ``anew``: assemble it once more."""
    tree = Tree()
    stack: list[tuple[Component, str]] = [(root, "")]
    composites: list[tuple[Component, int, Sequence[Connection]]] = []
    met: Met = {}
    first_of_kind: list[tuple[Component, ClassRecord]] = []
    if anew:
        interior.forget(root)
    while stack:
        component, path = stack.pop()
        if path.count(".") > DEEPEST:
            raise ModelError(
                f"{path[:60]}...: components within components, {DEEPEST} levels deep; does {type(component).__name__} make a part "
                "of its own class without end?"
            )
        connections = interior.connections_of(component)
        known = len(met)
        record = class_record(component, met)
        if len(met) > known:
            first_of_kind.append((component, record))
        number_ = _add_instance(tree, component, record, path)
        if parts := interior.parts_of(component):
            prefix = f"{path}." if path else ""
            stack += [(part, prefix + name) for name, part in reversed(parts.items())]
        if connections or parts or not record.local:  # a part may join signals by itself
            composites.append((component, number_, connections))
    for component, number_, connections in composites:
        _add_links(tree, component, number_, connections)
        _add_signals(tree, component, number_)
    _bind_all(tree, root)
    for component, record in first_of_kind:
        check_values(component, record)
    for component, number_, _ in composites:
        instance = tree.instances[number_]
        record = instance.record
        if not record.local:
            for template in record.templates:
                variables = [_variable(tree, component, name, instance.path) for name in template.locals]
                parameters = [_parameter(tree, component, name, instance.path) for name in template.parameters]
                tree.rows[template].append((number_, variables, parameters))
            for update in record.updates:
                variables = [_variable(tree, component, name, instance.path) for name in update.template.locals]
                parameters = [_parameter(tree, component, name, instance.path) for name in update.template.parameters]
                if update.reinit:
                    target = instance.variable(update.target)
                else:
                    target = tree.first_discrete[number_] + list(record.discretes).index(update.target)
                tree.updates[update.template, update.reinit].append((number_, variables, parameters, target))
    return tree


def _add_instance(tree: Tree, component: Component, record: ClassRecord, path: str) -> int:
    number_ = len(tree.instances)
    declared = record.declared
    tree.numbers[id(component)] = number_
    tree.instances.append(Instance(path, type(component).__name__, record, tree.n_variables, len(tree.parameter_names)))
    tree.n_variables += len(declared.variables)
    prefix = f"{path}." if path else ""
    tree.parameter_names += [prefix + name for name in declared.parameters]
    tree.parameter_values += [float("nan")] * len(declared.parameters)
    tree.lower += [p.min for p in declared.parameters.values()]
    tree.upper += [p.max for p in declared.parameters.values()]
    if record.discretes:
        tree.first_discrete[number_] = len(tree.discrete_names)
        for name, discrete in record.discretes.items():
            tree.discrete_names.append(prefix + name)
            start = interior.starts_of(component).get(name, discrete.start)
            tree.discrete_starts.append(number(start, f"start({prefix}{name})", "1", "start value of a discrete variable"))
    if record.local:
        for template in record.templates:
            tree.local_rows[template].append(number_)
    tree.first_port.append(len(tree.ports))
    tree.ports += [(number_, name) for name in declared.connectors]
    return number_


def _add_links(tree: Tree, component: Component, number_: int, connections: Sequence[Connection]) -> None:
    for connection in connections:
        link = []
        for port in connection.ports:
            where = tree.numbers.get(id(port.component))
            inside = where == number_
            ancestor = port.component
            while where is not None and ancestor is not component and ancestor is not None:
                ancestor = interior.parent_of(ancestor)
            if where is None or ancestor is None:
                path = tree.instances[number_].path or type(component).__name__
                foreign = ".".join(filter(None, (interior.path_of(port.component), port.connector.name)))
                raise ConnectionError(
                    f"{path}: connects {type(port.component).__name__} '{foreign}', "
                    "which is not part of it; assign the part to an attribute (self.name = ...; a list after it is filled), and "
                    "connect parts of this model only"
                )
            link.append(
                2 * (tree.first_port[where] + tree.instances[where].record.connector_index[port.connector.name]) + inside
            )
        if link:
            tree.links.append(link)


def _add_signals(tree: Tree, component: Component, number_: int) -> None:
    for part, local, source in joined_signals(component, tree.instances[number_].path):
        target = tree.numbers[id(part)]
        known = tree.signals.setdefault(target, {})
        if local in known:
            raise ConnectionError(  # the outermost component is the first to join, so that both have a path
                f"{tree.instances[target].path}: '{local}' takes two signals: {source}, which {tree.instances[number_].path} "
                f"joins to it, and {known[local][1]}"
            )
        known[local] = component, source


def _bind_all(tree: Tree, root: Component) -> None:
    components: list[tuple[Component, Component | None]] = [(root, None)]
    while components:
        component, parent = components.pop()
        _bind(tree, component, parent)
        components += [(part, component) for part in reversed(interior.parts_of(component).values())]


def _bind(tree: Tree, component: Component, parent: Component | None) -> None:
    number_ = tree.numbers[id(component)]
    instance = tree.instances[number_]
    record = instance.record
    bindings = interior.bindings_of(component)
    prefix = f"{instance.path}." if instance.path else ""
    for offset, (name, declared) in enumerate(instance.declared.parameters.items()):
        value = bindings.get(name, declared.default)
        scope = parent if name in bindings else component
        _set_parameter(tree, instance.first_parameter + offset, value, scope, declared.unit, declared.description)
    signals = tree.signals.get(number_, {})
    for name, variable in (instance.declared.variables if signals else instance.declared.valued).items():
        if isinstance(variable, Input):
            bound = bindings[name] if name in bindings else _evaluated(variable.default, component, prefix + name)
            own = instance.variable(name)
            if name in signals:
                if name in bindings and bindings[name] is not None:
                    raise BindingError(
                        f"{prefix}{name} is bound to {shown(bindings[name])}, and connected to the signal "
                        f"{signals[name][1]}; leave one of them out"
                    )
            elif bound is NO_VALUE or bound is None:
                tree.inputs.append(own)
            else:
                _bind_input(
                    tree, component, parent if name in bindings else component, own, prefix + name, bound, variable.unit
                )
        if name in signals:
            scope, signal = signals[name]
            _bind_input(tree, component, scope, instance.variable(name), prefix + name, signal, variable.unit)
        if variable.start is not None and name not in interior.starts_of(component):
            _set_start(tree, prefix, name, instance.variable(name), variable.start, None, True, variable.unit)
        elif variable.guess and name not in interior.starts_of(component) and name not in interior.guesses_of(component):
            _set_start(tree, prefix, name, instance.variable(name), variable.guess, None, False, variable.unit)
    for given, fixed in ((interior.guesses_of(component), False), (interior.starts_of(component), True)):
        for name, value in given.items():
            name = name if isinstance(name, str) else shown(name)
            local = name.removesuffix(")").removeprefix("der(") if name.startswith("der(") else name
            if name in record.discretes:
                if not fixed:
                    raise BindingError(
                        f"{prefix}{name} is discrete, and is not searched for; give its value as start={{'{name}': ...}}"
                    )
                continue
            if name in instance.declared.variables:
                own = instance.variable(name)
                _set_start(tree, prefix, name, own, value, parent, fixed, instance.declared.variables[name].unit)
                continue
            if name in instance.declared.derivatives or (name.startswith("der(") and local in instance.declared.variables):
                of = instance.declared.derivatives.get(name, name).removesuffix(")").removeprefix("der(")
                raise BindingError(
                    f"{instance.path or instance.kind}: {'start' if fixed else 'guess'} value for '{name}', which is the derivative of "
                    f"'{of}' and follows from the equations; start={{'{of}': ...}} gives the start value of '{of}', and "
                    "simulate(start='steady') begins where the derivatives vanish"
                )
            inner, kind = _resolve(tree, component, name)  # a part's variable, whose own start value is overridden
            if kind != "variable":
                part, head = descend(component, name)[0], name.rpartition(".")[0]
                inside = [] if part is component else [f"{head}.{n}" for n in _variables_of(tree, part)]
                raise BindingError(
                    f"{instance.path or instance.kind}: {'start' if fixed else 'guess'} value for '{name}', which is not a variable of "
                    f"{instance.kind}; {nearest(local, inside or instance.declared.variables)}"
                )
            owner, local = place_of(tree, inner)
            _set_start(tree, prefix, name, inner, value, parent, fixed, owner.declared.variables[local].unit)
            tree.started.add(inner)
    if interior.nominals_of(component) or interior.preferences_of(component):
        tree.choices += [(instance.variable(n), what, v) for n, what, v in choices_of(component, instance)]


def _variables_of(tree: Tree, part: Component) -> Iterable[str]:
    return tree.instances[tree.numbers[id(part)]].declared.variables


def place_of(tree: Tree, variable: int) -> tuple[Instance, str]:
    """The instance of a variable, by its number, and the variable's name in it."""
    owner = bisect_right(tree.instances, variable, key=lambda instance: instance.first_variable) - 1
    instance = tree.instances[owner]
    return instance, list(instance.declared.variables)[variable - instance.first_variable]


def _set_start(
    tree: Tree, prefix: str, name: str, variable: int, value: Any, scope: Component | None, fixed: bool, unit: str
) -> None:
    if variable in tree.started:
        return
    slot = _new_parameter(tree, f"start({prefix}{name})")
    _set_parameter(tree, slot, value, scope, unit, "start value")
    tree.starts.append((variable, slot, fixed))


def _new_parameter(tree: Tree, name: str) -> int:
    tree.parameter_names.append(name)
    tree.parameter_values.append(float("nan"))
    tree.lower.append(-float("inf"))
    tree.upper.append(float("inf"))
    return len(tree.parameter_names) - 1


def _set_parameter(tree: Tree, slot: int, value: Any, scope: Component | None, unit: str, description: str) -> None:
    if type(value) is float and value - value == 0.0:  # finite: fast path for the common case
        tree.parameter_values[slot] = value
        return
    path = tree.parameter_names[slot]
    if value is NO_VALUE or value is None:
        hint = "" if description == "start value" else f": {path.rpartition('.')[2]}=..."
        raise BindingError(f"{path} has no value; give one in {unit} ({description or 'no default'}){hint}")
    if scope is not None:
        value = _evaluated(value, scope, path)
    if not is_expression(value):
        tree.parameter_values[slot] = number(value, path, unit, description)
        return
    if scope is None:
        raise BindingError(f"{path} is {value}; expected a number in {unit}: nothing encloses the outermost component")
    check_depth(value, path)
    expression, names = canonical(value)
    arguments = tuple(_parameter(tree, scope, n, path) for n in names)
    if expression not in tree.dependents and not is_computable(expression, tuple(f"a{i}" for i in range(len(names)))):
        raise BindingError(f"{path} is {shown(value)}, which holds a function that is not gearlib's")
    rows, targets = tree.dependents.setdefault(expression, ([], []))
    rows.append(arguments)
    targets.append(slot)


def _evaluated(value: Any, scope: Component, path: str) -> Any:
    """A value, or the result of its function of the component."""
    if not callable(value) or isinstance(value, Tabulated):
        return value
    try:
        with inside(scope), reads_of(scope):
            return value(scope)
    except Exception as problem:
        raise BindingError(f"{path}: its function raised {type(problem).__name__}: {problem}") from None


def _bind_input(tree: Tree, component: Component, scope: Component | None, own: int, path: str, value: Any, unit: str) -> None:
    if isinstance(value, Tabulated):
        try:
            value = value.expression(time, True)
        except ArgumentError as problem:
            raise BindingError(f"{path}: {problem}") from None
    if callable(value):
        raise BindingError(
            f"{path} is bound to the function {shown(value)}; bind an expression of gl.time, or leave the input unbound and give the "
            f"function to simulate(inputs={{'{path}': ...}})"
        )
    if not is_expression(value):
        number(value, path, unit, "input")
    where = component if scope is None else scope
    owner = tree.numbers[id(component)]

    def is_parameter(name: str) -> bool:
        return _resolve(tree, where, name)[1] == "parameter"

    def discrete(name: str) -> int:
        return _discrete(tree, where, name)

    template, names, values = bind_input(value, is_parameter, path, discrete)
    variables = [own if n == "bound" else _variable(tree, where, names[n], path) for n in template.locals]
    parameters = []
    for n in template.parameters:
        given = values[n]
        if isinstance(given, str):
            parameters.append(_parameter(tree, where, given, path))
        else:
            slot = _new_parameter(tree, f"{path}#{n[1:]}" if is_expression(value) else path)
            if is_expression(value):  # else the input has the parameter's name
                tree.written.append(slot)
            tree.parameter_values[slot] = given
            parameters.append(slot)
    tree.rows[template].append((owner, variables, parameters))
    tree.bound[template, tuple(variables)] = own


def _resolve(tree: Tree, scope: Component, name: str) -> tuple[int, str | None]:
    """Number and kind of a name, as seen from ``scope``."""
    part, local = descend(scope, name)
    instance = tree.instances[tree.numbers[id(part)]]
    if local in instance.declared.variables:
        return instance.variable(local), "variable"
    if local in instance.declared.parameters:
        return instance.parameter(local), "parameter"
    return -1, None


def _discrete(tree: Tree, scope: Component, name: str) -> int:
    """The number of a discrete variable as seen from ``scope``; -1 if the name is not one."""
    part, local = descend(scope, name)
    number_ = tree.numbers[id(part)]
    known = tree.instances[number_].record.discretes
    return tree.first_discrete[number_] + list(known).index(local) if local in known else -1


def _variable(tree: Tree, scope: Component, name: str, path: str) -> int:
    found, kind = _resolve(tree, scope, name)
    if kind != "variable":
        raise BindingError(f"{path}: '{name}' is not a variable here")
    return found


def _parameter(tree: Tree, scope: Component, name: str, path: str) -> int:
    found, kind = _resolve(tree, scope, name)
    if kind != "parameter":
        what = "a variable" if kind == "variable" else "unknown"
        raise BindingError(
            f"{path}: depends on '{name}', which is {what}; only parameters of the enclosing component can be used"
        )
    return found
