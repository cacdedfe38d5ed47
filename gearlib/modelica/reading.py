"""`read_modelica`: translates a Modelica model to a component class."""

from __future__ import annotations

import copyreg
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gearlib.arguments import as_path, shown
from gearlib.errors import ArgumentError, FileError, ModelicaError, NameLookupError, nearest
from gearlib.language.component import Component
from gearlib.modelica.class_building import TextClasses
from gearlib.modelica.counterparts import ModelicaClass, standard_library
from gearlib.modelica.scopes import ClassScope, outermost
from gearlib.modelica.text_parser import parsed

MODELS = ("model", "block", "class")


def read_modelica(source: str | Path, name: str | None = None) -> type[Component]:
    """Translate a Modelica model to a component class.

    Classes of Modelica.Mechanics.Rotational, and those of Translational, Blocks and Thermal that the component library covers, are
    mapped to the library; classes of the text become classes with the same equations. Unsupported constructs are refused with line and
    column. Nothing in the text is executed.

    Parameters
    ----------
    source : str or path
        The text, or the name of a file with the extension ``.mo``.
    name : str, optional
        Name of the model, such as ``"Drives.Train"``, if the text has several; by default the last one that is not partial.

    Returns
    -------
    type
        A subclass of `Component`; instances take the model's parameters as keywords.

    Raises
    ------
    ModelicaError
        A syntax error or an unsupported construct, with its position.
    NameLookupError
        Unknown model.
    FileError
        The file cannot be read.

    Examples
    --------
    >>> import gearlib as gl
    >>> Drive = gl.read_modelica('''
    ...     model Drive "motor, gear and load"
    ...       parameter Modelica.Units.SI.Inertia J_load = 2;
    ...       Modelica.Mechanics.Rotational.Sources.ConstantTorque motor(tau_constant = 10);
    ...       Modelica.Mechanics.Rotational.Components.IdealGear gear(ratio = 5);
    ...       Modelica.Mechanics.Rotational.Components.Inertia load(J = J_load, w(start = 1, fixed = true));
    ...     equation
    ...       connect(motor.flange, gear.flange_a);
    ...       connect(gear.flange_b, load.flange_a);
    ...     end Drive;''')
    >>> gl.simulate(Drive(J_load=5.0), t_end=1.0, samples=3)["load.w"]
    array([ 1.,  6., 11.])
    """
    if not (name is None or isinstance(name, str)):
        raise ArgumentError(f"read_modelica: name is {shown(name)}; expected the name of a model, such as 'Drives.Train'")
    text, said = _text(source)
    return class_in_text(text, said, name)


def class_in_text(text: str, source: str, name: str | None) -> type[Component]:
    """Component class of a model, by its full name; by default of the last one."""
    try:
        scope = outermost(parsed(text, source), standard_library().knows)
        models = dict(_models(scope))
        if not models:
            raise ModelicaError(f"{source}: there is no model that is not partial")
        wanted = list(models)[-1] if name is None else name
        if wanted not in models:
            short = [full for full in models if full.rpartition(".")[2] == wanted]
            if len(short) != 1:
                raise NameLookupError(f"{source} has no model {shown(wanted)}; {nearest(str(wanted), models)}")
            wanted = short[0]
        return TextClasses(text, source).class_of(models[wanted], {})
    except RecursionError:
        raise ModelicaError(f"{source}: nested too deeply") from None


def _reduced(kind: ModelicaClass) -> Any:
    """Pickling: the text and the name."""
    return class_in_text, (kind.modelica_text, kind.modelica_source, kind.modelica_name)


copyreg.pickle(ModelicaClass, _reduced)


def _text(source: Any) -> tuple[str, str]:
    """The text, and its name in messages."""
    if isinstance(source, str) and not (source.endswith(".mo") and "\n" not in source):
        return source, "the text"
    if not isinstance(source, (str, Path)):
        raise ArgumentError(f"read_modelica: source is {shown(source)}; expected Modelica text, or the name of a .mo file")
    path = as_path("source", source)
    try:
        return path.read_text(encoding="utf-8-sig"), path.name
    except FileNotFoundError:
        raise FileError(f"{source} cannot be read: there is no such file") from None
    except (OSError, ValueError) as problem:
        raise FileError(f"{source} cannot be read: {problem}") from None


def _models(scope: ClassScope) -> Iterator[tuple[str, ClassScope]]:
    """The models of a text in order, with their full names."""
    for name in scope.node.classes:
        inner = scope.inner(name)
        assert inner is not None
        if inner.node.kind in MODELS and "partial" not in inner.node.prefixes:
            yield inner.name, inner
        if inner.node.kind == "package":
            yield from _models(inner)
