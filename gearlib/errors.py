"""Exceptions and warnings of gearlib.

GearlibError
├── ModelError             the model as written cannot be right
│   ├── DeclarationError     a component class is declared wrongly
│   ├── BindingError         an unknown or ill-typed parameter, input, start value
│   ├── BoundError           a parameter outside its bounds, or not a finite number
│   ├── ConnectionError      connectors of different kinds, of another model, of one component twice
│   ├── BalanceError         equations too many or too few (Dulmage-Mendelsohn)
│   ├── LoopError            a rigid loop whose ratios contradict each other
│   ├── SingularError        equations that a numerical value makes singular
│   └── ModelicaError        Modelica text that is not understood, or a model that it cannot express
├── StartError             start values that contradict each other, or that cannot be found
├── NameLookupError        no variable, parameter, input or output of that name
│   └── AttributeNameError   no connector, variable or part of that name, where it was written as an attribute
├── ArgumentError          a bad argument of simulate, linearize, ...
├── FileError              a file that cannot be read or written, is of another kind, truncated or damaged
├── MissingPackageError    a table or a plot needs a package that is not installed
├── WorkerError            another process that was to carry out runs of a sweep was lost, or cannot
└── SolverError            the integration failed; says when and where

GearlibWarning (a UserWarning)
└── InputWarning           inputs that were not given, or to which nothing responds
"""

from __future__ import annotations

import difflib
import inspect
import warnings
from collections.abc import Iterable

__all__ = [
    "ArgumentError", "AttributeNameError", "BalanceError", "BindingError", "BoundError", "ConnectionError", "DeclarationError",
    "FileError", "GearlibError", "GearlibWarning", "InputWarning", "LoopError", "MissingPackageError", "ModelError", "ModelicaError",
    "NameLookupError", "SingularError", "SolverError", "StartError", "WorkerError",
]  # fmt: skip


class GearlibError(Exception):
    """Base of all errors that gearlib raises deliberately."""


class ModelError(GearlibError):
    """The model is incorrect as written."""


class DeclarationError(ModelError):
    """An invalid declaration in a component class."""


class BindingError(ModelError, TypeError):
    """An unknown or ill-typed parameter, input or start value."""


class BoundError(ModelError, ValueError):
    """A parameter outside its bounds, or not a finite number."""


class ConnectionError(ModelError):
    """Connectors of different kinds, of another model, or of one component twice."""


class BalanceError(ModelError):
    """Too many or too few equations."""


class LoopError(ModelError):
    """A rigid loop whose ratios contradict each other."""


class SingularError(ModelError):
    """Equations that are singular for the given numerical values."""


class ModelicaError(ModelError):
    """Modelica text that is not supported, or a model that cannot be expressed in Modelica."""


class StartError(GearlibError, ValueError):
    """Start values that contradict each other, or that cannot be found."""


class NameLookupError(GearlibError, KeyError):
    """Unknown name of a variable, parameter, input or output."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class AttributeNameError(NameLookupError, AttributeError):
    """Unknown attribute of a component or connector."""


class ArgumentError(GearlibError, ValueError):
    """Invalid argument of a public function."""


class FileError(GearlibError, ValueError):
    """A file that cannot be read or written, or is of another kind, truncated or damaged."""


class MissingPackageError(GearlibError, ImportError):
    """An optional package is needed that is not installed."""


class WorkerError(GearlibError, RuntimeError):
    """A worker process of a sweep was lost, or cannot do its work."""


class SolverError(GearlibError, RuntimeError):
    """The integration failed."""


class GearlibWarning(UserWarning):
    """Base of the warnings with a category of their own."""


class InputWarning(GearlibWarning):
    """Inputs that were not given and so taken as 0, or an input of a linear analysis that occurs in no equation."""


def warn(message: str, category: type[Warning]) -> None:
    """Warn at the line outside gearlib that made the call, every time.

    `warnings.warn` shows a message once per line, so that in a loop over runs only the first one would be reported.
    """
    frame = inspect.currentframe()
    assert frame is not None  # CPython has frames
    while frame.f_back is not None and str(frame.f_globals.get("__name__")).partition(".")[0] in ("gearlib", "functools"):
        frame = frame.f_back
    module = frame.f_globals.get("__name__")
    warnings.warn_explicit(message, category, frame.f_code.co_filename, frame.f_lineno, module, registry={})


USUAL = {  # common names elsewhere, and their equivalents here
    "omega": "w", "speed": "w", "angle": "phi", "theta": "phi", "alpha": "a", "torque": "tau", "inertia": "J", "stiffness": "c",
    "damping": "d", "k": "c", "model": "Component", "block": "Component", "real": "Variable", "equation": "Eq", "equations": "Eq",
    "planetarygear": "PlanetaryUnit", "gear": "IdealGear", "shaft": "TorsionalShaft", "motor": "Torque", "mass": "Mass",
    "body": "Inertia", "planetary": "IdealPlanetary",
}  # fmt: skip


def nearest(name: str, valid: Iterable[str], limit: int = 12) -> str:
    """Advice for a misspelt ``name``: the closest of the ``valid`` ones, and all of them if there are few.

    >>> nearest("w_loda", ["w_load", "phi"])
    "did you mean 'w_load'? Valid names: phi, w_load"
    """
    valid = sorted(set(valid))
    path, dot, last = name.rpartition(".")
    close = [v for v in valid if v.lower() == name.lower() or v == path + dot + USUAL.get(last.lower(), "")]
    close = close or difflib.get_close_matches(name, valid, n=3, cutoff=0.5)
    if not close and dot and (beside := [v for v in valid if v.rpartition(".")[0] == path]):
        return f"'{path}' has {', '.join(v.rpartition('.')[2] for v in beside[:limit])}"
    advice = "did you mean " + " or ".join(f"'{c}'" for c in close) + "?" if close else ""
    if not valid:
        return "there are none"
    if len(valid) <= limit:
        advice += f"{' ' if advice else ''}Valid names: {', '.join(valid)}"
    elif not close:
        advice = f"there are {len(valid)} names, among them {', '.join(valid[:limit])}"
    return advice
