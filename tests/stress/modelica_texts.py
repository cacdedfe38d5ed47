"""Modelica texts with something wrong in them: words left out, doubled, exchanged, or replaced by what does not belong there."""

from __future__ import annotations

import random
from collections.abc import Iterator

import gearlib as gl
from gearlib.errors import GearlibError
from gearlib.language.component import equations_of
from gearlib.language.interior import connections_of, parts_of
from gearlib.modelica.lexer import tokens

READ, REFUSED_TEXT = "read", "refused"
ODD = (
    "{1, 2}", "{}", '"a"', "true", "time", "0", "-1", "1.5", "1e400", "x", "k", "(a = 1)", "[1]", "[1, 2]", "end", "(", ")", ";", "= 3",
    "each", "der(x)", "pre(n)", "StateSelect.no", "Components", "Components.Inertia", "if", "1:2", "+", "not", "if true", "nothing.at.all",
)  # fmt: skip

GOOD = """
package P "of parts"
  import Modelica.Mechanics.Rotational.{Components, Interfaces, Sources};
  import Modelica.Blocks.{Continuous, Math};
  constant Real two = 2;
  type Level = enumeration(low, high);
  type Stiffness = Modelica.Units.SI.RotationalSpringConstant(min = 0, start = 3);
  connector Pin
    Real v(unit = "V");
    flow Real i;
  end Pin;
  partial model Base
    parameter Real k = 1;
    Real x(start = k, fixed = true, nominal = 2, stateSelect = StateSelect.prefer);
  end Base;
  model Small
    extends Base(k = 3, x(start = 4));
    parameter Integer n = 2;
    parameter Level level = Level.low;
    parameter Boolean on = n > 1 and level == Level.low;
    input Real u;
    discrete Real d(start = 1);
    Pin pin if on;
    Components.Inertia body(J = k, w(start = two));
  equation
    der(x) = if x > 1 then u else noEvent(abs(x));
    when {x > 2, sample(1, k)} then d = pre(d) + 1; reinit(x, 0); elsewhen initial() then d = 3; end when;
  end Small;
  model M
    extends Components.Inertia(J = 2, phi(start = 1, fixed = true));
    parameter Integer m = 2;
    parameter Real p[3] = {k * k for k in 1:3};
    parameter Stiffness c(max = 9) = sum(p[2:3]) / two;
    Small s(u = time, n = 3, body(J = 5));
    replaceable Math.Gain g(k = c, u = s.x) constrainedby Math.Gain;
    Components.Fixed f[3](phi0 = p) if m > 1;
    Continuous.Integrator i(k = 2, u = g.y, y_start = 3, initType = Modelica.Blocks.Types.Init.InitialState);
    Real y(start = 0.5) = max({g.y, i.y, 1}) ^ 2;
    Real z;
  initial equation
    z = y;
  equation
    for j in 1:2 loop connect(f[j].flange, s.body.flange_a); end for;
    if m > 2 then connect(s.body.flange_b, flange_a); else connect(s.body.flange_b, flange_b); end if;
    if z > 1 then der(z) = -z; else der(z) = semiLinear(y, 1, 2); end if;
  end M;
end P;
"""


def variants(seed: int, count: int, text: str = GOOD) -> Iterator[str]:
    """Texts that differ from a good one in one or two places, mostly in names and values."""
    draw = random.Random(seed)
    lines, found = text.splitlines(keepends=True), tokens(text)
    starts = [sum(map(len, lines[: token.at.line - 1])) + token.at.column - 1 for token in found]
    words = [text[a:b] for a, b in zip(starts, starts[1:], strict=False)]
    values = [k for k, token in enumerate(found[:-1]) if token.kind in ("identifier", "number")]
    for _ in range(count):
        made = list(words)
        for _ in range(draw.choice((1, 1, 2))):
            k = draw.choice(values) if draw.random() < 0.8 else draw.randrange(len(words))
            made[k] = draw.choice(("", made[k] * 2, *[f"{draw.choice(ODD)} "] * 4, *[words[draw.choice(values)]] * 2))
        yield "".join(made)


def judged(text: str) -> str:
    """Whether a text is read or refused; any other exception goes through."""
    try:
        made = gl.read_modelica(text, "P.M")()
        known = [made]
        while known:
            connections_of(part := known.pop())
            equations_of(part)
            known += parts_of(part).values()
    except GearlibError:
        return REFUSED_TEXT
    return READ
