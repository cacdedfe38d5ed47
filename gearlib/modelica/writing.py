"""`to_modelica`: writes a component as Modelica text."""

from __future__ import annotations

import re
import unicodedata
from typing import Any

from gearlib.arguments import shown
from gearlib.errors import ArgumentError
from gearlib.language.component import Component, no_component
from gearlib.language.interior import reads_parts
from gearlib.modelica.class_writing import PackageText, comment, free_name, safe_name
from gearlib.modelica.flat_writing import FlatText

_IDENTIFIER = re.compile(r"[A-Za-z_]\w*$", re.ASCII)
_STRING_OR_NAME = re.compile(r'"(?:[^"\\]|\\.)*"|[^\W\d]\w*', re.DOTALL)


@reads_parts
def to_modelica(component: Component, *, flat: bool = False, standard_library: bool = True, name: str | None = None) -> str:
    """Write a component as Modelica text, which other tools can simulate and `read_modelica` can read.

    Each component class becomes a class of a package: parameters with units, bounds and defaults, variables with start attributes,
    parts with modifications, equations, connections. Structural choices are resolved: a class used with two sets of choices becomes two
    classes. Unbound inputs of parts become inputs of the model.

    Parameters
    ----------
    component : Component
    flat : bool
        Write a single model without parts: ``load.w`` becomes ``load_w``, connections become equations.
    standard_library : bool
        Whether parts with a counterpart in the Modelica Standard Library refer to it,
        ``Modelica.Mechanics.Rotational.Components.Inertia``; otherwise the package is self-contained.
    name : str, optional
        Name of the package, or of the flat model.

    Returns
    -------
    str

    Raises
    ------
    ModelicaError
        Anything that Modelica cannot express: a Python function called during a run, a connection to a part within a part (which is
        possible with ``flat``).

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Drive(gl.Component):
    ...     '''A load on a motor.'''
    ...     J = gl.Parameter("kg.m2", "load inertia", default=2.0, min=0)
    ...     def assemble(self):
    ...         self.motor, self.load = gp.Torque(tau=10 * gl.sin(gl.time)), gp.Inertia(J=self.J, start={"w": 1.0})
    ...         return [gl.connect(self.motor.flange, self.load.flange_a)]
    >>> print(gl.to_modelica(Drive()))
    package DrivePackage
      model Drive "A load on a motor."
        parameter Real J(unit = "kg.m2", min = 0.0) = 2.0 "load inertia";
        Modelica.Mechanics.Rotational.Sources.Torque motor(tau = 10*sin(time));
        Modelica.Mechanics.Rotational.Components.Inertia load(J = J, w(start = 1.0, fixed = true));
      equation
        connect(motor.flange, load.flange_a);
      end Drive;
    end DrivePackage;
    >>> print(gl.to_modelica(Drive(), standard_library=False).splitlines()[1])
      connector Flange "A shaft end: angle ``phi`` (rad) and torque ``tau`` (N.m, flow)."
    """
    if not isinstance(component, Component):
        raise no_component(component)
    for said, value in (("flat", flat), ("standard_library", standard_library)):
        if not isinstance(value, bool):
            raise ArgumentError(f"to_modelica: {said} is {shown(value)}; expected True or False")
    if name is not None and not (isinstance(name, str) and _IDENTIFIER.match(name)):
        raise ArgumentError(f"to_modelica: name is {shown(name)}; expected letters, digits and underscores, such as 'Drive'")
    kind = safe_name(type(component).__name__)
    if flat:
        own = kind if name is None else name
        lines = FlatText(component).lines()
        body = "\n".join(line if line == "equation" else f"  {line}" for line in lines)
        return _in_plain_letters(f"model {own}{comment(type(component).__doc__)}\n{body}\nend {own};")
    package = PackageText(standard_library)
    package.class_name(component, is_root=True)
    own = f"{kind}Package" if name is None else name
    classes: list[Any] = [f"  {line}" for text in package.texts.values() for line in text.splitlines()]
    return _in_plain_letters("\n".join([f"package {own}", *classes, f"end {own};"]))


def _in_plain_letters(text: str) -> str:
    """A Modelica text whose names have other letters than Modelica's, with names in their place that have not; strings stay.

    >>> _in_plain_letters('Real \u03bc "friction \u03bc"; Real mu = 2 * \u03bc;')
    'Real mu_2 "friction \u03bc"; Real mu = 2 * mu_2;'
    """
    if text.isascii():
        return text
    names = {name for name in _STRING_OR_NAME.findall(text) if not name.startswith('"')}
    plain = {name: name for name in names if name.isascii()}
    for name in sorted(names - plain.keys()):
        plain[name] = free_name(safe_name("".join(map(_plain_letter, name))), {*plain.values()}.__contains__)
    return _STRING_OR_NAME.sub(lambda m: plain.get(m[0], m[0]), text)


def _plain_letter(sign: str) -> str:
    """The letters a .. z of which one consists, or its name: ``a`` with dots is ``a``, the Greek letter ``mu``."""
    if found := "".join(
        part for part in unicodedata.normalize("NFKD", sign) if part.isascii() and (part.isalnum() or part == "_")
    ):
        return found
    word = unicodedata.name(sign, "").rpartition(" ")[2]
    if not (word.isascii() and word.isalpha()):
        return f"u{ord(sign):x}"
    return word.title() if sign.isupper() else word.lower()
