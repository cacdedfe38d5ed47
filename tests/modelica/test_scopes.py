"""What a class name means: declared around it, inherited, imported, of the library."""

from __future__ import annotations

from typing import Any

import pytest

from gearlib.errors import ModelicaError
from gearlib.modelica.counterparts import standard_library
from gearlib.modelica.scopes import ClassScope, descended, lookup, outermost
from gearlib.modelica.text_parser import parsed

TEXT = """
within Firm.Drives;
package P
  import R = Modelica.Mechanics.Rotational;
  import Modelica.Blocks.Math.*;
  import Modelica.Blocks.{Sources, Continuous};
  package Inner
    model Own end Own;
    model Deep = Own;
  end Inner;
  package Base
    model Inherited end Inherited;
    model Own end Own;
  end Base;
  package Heir
    extends Base;
    import P.Inner.*;
    model Own end Own;
    package Here
      import Q.Far;
      import Other = P.Base;
    end Here;
  end Heir;
  package Short = Heir;
  model M end M;
end P;
package Q
  model Far end Far;
  model M end M;
end Q;
"""


def scope(path: str) -> ClassScope:
    whole = outermost(parsed(TEXT), standard_library().knows)
    found = descended(whole, tuple(path.split(".")) if path else ())
    return found or whole


@pytest.mark.parametrize(
    ("where", "name", "expected"),
    [
        ("P.Inner", "Own", "P.Inner.Own"),
        ("P.Inner", "M", "P.M"),
        ("P.Inner", "Q.M", "Q.M"),
        ("P.Inner", "P.M", "P.M"),
        ("P.Inner.Own", "Inner.Own", "P.Inner.Own"),
        ("P.Heir", "Inherited", "P.Base.Inherited"),
        ("P.Heir", "Own", "P.Heir.Own"),
        ("P.Heir", "Deep", "P.Inner.Deep"),
        ("P.Heir.Here", "Inherited", "P.Base.Inherited"),
        ("P.Heir.Here", "Own", "P.Heir.Own"),
        ("P.Heir.Here", "Far", "Q.Far"),
        ("P.Heir.Here", "Other.Own", "P.Base.Own"),
        ("P.Heir.Here", "Other", "P.Base"),
        ("P", "Short.Own", "P.Heir.Own"),
        ("P", "Short.Inherited", "P.Base.Inherited"),
        ("Q", "P.Short.Deep", None),
        ("Q", "Firm.Drives.P.M", "P.M"),
        ("Q", "R.Components.Inertia", None),
        ("Q", "M", "Q.M"),
        ("", "Q.M", "Q.M"),
        ("P", "R.Components.Inertia", ("Modelica", "Mechanics", "Rotational", "Components", "Inertia")),
        ("P.Inner.Own", "R", ("Modelica", "Mechanics", "Rotational")),
        ("P.Inner", "Gain", ("Modelica", "Blocks", "Math", "Gain")),
        ("P.Inner", "Unknown", None),
        ("P", "Sources.Step", ("Modelica", "Blocks", "Sources", "Step")),
        ("P", "Continuous.PI", ("Modelica", "Blocks", "Continuous", "PI")),
        ("P", "Inner.Absent", None),
    ],
)
def test_names_are_looked_up_from_the_inside_out(where: str, name: str, expected: Any) -> None:
    found = lookup(tuple(name.split(".")), scope(where))
    if isinstance(found, ClassScope):
        assert found.name == expected
    else:
        assert found == (tuple(name.split(".")) if expected is None else expected)


def test_scopes_name_what_is_around_them() -> None:
    own = scope("P.Inner.Own")
    assert [level.name for level in own.upwards()] == ["P.Inner.Own", "P.Inner", "P", ""]
    assert own.root.outer is None
    assert own.inner("Absent") is None
    assert descended(own.root, ()) is None, "the text as a whole is no class"
    assert descended(own, ()) is own


def test_names_relative_to_the_package_that_a_text_belongs_to() -> None:
    text = parsed("within Modelica.Mechanics.Rotational; model M end M;")
    whole = outermost(text, standard_library().knows)
    full = ("Modelica", "Mechanics", "Rotational", "Components", "Inertia")
    for name in (full, full[3:], full[2:]):
        assert lookup(name, whole) == full
    assert lookup(("Components", "Inertie"), whole) == ("Components", "Inertie")


def test_a_text_declares_a_class_once() -> None:
    with pytest.raises(ModelicaError, match=r"column 16: the class M is declared twice"):
        outermost(parsed("model M end M; block M end M;"), standard_library().knows)
