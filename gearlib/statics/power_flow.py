"""`PowerFlow`: speed, torque and power at every flange of a train; efficiency and circulating power."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from gearlib.arguments import by_name, one_name, shown
from gearlib.drawing.page import paragraph, preformatted, table
from gearlib.drawing.printed import fitted, shortened
from gearlib.drawing.sankey import Band, sankey
from gearlib.drawing.scheme.shown_power import Load, ShownPower
from gearlib.drawing.scheme.speed_ladder import speed_ladder
from gearlib.drawing.scheme.stick_diagram import Scheme
from gearlib.errors import ArgumentError, ModelError, NameLookupError, nearest
from gearlib.language.outline import train_in
from gearlib.optional import optional
from gearlib.statics.circulation import Circulation, PowerEdge, circulations

if TYPE_CHECKING:
    import pandas

    from gearlib.drawing.scheme.train import Train
    from gearlib.drawing.svg import Picture
    from gearlib.language.component import Component

RPM = 30 / math.pi  # 1/min per rad/s
NAME, SLIDES = 42, "  (m/s, N)"  # width of the name column; suffix of sliding flanges
NOTHING = 1e-12  # relative to the largest torque or speed: rounding


@dataclass(frozen=True)
class FlangePower:
    """Speed (rad/s), torque (N.m) and power (W) at a flange; torque and power are positive into the component.

    For sliding flanges the units are m/s and N, and ``sliding`` is True.
    """

    component: str
    flange: str
    speed: float
    torque: float
    power: float
    shaft: int  # flanges on one rigid shaft share a number
    leaf: bool  # False for flanges of a composite, which repeat those of its parts
    sliding: bool = False

    @property
    def name(self) -> str:
        """Path of the flange."""
        return f"{self.component}.{self.flange}" if self.component else self.flange


@dataclass(frozen=True)
class PowerFlow:
    """Speeds, torques and powers of a train in steady motion.

    Attributes
    ----------
    flanges : tuple of FlangePower
    mobility : int
        Number of independent speeds of the train.
    name : str
        Name of the model.
    shared : tuple of str
        Flanges whose torque is not determined by equilibrium, since parallel paths (planets) could be preloaded against each other.
        Their torques are those of a train assembled without preload: shared by stiffness, equally by equal planets (load sharing factor
        1); on rigid paths what is locked shares as in a run, and other torques are those of smallest norm.
    beside : tuple of str
        Components that also exchange power through connectors of other kinds, such as electric or hydraulic ones. The powers here are
        those at flanges alone, so that a motor is a drive, and a pump a load.
    """

    flanges: tuple[FlangePower, ...]
    mobility: int
    name: str = ""
    shared: tuple[str, ...] = ()
    component: Component | None = field(default=None, repr=False, compare=False)
    beside: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> FlangePower:
        """A flange, by its path."""
        found = self._by_name.get(one_name("the flange", name, "motor.flange_b"))
        if found is None:
            raise NameLookupError(f"the model has no flange '{name}'; {nearest(str(name), self._by_name)}")
        return found

    @cached_property
    def _by_name(self) -> dict[str, FlangePower]:
        return {f.name: f for f in self.flanges}

    @cached_property
    def _branches(self) -> tuple[PowerEdge, ...]:
        """Net power of each basic component at each rigid shaft."""
        power: dict[tuple[str, int], float] = {}
        for f in self.flanges:
            if f.leaf:
                power[f.component, f.shaft] = power.get((f.component, f.shaft), 0.0) + f.power
        least = 1e-12 * self.largest
        return tuple(PowerEdge(c, s, p) for (c, s), p in power.items() if abs(p) > least)

    @property
    def largest(self) -> float:
        """Largest power at any flange, W."""
        return max((abs(f.power) for f in self.flanges), default=0.0)

    @cached_property
    def absorbed(self) -> dict[str, float]:
        """Net power into each basic component (W): negative for a drive, positive for a load, the loss of a gear."""
        total: dict[str, float] = {}
        for f in self.flanges:
            if f.leaf:
                total[f.component] = total.get(f.component, 0.0) + f.power
        return total

    @cached_property
    def outer(self) -> tuple[str, ...]:
        """Drives and loads: components with one shaft that turns, or that deliver power, such as a motor whose housing turns."""
        shafts: dict[str, set[int]] = {branch.component: set() for branch in self._branches}
        for f in self.flanges:  # a gear whose output idles is no load, although power passes through one of its shafts only
            if f.leaf and f.component in shafts and abs(f.speed) > NOTHING * self._scales[0]:
                shafts[f.component].add(f.shaft)
        return tuple(c for c, turn in shafts.items() if len(turn) == 1 or self.absorbed[c] < -NOTHING * self.largest)

    @property
    def input_power(self) -> float:
        """Power delivered by the drives, W."""
        return -sum(min(self.absorbed[c], 0.0) for c in self.outer)

    @property
    def output_power(self) -> float:
        """Power consumed by the loads, W."""
        return sum(max(self.absorbed[c], 0.0) for c in self.outer)

    @property
    def efficiency(self) -> float:
        """Output power over input power; NaN if there is no drive."""
        return self.output_power / self.input_power if self.input_power else float("nan")

    @property
    def losses(self) -> dict[str, float]:
        """Power lost in the components between drives and loads, W."""
        least = 1e-12 * self.largest
        return {c: p for c, p in self.absorbed.items() if c not in self.outer and abs(p) > least}

    @property
    def imbalance(self) -> float:
        """Sum of the power at all basic flanges relative to the largest: only rounding, since connections conserve power."""
        total = sum(f.power for f in self.flanges if f.leaf)
        return abs(total) / self.largest if self.largest else 0.0

    @cached_property
    def circulating(self) -> tuple[Circulation, ...]:
        """Circulating powers, with the components that each flows through."""
        return circulations(self._branches)

    @property
    def circulating_power(self) -> float:
        """Sum of the circulating powers, W."""
        return sum(c.power for c in self.circulating)

    def willis(self, sun: str, ring: str, carrier: str) -> tuple[float, float]:
        """Basic ratio (Willis) of a planetary set from its speeds, and from its torques; they are equal without losses.

        Parameters
        ----------
        sun, ring, carrier : str
            Paths of its flanges.

        Returns
        -------
        tuple of float
            ``(w_sun - w_carrier) / (w_ring - w_carrier)`` and ``-tau_ring / tau_sun``; NaN if the set turns as a block or carries no
            torque.
        """
        s, r, c = self[sun], self[ring], self[carrier]
        relative = r.speed - c.speed
        turning = abs(relative) > 1e-12 * max(abs(s.speed), abs(r.speed), abs(c.speed))
        return (s.speed - c.speed) / relative if turning else float("nan"), -r.torque / s.torque if s.torque else float("nan")

    def sankey(self) -> Picture:
        """Sankey diagram: band widths are proportional to power, from drives to loads; circulating power flows back below."""
        flows, joints = flows_of(self._branches)
        return sankey([Band(*flow) for flow in flows], self.losses, self._title, joints)

    def scheme(self) -> Scheme:
        """Stick diagram of the train with speeds, torques and powers; band widths are proportional to the power in a shaft.

        Numbers at the shafts refer to the table below the drawing.

        Raises
        ------
        ModelError
            Nothing rotates that a stick diagram could show (see `Component.scheme`).
        """
        loads = {(f.component, f.flange): Load(f.speed, f.torque, f.power) for f in self.flanges if not f.sliding}
        return Scheme(self._train, ShownPower(loads))

    def speed_ladder(self, name: str | None = None, other: Mapping[str, PowerFlow] | None = None) -> Picture:
        """Speed ladder of the planetary sets: speeds as straight lines across the rails of their shafts (Ravigneaux, Kutzbach).

        Parameters
        ----------
        name : str, optional
            Label of this motion, such as ``"1st gear"``.
        other : mapping of str to PowerFlow, optional
            Other motions of the same train for comparison, by label.

        Raises
        ------
        ModelError
            The train has no planetary set.
        ArgumentError
            Something other than power flows.
        """
        own = "" if name is None else one_name("name", name, "1st gear")
        flows = {own: self} if other is None else {own: self, **by_name("other", other, "power flows by name", "2nd gear")}
        for label, flow in flows.items():
            if not isinstance(flow, PowerFlow):
                raise ArgumentError(f"other['{label}'] is {shown(flow)}; expected a PowerFlow, as power_flow(...) gives it")
        speeds = {
            label: {(f.component, f.flange): f.speed for f in flow.flanges if not f.sliding} for label, flow in flows.items()
        }
        return speed_ladder(self._train, speeds)

    @property
    def _train(self) -> Train:
        if self.component is None:
            raise ModelError("this PowerFlow was made by hand, without a model whose gears could be drawn")
        return train_in(self.component)

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per flange, as a pandas DataFrame."""
        pandas = optional("pandas")

        table = [(f.name, f.speed, f.torque, f.power) for f in self.flanges]
        return pandas.DataFrame(table, columns=["flange", "speed", "torque", "power"]).set_index("flange")

    def __str__(self) -> str:
        lines = [self._title, "", *table_of(self._shown, self._scales), *self._left_out, *self._sharing, "", *self._balance]
        return fitted("\n".join(lines))

    def _repr_html_(self) -> str:
        """Notebook representation: a table of the flanges, followed by the balance."""
        rows: list[list[str | float]] = [
            [f.name, f.speed, "" if f.sliding else f.speed * RPM, f.torque, f.power] for f in self._shown
        ]
        head = ["flange", "speed, rad/s", "speed, 1/min", "torque, N·m", "power, W"]
        about = "".join(map(paragraph, [*self._left_out, *([" ".join(self._sharing)] if self._sharing else [])]))
        return paragraph(self._title) + table(head, rows) + about + preformatted(fitted("\n".join(self._balance)))

    @property
    def _title(self) -> str:
        freedom = "1 degree of freedom" if self.mobility == 1 else f"{self.mobility} degrees of freedom"
        return f"Steady power flow{' of ' + self.name if self.name else ''}: mobility {self.mobility} ({freedom})"

    @cached_property
    def _scales(self) -> tuple[float, float]:
        """Largest speed and largest torque."""
        return max((abs(f.speed) for f in self.flanges), default=0.0), max((abs(f.torque) for f in self.flanges), default=0.0)

    @cached_property
    def _shown(self) -> list[FlangePower]:
        """Flanges worth a line: not those of bodies that merely pass on a torque, nor of components without torque."""
        own: dict[str, list[FlangePower]] = {}
        for f in self.flanges:
            if f.leaf:
                own.setdefault(f.component, []).append(f)
        least = NOTHING * self._scales[1]
        passing = {
            c
            for c, found in own.items()
            if abs(sum(f.torque for f in found)) <= 10 * least and len({f.shaft for f in found}) == 1 and len(found) > 1
        }
        return [f for c, found in own.items() if c not in passing and any(abs(f.torque) > least for f in found) for f in found]

    @property
    def _left_out(self) -> list[str]:
        count = sum(f.leaf for f in self.flanges) - len(self._shown)
        return (
            [f"({count} flanges of bodies that pass on their torque, or of parts without any, are left out)"] if count else []
        )

    @property
    def _sharing(self) -> list[str]:
        if not self.shared:
            return []
        named = ", ".join(self.shared[:3]) + (", ..." if len(self.shared) > 3 else "")
        return [
            f"(equilibrium leaves {len(self.shared)} torques open: {named}; they are those of parallel paths without preload, "
            "which share the load by stiffness, equally among equal planets, and the smallest ones where these are rigid)",
        ]

    @property
    def _balance(self) -> list[str]:
        least = NOTHING * self.largest
        drives = [c for c in self.outer if self.absorbed[c] < -least]
        loads = [c for c in self.outer if self.absorbed[c] > least]
        lines = [f"input power        {self.input_power:.6g} W{' from ' + ', '.join(drives) if drives else ''}"]
        lines.append(f"output power       {self.output_power:.6g} W{' to ' + ', '.join(loads) if loads else ''}")
        lost = ", ".join(f"{c} {p:.6g}" for c, p in self.losses.items())
        lines.append(f"losses             {sum(self.losses.values()):.6g} W{': ' + lost if lost else ''}")
        if self.input_power and self.output_power:
            lines.append(f"efficiency         {self.efficiency:.6g}")
        if self.circulating:
            share = (
                f", {100 * self.circulating_power / self.input_power:.4g} % of the input" if self.input_power > least else ""
            )
            lines.append(f"circulating power  {self.circulating_power:.6g} W{share}")
            lines += [f"                   {c.power:.6g} W through {', '.join(c.components)}" for c in self.circulating]
        else:
            lines.append("circulating power  none")
        if self.beside:
            named = ", ".join(self.beside[:3]) + (", ..." if len(self.beside) > 3 else "")
            lines.append(f"(only power at flanges is counted; other connectors carry power as well: those of {named})")
        return lines


def flows_of(branches: Sequence[PowerEdge]) -> tuple[list[tuple[str, str, float]], list[str]]:
    """Power from component to component; via a node where more than two share a shaft.

    >>> shaft = [PowerEdge("gear", 1, -5.0), PowerEdge("a", 1, 2.0), PowerEdge("b", 1, 3.0)]
    >>> flows_of([PowerEdge("motor", 0, -5.0), PowerEdge("gear", 0, 5.0), *shaft])
    ([('motor', 'gear', 5.0), ('gear', 'shaft 1', 5.0), ('shaft 1', 'a', 2.0), ('shaft 1', 'b', 3.0)], ['shaft 1'])
    """
    by_shaft: dict[int, list[PowerEdge]] = {}
    for branch in branches:
        by_shaft.setdefault(branch.shaft, []).append(branch)
    flows: list[tuple[str, str, float]] = []
    joints = []
    for shaft, found in by_shaft.items():
        givers, takers = [b for b in found if b.power < 0], [b for b in found if b.power > 0]
        if len(givers) == len(takers) == 1:
            flows.append((givers[0].component, takers[0].component, takers[0].power))
            continue
        joints.append(f"shaft {shaft}")
        flows += [(b.component, joints[-1], -b.power) for b in givers]
        flows += [(joints[-1], b.component, b.power) for b in takers]
    return flows, joints


def table_of(flanges: list[FlangePower], scales: tuple[float, float]) -> list[str]:
    most = NAME - (len(SLIDES) if any(f.sliding for f in flanges) else 0)
    width = min(max((len(f.name) for f in flanges), default=6), most)
    lines = [f"{'flange':{width}}  {'speed, rad/s':>13} {'speed, 1/min':>13} {'torque, N.m':>13} {'power, W':>13}"]
    for f in flanges:
        speed = 0.0 if abs(f.speed) <= NOTHING * scales[0] else f.speed
        torque = 0.0 if abs(f.torque) <= NOTHING * scales[1] else f.torque
        turning = f"{'-':>13}" if f.sliding else f"{speed * RPM:13.6g}"
        slides = SLIDES if f.sliding else ""
        lines.append(
            f"{shortened(f.name, width):{width}}  {speed:13.6g} {turning} {torque:13.6g} {speed * torque + 0.0:13.6g}{slides}"
        )
    return [*lines, "(torque and power are positive into the component: a drive's power is negative, a load's positive)"]
