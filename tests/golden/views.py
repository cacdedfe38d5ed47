"""What is drawn, plotted and printed of small models, by name: each view is made anew when it is called."""

from __future__ import annotations

import inspect
import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any

import control
import numpy as np

import gearlib as gl
import gearparts as gp
from gearlib.bondgraph import TF, BondGraph, C, I, One, R, Se, assign_causality, draw
from gearlib.drawing.curves import plot_against, plot_spectrum
from gearlib.drawing.histories import History, plot_histories
from gearlib.drawing.icons import ICONS
from gearlib.drawing.quantities import Shown
from gearlib.drawing.sankey import sankey
from gearlib.drawing.scheme.speed_ladder import speed_ladder
from gearlib.vibration.draw_mode import draw_mode
from gearparts.trains.paper_graphs import planetary_unit
from gearparts.trains.structure_diagram import single_loop, unit_diagram
from tests.drawing.gears.test_gear_view_picture import view
from tests.drawing.scheme.test_shown_motion import Damped, Geared
from tests.drawing.scheme.test_speed_ladder import TRAIN, motion
from tests.drawing.scheme.test_stick_diagram import scheme_of
from tests.drawing.test_curves import ellipse, histories
from tests.drawing.test_diagram_picture import DIAGRAMS
from tests.drawing.test_histories import Rattle
from tests.drawing.test_sankey_picture import FLOWS, LOSSES
from tests.fitting.test_fit_result import fitted, series
from tests.gearparts.test_declared_numbers import CLASSES
from tests.golden import told
from tests.linear.test_response_by_hand import response
from tests.periodic.test_harmonic_response import response as orbits
from tests.periodic.test_order_analysis import turning
from tests.vibration.test_draw_mode import MIXED, diagram


class Drive(gl.Component):
    """A motor, a pinion and a wheel with elastic teeth, a shaft and a fan: of every analysis a small example."""

    def assemble(self) -> list[Any]:
        self.torque, self.motor = gp.Torque(), gp.Inertia(J=0.02)
        self.mesh = gp.ExternalMesh(r_a=0.03, r_b=0.09, c=2e7, d=400.0)
        self.wheel, self.shaft, self.rotor = (
            gp.Inertia(J=0.3),
            gp.SpringDamper(c=4e3, d=2.0),
            gp.Inertia(J=1.5, guess={"w": 20.0}),
        )
        self.bearing, self.ground = gp.Damper(d=0.1), gp.Fixed()
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-50.0, w_nominal=40.0)
        return [
            gl.connect(self.torque.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.mesh.flange_a),
            gl.connect(self.mesh.flange_b, self.wheel.flange_a, self.bearing.flange_a),
            gl.connect(self.bearing.flange_b, self.ground.flange),
            gl.connect(self.wheel.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.rotor.flange_a),
            gl.connect(self.rotor.flange_b, self.fan.flange),
        ]


TORQUE = {"torque.tau": -10.0}
LOOP = control.tf([3.0, 0.2, 30], [1, 0.3, 16, 2, 5], name="loop")
STICKS = ("xp", "two stages", "simpson", "ravigneaux", "one set", "losses")
DIAGRAMMED = ("several", "xp, top", "chain", "control, inside", "heat")


@cache
def drive() -> gl.System:
    return gl.compile(Drive())


@cache
def linear() -> gl.LinearModel:
    return drive().linearize(["torque.tau"], ["motor.w", "rotor.w"], at="steady")


@cache
def modes() -> gl.Modes:
    return gl.modes(gl.compile(Damped()))


@cache
def run() -> gl.SimulatedResult:
    return gl.compile(Rattle()).simulate(1.0, samples=201, rtol=1e-10)


@cache
def power() -> gl.PowerFlow:
    return drive().power_flow(torques=TORQUE)


@cache
def circulating() -> gl.PowerFlow:
    return gl.compile(gp.ZhouCui2022()).power_flow(speeds={"w_in": 100.0})


def critical() -> gl.Campbell:
    return gl.campbell(gl.compile(Damped()), np.linspace(10.0, 60.0, 6), {"mesh": 3.0, "unbalance": 1.0})


def causality() -> Any:
    source, v, w, ratio = Se(), One("v"), One("w"), TF(2)
    graph = BondGraph((1, source, v), (2, v, I()), (3, v, ratio), (4, ratio, w), (5, w, C()), (6, w, R()))
    return graph, assign_causality(graph)


def report() -> str:
    """The page without its style and script."""
    with tempfile.TemporaryDirectory() as folder:
        page = drive().report(Path(folder) / "drive.html", power_flow=power())
        text = page.read_text(encoding="utf-8")
    text = re.sub(r"<(style|script)\b.*?</\1>|<svg.*?</svg>", "", text, flags=re.DOTALL)
    return re.sub(r">\s*<", ">\n<", text)


def declarations() -> str:
    """What each part of the library declares beside names, kinds and units: defaults, bounds, choices, sizes."""
    return "\n".join(line for kind in CLASSES for line in _declared(kind))


def _declared(kind: type[gl.Component]) -> Iterator[str]:
    yield kind.__name__
    for name, declared in sorted(kind._declarations.items()):
        standard = {f.name: f.default for f in fields(declared) if f.name not in ("description", "unit")}
        values = {n: getattr(declared, n) for n in standard if getattr(declared, n) is not standard[n]}
        if values:
            yield f"  {name} {' '.join(f'{n}={_shown(v)}' for n, v in values.items())}"


def icons() -> str:
    """Where each stroke of the icons is, and where their shafts are; without colours and widths."""
    style = re.compile(r" (fill|stroke[\w-]*|font[\w-]*|text-anchor)=[^ \n]+")
    found = [
        (f"{name} {icon.left:g} {icon.right:g}{' framed' if icon.framed else ''}", *icon.drawing, *icon.letters)
        for name, icon in ICONS.items()
    ]
    return style.sub("", "\n".join(head + told.svg(f"<g>{''.join(drawn)}</g>")[1:] for head, *drawn in found))


def defaults() -> str:
    """What the functions and methods of the public names take for the arguments that are not given."""
    return "\n".join(f"{name}({given})" for name, given in _defaults() if given)


def _defaults() -> Iterator[tuple[str, str]]:
    for name, value in ((n, getattr(module, n)) for module in (gl, gp, gp.blocks) for n in module.__all__):
        methods = {f"{name}.{n}": m for n, m in vars(value).items() if not n.startswith("_")} if isinstance(value, type) else {}
        for where, called in {name: value, **methods}.items():
            with suppress(TypeError, ValueError):  # no function
                given = inspect.signature(getattr(called, "__func__", called)).parameters.values()
                yield where, ", ".join(f"{p.name}={_shown(p.default)}" for p in given if p.default not in (p.empty, None))


def _shown(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else re.sub(r" at 0x[0-9a-f]+", "", str(value))


def signal(rows: int = 256) -> History:
    t = np.arange(rows) / 64.0
    return History("x", "m", t, 0.3 + np.sin(10 * np.pi * t) + 0.1 * np.cos(22.6 * np.pi * t))


PICTURES: dict[str, Callable[[], str]] = {
    **{f"blocks {name}": (lambda name=name: DIAGRAMS[name]().svg) for name in DIAGRAMMED},
    **{f"scheme {name}": (lambda name=name: scheme_of(name).svg) for name in STICKS},
    "scheme_mode_in_phase": lambda: gl.modes(gl.compile(Geared())).scheme(1).svg,
    "scheme_mode_damped": lambda: modes().scheme(0).svg,
    "scheme_power": lambda: circulating().scheme().svg,
    "ladder": lambda: speed_ladder(TRAIN, {"first": motion(-10.0, 100.0), "second": motion(30.0, -12.0)}).svg,
    "sankey": lambda: sankey(FLOWS, LOSSES, "Power of a train", ("shaft 1",)).svg,
    "sankey_circulating": lambda: circulating().sankey().svg,
    "gears": lambda: view().svg,
    "structure": lambda: drive().draw_structure().svg,
}

PLOTS: dict[str, Callable[[], Any]] = {
    "bode": lambda: gl.bode_plot(LOOP),
    "nichols": lambda: gl.nichols_plot(LOOP),
    "nyquist": lambda: gl.nyquist_plot(LOOP),
    "root_locus": lambda: gl.root_locus_plot(LOOP, gains=np.linspace(0.0, 2.0, 41)),
    "response": lambda: response().plot(),
    "response_of_a_train": lambda: gl.frequency_response(linear(), np.geomspace(1.0, 1e4, 40)).plot(),
    "orbits": lambda: orbits().plot("w", harmonic=2),
    "order_spectrum": lambda: gl.order_spectrum(turning(6.0, 98, {2.0: 0.5, 4.5: 3.0}, mean=-2.0), "signal", "angle").plot(),
    "order_waterfall": lambda: gl.order_waterfall(
        turning(40.0, 2001, {2.0: 0.5, 4.5: 3.0}, ramp=0.2), "signal", "speed"
    ).plot(),
    "mode": lambda: draw_mode(MIXED),
    "mode_of_a_train": lambda: modes().draw(1),
    "campbell": lambda: diagram().plot(),
    "campbell_of_a_train": lambda: critical().plot(),
    "fit": lambda: fitted(series=(series(), series("motor.w", 3, True))).plot(),
    "histories": lambda: plot_histories(histories("m", "N", "m", "1", "N.m2"), units={"s": "ms", "v1": "kN"}),
    "histories_of_a_run": lambda: run().plot("a.w", "b.w", "gap.tau", "der(a.w)"),
    "against": lambda: plot_against(*ellipse(), (Shown("m", 1.0), Shown("N", 1.0)), period=2.0),
    "against_of_a_run": lambda: run().plot_against("gap.phi_rel", "gap.tau"),
    "spectrum": lambda: plot_spectrum(signal(), Shown("m", 1.0)),
    "bond_graph": lambda: draw(causality()[0], causality=causality()[1]),
    "bond_graph_of_a_unit": lambda: planetary_unit().draw(),
    "loop_diagram": lambda: single_loop("XP").draw(),
    "unit_diagram": lambda: unit_diagram("X").draw(),
}

TEXTS: dict[str, Callable[[], str]] = {
    "causality": lambda: causality()[1].report(),
    "modes": lambda: str(modes()),
    "modes_page": lambda: modes()._repr_html_(),
    "mode_sensitivity": lambda: str(modes().sensitivity("first.c")),
    "critical_speeds": lambda: str(critical()),
    "power": lambda: str(power()),
    "power_page": lambda: power()._repr_html_(),
    "circulating_power": lambda: str(circulating()),
    "stability": lambda: str(gl.stability(drive(), ("torque.tau", "rotor.w"), gain=2.0, at={"motor.w": 60.0})),
    "stability_page": lambda: gl.stability(drive(), at="steady")._repr_html_(),
    "stability_of_a_loop": lambda: str(gl.stability(LOOP)),
    "steady_state": lambda: str(gl.steady_state(drive(), ["motor.w", "rotor.w", "mesh.f"], inputs=TORQUE)),
    "passivity": lambda: str(gl.passivity(gl.compile(Damped()))),
    "fit_in_words": lambda: str(fitted()),
    "energy_balance": lambda: str(run().energy_balance()),
    "run_page": lambda: run()._repr_html_(),
    "parts_page": lambda: Drive()._repr_html_(),
    "system_page": lambda: drive()._repr_html_(),
    "report": report,
    "declarations": declarations,
    "defaults": defaults,
    "icons": icons,
    "modelica": lambda: gl.to_modelica(Drive()),
    "modelica_own_classes": lambda: gl.to_modelica(Rattle(), standard_library=False),
    "modelica_flat": lambda: gl.to_modelica(Damped(), flat=True),
}

VIEWS: dict[str, Callable[[], str]] = {
    **{re.sub(r"\W+", "_", name): (lambda make=make: told.svg(make())) for name, make in PICTURES.items()},
    **{name: (lambda make=make: told.figure(make())) for name, make in PLOTS.items()},
    **TEXTS,
}
