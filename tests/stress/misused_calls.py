"""Everything public that takes arguments, each with right ones."""

from __future__ import annotations

import inspect
import tempfile
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import sympy

import gearlib as gl
import gearparts as gp
from gearlib import bondgraph as bg
from gearlib.flatten.flatten import flatten
from gearlib.language.declarations import NO_VALUE
from tests.stress.misuse import Call

_TEMPORARY = tempfile.TemporaryDirectory(prefix="gearlib-misuse-", ignore_cleanup_errors=True)
FOLDER = Path(_TEMPORARY.name)


class Drive(gl.Component):
    """A motor, a shaft and a braked load; linear."""

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.motor = gp.Torque(), gp.Inertia(J=1.0)
        self.shaft, self.load = gp.SpringDamper(c=100.0, d=1.0), gp.Inertia(J=2.0)
        self.brake, self.ground = gp.Damper(d=0.5), gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.load.flange_a),
            gl.connect(self.load.flange_b, self.brake.flange_a),
            gl.connect(self.brake.flange_b, self.ground.flange),
        ]


class Oscillator(gl.Component):
    """A mass on a spring, under a harmonic force."""

    w = gl.Parameter("rad/s", default=1.0)
    x = gl.Variable("1")
    v = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), gl.cos(self.w * gl.time) - 0.2 * self.v - self.x - 0.1 * self.x**3),
        ]


class Characteristic(gl.Component):
    """A torque that follows from a speed."""

    d = gl.Parameter("N.m.s/rad", default=2.0)
    w, tau = gl.Input("rad/s"), gl.Variable("N.m")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.tau, -self.d * self.w)]


class Set(gl.Component):
    """A planetary set that a torque drives against a damper."""

    def assemble(self) -> list[gl.Connection]:
        self.set, self.sun, self.carrier = gp.IdealPlanetary(ratio=3.0), gp.Inertia(J=1.0), gp.Inertia(J=2.0)
        self.ground, self.torque = gp.Fixed(), gp.Torque()
        self.brake = gp.Damper(d=0.5)
        return [
            gl.connect(self.torque.flange, self.sun.flange_a),
            gl.connect(self.sun.flange_b, self.set.sun),
            gl.connect(self.set.ring, self.ground.flange),
            gl.connect(self.set.carrier, self.carrier.flange_a),
            gl.connect(self.carrier.flange_b, self.brake.flange_a),
            gl.connect(self.brake.flange_b, self.ground.flange),
        ]


class Leaf(gl.Component):
    """What expressions are made of."""

    x = gl.Variable("1")
    y = gl.Variable("1")
    n = gl.Discrete()
    p = gl.Parameter("1", default=1.0)


LOOP = ("torque.tau", "load.w")
MODEL = r'model M "with a \"quoted\" word" parameter Real k = 2; Real x(start=k); equation der(x) = -k * x; end M;'


@lru_cache(maxsize=1)
def system() -> gl.System:
    return gl.compile(Drive())


@lru_cache(maxsize=1)
def run() -> gl.Result:
    return system().simulate(10.0, samples=501, method="exact", inputs={"torque.tau": 10.0})


@lru_cache(maxsize=1)
def oscillator() -> gl.System:
    return gl.compile(Oscillator())


@lru_cache(maxsize=1)
def meshed() -> gl.System:
    return gl.compile(gp.ZhouCui2022(tau_in=100.0))


@lru_cache(maxsize=1)
def linear() -> Any:
    return system().linearize(["torque.tau"], ["load.w"])


def _graph() -> bg.BondGraph:
    rotor = bg.One("rotor")
    return bg.BondGraph((1, bg.Se("tau"), rotor), (2, rotor, bg.I("J")), (3, rotor, bg.R("b")))


class Idle(gl.Method):
    """A method of one's own."""

    name = "idle"

    def stepper(self, problem: Any) -> Any:
        raise NotImplementedError


def analyses() -> list[Call]:
    """Functions that take a system or a result."""
    s = lambda: {"system": system()}  # noqa: E731
    m = lambda: {"model": system(), "loop": LOOP}  # noqa: E731
    r = lambda: {"result": run(), "name": "load.w", "reference": "load.phi"}  # noqa: E731
    quick = {"frequency": "w", "harmonics": 1, "samples": 16, "outputs": ["x"], "step": 0.1, "points": 50}
    return [
        Call("compile", gl.compile, lambda: {"component": Drive()}),
        Call(
            "simulate",
            gl.simulate,
            lambda: {"component": Drive(), "t_end": 0.1, "samples": 3},
            taken=frozenset(inspect.signature(gl.System.simulate).parameters) - {"self", "t_end"} | {"outputs", "nonsense"},
        ),
        Call("sweep", gl.sweep, lambda: {"analysis": gl.modes, "system": system(), "parameters": {"load.J": [1.0, 2.0]}}),
        Call(
            "cut", lambda place="load", **options: gl.cut(Drive(), place, **options), lambda: {"place": "load", "given": "flow"}
        ),
        Call("grid", gl.grid, lambda: {"values": {"load.J": [1.0, 2.0]}}),
        Call("final", gl.final, lambda: {"name": "load.w"}),
        Call("peak", gl.peak, lambda: {"name": "load.w"}),
        Call("check_units", gl.check_units, lambda: {"component": Drive()}),
        Call("register_method", gl.register_method, lambda: {"method": Idle()}),
        Call("modes", gl.modes, s),
        Call(
            "fit",
            gl.fit,
            lambda: {
                "system": system(),
                "data": gl.MeasuredResponse([1.0, 2.0], [1.0 - 1j, 0.2 - 0.4j], "torque.tau", "load.w"),
                "free": {"load.J": (0.1, 10.0)},
                "noise": 0.1,
                "parameters": {},
                "evaluations": 5,
            },
        ),
        Call(
            "MeasuredHistories",
            gl.MeasuredHistories,
            lambda: {
                "data": {"time": [0.0, 1.0], "load.w": [0.0, 1.0]},
                "inputs": {"torque.tau": 1.0},
                "start": {"load.w": 0.0},
                "noise": 0.1,
            },
        ),
        Call(
            "MeasuredResponse",
            gl.MeasuredResponse,
            lambda: {
                "omega": [1.0, 2.0],
                "values": [1.0, 0.5j],
                "input": "torque.tau",
                "output": "load.w",
                "noise": 0.1,
            },
        ),
        Call("MeasuredModes", gl.MeasuredModes, lambda: {"frequencies": [1.0], "damping": [0.1], "numbers": [0], "noise": 0.1}),
        Call(
            "MeasuredMargins",
            gl.MeasuredMargins,
            lambda: {
                "loop": ("torque.tau", "load.w"),
                "gain_margin_db": 6.0,
                "phase_margin": 40.0,
                "gain": 1.0,
                "noise": 0.1,
            },
        ),
        Call(
            "steady_state", gl.steady_state, lambda: {"system": system(), "outputs": ["load.w"], "inputs": {"torque.tau": 0.0}}
        ),
        Call("mobility", gl.mobility, s),
        Call("campbell", gl.campbell, lambda: {**s(), "speeds": [1.0, 2.0], "orders": [1.0]}),
        Call("power_flow", gl.power_flow, lambda: {**s(), "speeds": {"load.w": 1.0}}),
        Call("speed_ratio", gl.speed_ratio, lambda: {**s(), "driving": "motor.w", "driven": "load.w"}),
        Call("harmonic_balance", gl.harmonic_balance, lambda: {"system": oscillator(), "start": 1.5, "end": 0.5, **quick}),
        Call("frequency_response", gl.frequency_response, lambda: {"model": system(), "omega": [1.0, 2.0]}),
        Call("frequency_response of a model", gl.frequency_response, lambda: {"model": linear(), "omega": [1.0, 2.0]}),
        Call(
            "transmission_error_response",
            gl.transmission_error_response,
            lambda: {"system": meshed(), "omega": [1.0, 2.0]},
        ),
        Call("stability", gl.stability, m),
        Call("passivity", gl.passivity, s),
        Call("stability of a system", gl.stability, lambda: {"model": system()}),
        Call("order_spectrum", gl.order_spectrum, r),
        Call("order_waterfall", gl.order_waterfall, lambda: {**r(), "revolutions": 2}),
    ]


def files() -> list[Call]:
    """Functions that read and write files."""
    run().save(FOLDER / "r.mat", names=["load.w"])
    gl.save_parameters(FOLDER / "p.toml", {"load.J": 1.0})
    (FOLDER / "t.csv").write_text("time,tau\n0,1\n1,2\n", encoding="utf-8")
    return [
        Call("Table.read", gl.Table.read, lambda: {"path": FOLDER / "t.csv", "column": "tau"}),
        Call("Table.of", gl.Table.of, lambda: {"data": run().to_dataframe(["load.w"]), "column": "load.w"}),
        Call("Table.over", gl.Table([0.0, 1.0], [0.0, 1.0], outside="periodic").over, lambda: {"t0": 0.0, "t1": 5.0}),
        Call("load_result", gl.load_result, lambda: {"path": FOLDER / "r.mat"}),
        Call("read_modelica", gl.read_modelica, lambda: {"source": MODEL, "name": "M"}),
        Call(
            "to_modelica", gl.to_modelica, lambda: {"component": Drive(), "flat": True, "standard_library": False, "name": "M"}
        ),
        Call("load_parameters", gl.load_parameters, lambda: {"path": FOLDER / "p.toml"}),
        Call(
            "save_parameters",
            gl.save_parameters,
            lambda: {"path": FOLDER / "q.ssv", "parameters": {"load.J": 1.0}, "units": {}},
        ),
    ]


def plots() -> list[Call]:
    return [
        Call(name, getattr(gl, name), lambda: {"model": system(), "loop": LOOP})
        for name in ("bode_plot", "nichols_plot", "nyquist_plot", "root_locus_plot")
    ]


def formulas() -> list[Call]:
    """Functions of numbers."""
    return [
        Call("Table", gl.Table, lambda: {"t": [0.0, 1.0], "y": [0.0, 1.0]}),
        Call("Table2D", gl.Table2D, lambda: {"x": [0.0, 1.0], "y": [0.0, 1.0], "z": [[0.0, 1.0], [2.0, 3.0]]}),
        Call("Table2D()", gl.Table2D([0.0, 1.0], [0.0, 1.0], [[0.0, 1.0], [2.0, 3.0]]), lambda: {"x": 0.5, "y": 0.25}),
        Call("Table()", gl.Table([0.0, 1.0], [0.0, 1.0]), lambda: {"time": 0.5}),
        Call("offered", gl.offered, lambda: {"values": {"c": 1.0}}),
        Call("PreloadedBacklash", gl.PreloadedBacklash, lambda: {"c": 1.0, "b": 1.0, "preload": 0.5}),
        Call("PreloadedBacklash()", gl.PreloadedBacklash(1.0, 1.0, 0.5), lambda: {"x": 1.0}),
        Call("PreloadedBacklash.mean", gl.PreloadedBacklash(1.0, 1.0, 0.5).mean, lambda: {"amplitude": 1.0}),
        Call(
            "PreloadedBacklash.describing_function",
            gl.PreloadedBacklash(1.0, 1.0, 0.5).describing_function,
            lambda: {"amplitude": 1.0},
        ),
        Call("backlash_describing_function", gl.backlash_describing_function, lambda: {"amplitude": 1.0}),
        Call("equivalent_stiffness", gl.equivalent_stiffness, lambda: {"amplitude": 1.0, "c": 1.0, "b": 1.0}),
        Call("mesh_damping", gp.mesh_damping, lambda: {"zeta": 0.1, "c": 1e8, "J_a": 1.0, "r_a": 0.1, "J_b": 2.0, "r_b": 0.2}),
        Call("palmgren_friction", gp.palmgren_friction, lambda: {"d_m": 0.1, "f_0": 2.0, "viscosity": 1e-4}),
        Call("GearPair", gp.GearPair, lambda: {"z_1": 20, "z_2": 40, "m_n": 0.002, "width": 0.02}),
        Call("planet_positions", gp.planet_positions, lambda: {"Z_s": 19, "Z_r": 81, "planets": 3}),
        Call("cai_stiffness", gp.cai_stiffness, lambda: {"pair": gp.GearPair(20, 40, 0.002, 0.02, beta=0.2)}),
        Call(
            "cai_pair_stiffness",
            gp.cai_pair_stiffness,
            lambda: {"pair": gp.GearPair(20, 40, 0.002, 0.02, beta=0.2), "place": 0.3},
        ),
        Call("check_assembly", gp.check_assembly, lambda: {"owner": "set", "Z_s": 20, "Z_p": 20, "Z_r": 60, "planets": 4}),
        Call("planet_phasing", gp.planet_phasing, lambda: {"Z_s": 20, "Z_p": 20, "Z_r": 60, "planets": 4}),
        Call("from_bond_graph", gp.from_bond_graph, lambda: {"graph": _graph()}),
    ]


def methods() -> list[Call]:
    """Methods of what comes back."""
    s, r = system(), run()
    measured = gl.MeasuredResponse([1.0, 2.0], [-0.5j, -0.25j], "torque.tau", "load.w")
    fitted = gl.fit(s, measured, {"load.J": (0.1, 10.0)})
    modes, waterfall = gl.modes(s), gl.order_waterfall(r, "load.w", "load.phi", revolutions=2)
    spectrum, campbell = gl.order_spectrum(r, "load.w", "load.phi"), gl.campbell(s, [1.0, 2.0], [1.0])
    flow, response = gl.power_flow(gl.compile(Set()), {"sun.w": 1.0}), gl.frequency_response(s, [1.0, 2.0])
    cycle = gl.harmonic_balance(
        oscillator(), 1.5, 0.5, frequency="w", harmonics=1, samples=16, outputs=["x"], step=0.1, points=50
    )

    runs = s.sweep({"load.J": [1.0, 2.0]}, 0.1, samples=3, inputs={"torque.tau": 1.0})

    varied = s.simulate(0.1, samples=3, inputs={"torque.tau": 1.0}, sensitivities=["load.J"])

    def steps() -> gl.SteppedRun:
        return s.stepper(inputs={"torque.tau": 1.0}, method="rk")

    def animated(mode: Any, frames: Any = 2, degrees: Any = 40.0) -> None:
        modes.animate(mode, frames=frames, degrees=degrees)._draw_was_started = True  # else it warns that it was not drawn

    view = gp.ZhouCui2022(Z_s=19, Z_p=31, Z_r=81).gear_view("train.p_unit")

    toothed = gl.compile(gp.ZhouCui2022(tau_in=100.0, Z_s=19, Z_p=31, Z_r=81))

    def turning(interval: Any = 50.0) -> None:
        view.animate(interval)._draw_was_started = True

    return [
        Call("System.simulate", s.simulate, lambda: {"t_end": 0.1, "samples": 3}),
        Call("System.simulate with times", s.simulate, lambda: {"t_end": 0.1, "times": [0.0, 0.1], "start": {"load.w": 1.0}}),
        Call("System.simulate by rk", s.simulate, lambda: {"t_end": 0.1, "samples": 3, "method": "rk"}),
        Call("System.simulate by ida", s.simulate, lambda: {"t_end": 0.1, "samples": 3, "method": "ida"}),
        Call("System.simulate on", s.simulate, lambda: {"t_end": 10.1, "samples": 3, "start": (r, 10.0)}),
        Call("System.sweep", s.sweep, lambda: {"parameters": {"load.J": [1.0, 2.0]}, "t_end": 0.1, "samples": 3}),
        Call("Runs[]", runs.__getitem__, lambda: {"name": "load.w"}),
        Call("Runs.keys", runs.keys),
        Call("Runs.unit", runs.unit, lambda: {"name": "load.w"}),
        Call("Runs.to_xarray", runs.to_xarray),
        Call("Runs.to_dataframe", runs.to_dataframe),
        Call("System.linearize", s.linearize),
        Call("System.linearize sparsely", s.linearize, lambda: {"sparse": True}),
        Call("System.power_flow", s.power_flow, lambda: {"speeds": {"load.w": 1.0}}),
        Call("System.report", s.report, lambda: {"path": FOLDER / "report.html", "result": r}),
        Call("System.export_fmu", s.export_fmu, lambda: {"path": FOLDER / "drive.fmu", "outputs": ["load.w"]}),
        Call("Component.diagram", Drive().diagram, lambda: {"depth": 1}),
        Call("Component.scheme", Drive().scheme),
        Call(
            "Component.gear_view",
            gp.ZhouCui2022(Z_s=19, Z_p=31, Z_r=81).gear_view,
            lambda: {"part": "train.p_unit", "angle": 0.1},
        ),
        Call("GearView.animate", turning, lambda: {"interval": 50.0}),
        Call("System.stepper", s.stepper, lambda: {"t_start": 0.0, "inputs": {"torque.tau": 1.0}}),
        Call("SteppedRun[]", steps().__getitem__, lambda: {"name": "load.w"}),
        Call("SteppedRun.advance", lambda t: steps().advance(t), lambda: {"t": 0.1}),
        Call("SteppedRun.inputs", lambda value: steps().inputs.__setitem__("torque.tau", value), lambda: {"value": 1.0}),
        Call("SteppedRun.restore", lambda state: steps().restore(state), lambda: {"state": steps().state()}),
        Call("SteppedRun.state", lambda: steps().state()),
        Call("Result[]", r.__getitem__, lambda: {"name": "load.w"}),
        Call("in Result", r.__contains__, lambda: {"name": "load.w"}),
        Call(
            "Result.gear_view",
            toothed.simulate(0.01, samples=3).gear_view,
            lambda: {"part": "train.p_unit", "t": 0.005, "gears": gp.GearPair(20, 40, 0.002, 0.02).drawn_gears()},
        ),
        Call("Result.model_drawn", r.model_drawn),
        Call("Result.plot", r.plot, positional=lambda: ["load.w"]),
        Call("Result.plot_against", r.plot_against, lambda: {"x": "load.phi", "y": "load.w"}),
        Call("Result.plot_spectrum", r.plot_spectrum, lambda: {"name": "load.w"}),
        Call("Result.history", r.history, lambda: {"name": "load.w"}),
        Call("Result.to_dataframe", r.to_dataframe),
        Call("Result.energy_balance", r.energy_balance),
        Call(
            "Result.gradient", varied.gradient, lambda: {"weights": {"load.w": [1.0] * len(varied.time)}, "names": ["load.J"]}
        ),
        Call("Result.sensitivity", varied.sensitivity, lambda: {"name": "load.w", "parameter": "load.J"}),
        Call("Result.at", r.at, lambda: {"t": 1.0}),
        Call("Result.items", lambda: list(r.items())),
        Call("Result.keys", r.keys),
        Call("Result.record", r.record, lambda: {"names": ["load.w"]}),
        Call("Result.save", r.save, lambda: {"path": FOLDER / "r.csv", "names": ["load.w"]}),
        Call("Result.to_xarray", r.to_xarray, lambda: {"names": ["load.w"]}),
        Call("Result.unit", r.unit, lambda: {"name": "load.w"}),
        Call("Result.check_energy", r.check_energy),
        Call("Result.check_sampling", r.check_sampling, lambda: {"name": "load.w"}),
        Call("Modes.amplitudes", modes.amplitudes, lambda: {"mode": 0}),
        Call("Modes.animate", animated, lambda: {"mode": 0, "frames": 2}),
        Call("Modes.draw", modes.draw, lambda: {"mode": 0}),
        Call("Modes.motions", modes.motions, lambda: {"mode": 0}),
        Call("Modes.scheme", modes.scheme, lambda: {"mode": 0}),
        Call("Modes.shape", lambda mode, name: modes.shape(mode, name), lambda: {"mode": 0, "name": "load.w"}),
        Call("Modes.to_dataframe", modes.to_dataframe),
        Call("Fit.to_dataframe", fitted.to_dataframe),
        Call("Fit.plot", fitted.plot),
        Call("Fit[]", fitted.__getitem__, lambda: {"name": "load.J"}),
        Call("Modes.sensitivity", modes.sensitivity, lambda: {"parameter": "load.J"}),
        Call("FrequencyResponse.sensitivity", response.sensitivity, lambda: {"parameter": "load.J"}),
        Call("FrequencyResponse.sensitivities", response.sensitivities, lambda: {"parameters": ["load.J"]}),
        Call("StabilityReport.sensitivity", gl.stability(s).sensitivity, lambda: {"parameter": "load.J"}),
        Call("Campbell.plot", campbell.plot),
        Call("Campbell.to_dataframe", campbell.to_dataframe),
        Call("FrequencyResponse[]", response.__getitem__, lambda: {"key": ("load.w", "torque.tau")}),
        Call("FrequencyResponse.plot", response.plot),
        Call("FrequencyResponse.to_dataframe", response.to_dataframe),
        Call("OrderSpectrum.at", spectrum.at, lambda: {"order": 1.0}),
        Call("OrderSpectrum.plot", spectrum.plot),
        Call("OrderSpectrum.to_dataframe", spectrum.to_dataframe),
        Call("OrderWaterfall.plot", waterfall.plot),
        Call("PowerFlow[]", flow.__getitem__, lambda: {"name": "sun.flange_a"}),
        Call(
            "PowerFlow.willis",
            flow.willis,
            lambda: {"sun": "sun.flange_b", "ring": "ground.flange", "carrier": "carrier.flange_a"},
        ),
        Call("PowerFlow.sankey", flow.sankey),
        Call("PowerFlow.scheme", flow.scheme),
        Call("PowerFlow.speed_ladder", flow.speed_ladder, lambda: {"name": "1st gear", "other": {"2nd gear": flow}}),
        Call("PowerFlow.to_dataframe", flow.to_dataframe),
        Call("HarmonicBalance.amplitude", cycle.amplitude, lambda: {"output": "x"}),
        Call("HarmonicBalance.mean", cycle.mean, lambda: {"output": "x"}),
        Call("HarmonicBalance.phase", cycle.phase, lambda: {"output": "x"}),
        Call("HarmonicBalance.rms", cycle.rms, lambda: {"output": "x"}),
        Call("HarmonicBalance.plot", cycle.plot),
        Call("HarmonicBalance.waveform", cycle.waveform, lambda: {"output": "x", "point": 0}),
        Call("HarmonicBalance.to_dataframe", cycle.to_dataframe),
    ]


def language() -> list[Call]:
    """Declarations and expressions, on the symbols of a component."""
    leaf = Leaf()
    x, n = leaf.x, leaf.n
    one = {
        name: Call(name, getattr(gl, name), positional=lambda: [x])
        for name in ["acos", "asin", "atan", "cos", "cosh", "exp", "log", "sign", "sin", "sinh", "sqrt", "tan", "tanh"]
    }
    return [
        *one.values(),
        Call("atan2", gl.atan2, positional=lambda: [x, 2.0]),
        Call("Max", gl.Max, positional=lambda: [x, 2.0]),
        Call("Min", gl.Min, positional=lambda: [x, 2.0]),
        Call("And", gl.And, positional=lambda: [x > 1, x < 2]),
        Call("Or", gl.Or, positional=lambda: [x > 1, x < 2]),
        Call("Not", gl.Not, lambda: {"condition": x > 1}),
        Call("Piecewise", gl.Piecewise, positional=lambda: [(x, x > 1), (0, True)]),
        Call(
            "Piecewise of",
            lambda value, condition: gl.Piecewise((value, condition), (0, True)),
            lambda: {"value": x, "condition": x > 1},
        ),
        Call("der", gl.der, lambda: {"expression": x}),
        Call("pre", gl.pre, lambda: {"variable": n}),
        Call("holds", gl.holds, lambda: {"variable": n}),
        Call("equals", gl.equals, lambda: {"variable": n, "value": 1}),
        Call("initial", gl.initial),
        Call(
            "sample",
            lambda period, offset: solved(gl.When(gl.sample(period, offset), gl.Eq(n, 1))),
            lambda: {"period": 0.1, "offset": 0.0},
        ),
        Call("Sampled", sampled, lambda: {"function": lambda t, values: 0.0, "period": 0.1, "offset": 0.0}),
        Call("Table of a variable", lambda events: gl.Table([0, 1], [0, 1])(x, events=events), lambda: {"events": True}),
        Call("connect signals", gl.connect, positional=lambda: [x, leaf.y]),
        Call("no_event", gl.no_event, lambda: {"expression": x > 1}),
        Call("settled", gl.settled, lambda: {"expression": x}),
        Call("reinit", gl.reinit, lambda: {"state": x, "value": 1.0}),
        Call("connect", gl.connect, positional=lambda: [gp.Inertia(J=1.0).flange_a, gp.Inertia(J=1.0).flange_a]),
        Call("Connection", connected, lambda: {"ports": None}),
        Call("When", lambda *given: gl.When(*given), positional=lambda: [x > 1, gl.Eq(n, 1)]),
        Call(
            "When()",
            lambda condition, action: solved(gl.When(condition, action)),
            lambda: {"condition": x > 1, "action": gl.Eq(n, 1)},
        ),
        Call("Eq", lambda left, right: solved(gl.Eq(left, right)), lambda: {"left": leaf.y, "right": 1.0}),
        Call("Eq.residual", lambda left, right: gl.Eq(left, right).residual, lambda: {"left": leaf.y, "right": 1.0}),
        Call("Eq of a discrete", lambda right: solved(gl.When(x > 1, gl.Eq(n, right))), lambda: {"right": 1.0}),
        Call("Energy", lost, lambda: {"stored": 0, "heat": 1.0}),
        Call("Parameter", declared(gl.Parameter), lambda: {"default": 1.0}),
        *[Call(d.__name__, declared(d)) for d in (gl.Variable, gl.Input, gl.Discrete)],
        Call("Derivative", declared(gl.Derivative), lambda: {"of": "x"}),
        Call("Structural", declared(gl.Structural), lambda: {"default": 1}),
        Call("Potential", declared(gl.Potential)),
        Call("Flow", declared(gl.Flow)),
        Call("Connector", ported),
        Call("Component", empty),
    ]


def sampled(function: Any, period: Any, offset: Any) -> Any:
    class Governed(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.torque, self.load = gp.Torque(), gp.Inertia(J=1.0)
            self.law = gl.Sampled(function, period, inputs=[self.load.w], outputs=[self.torque.tau], offset=offset)
            return [gl.connect(self.torque.flange, self.load.flange_a)]

    return gl.simulate(Governed(), 0.1, samples=3)["load.w"]


def connected(ports: Any) -> Any:
    class Pair(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=1.0)
            return [gl.Connection((self.a.flange_b, self.b.flange_a) if ports is None else ports)]

    return gl.compile(Pair())


def solved(law: Any) -> Any:
    """The run of a component with one more equation."""

    class Made(Leaf):
        def equations(self) -> list[Any]:
            free = [] if isinstance(law, gl.Eq) else [gl.Eq(self.y, 0)]
            counted = [] if isinstance(law, gl.When) else [gl.When(self.x > 1, gl.Eq(self.n, 1))]
            return [gl.Eq(gl.der(self.x), 1), *free, *counted, law]

    return gl.simulate(Made(), 2.0, samples=3)


def lost(**given: Any) -> Any:
    class Made(Leaf):
        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), 1), gl.Eq(self.y, 0), gl.When(self.x > 1, gl.Eq(self.n, 1))]

        def energies(self) -> gl.Energy:
            return gl.Energy(**given)

    return gl.simulate(Made(), 1.0, samples=2).energy_balance()


lost.__signature__ = inspect.signature(gl.Energy)  # type: ignore[attr-defined]


def declared(kind: Any) -> Callable[..., Any]:
    """A function that declares something, and runs a component that has it."""

    def make(**given: Any) -> Any:
        free = {"y": gl.Variable("1")}

        def equations(self: Any) -> list[gl.Eq]:
            found = self.z
            return [gl.Eq(gl.der(self.x), 1), gl.Eq(self.y, found if isinstance(found, sympy.Expr) else 0)] + (
                [gl.Eq(found, 2)] if type(declaration) in (gl.Variable, gl.Potential, gl.Flow, gl.Discrete) else []
            )

        declaration = kind(**given)
        made: Any = type("Made", (gl.Component,), {"x": gl.Variable("1"), **free, "z": declaration, "equations": equations})
        return gl.simulate(made(), 1.0, samples=2)

    make.__signature__ = inspect.signature(kind)  # type: ignore[attr-defined]
    return make


def ported(description: Any = "", when: Any = None) -> Any:
    """A body with one more flange."""

    class Made(gp.Inertia):
        chosen = gl.Structural(False)
        third = gp.Flange(description, when="chosen" if when is None else when)

    return gl.compile(Made(J=1.0))


def empty(start: Any = None, guess: Any = None, nominal: Any = None, state: Any = None) -> Any:
    given = {k: v for k, v in {"start": start, "guess": guess, "nominal": nominal, "state": state}.items() if v is not None}

    class Made(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.body = gp.Inertia(J=1.0, **given)
            return []

    return gl.simulate(Made(), 1.0, samples=2)


def bond_graphs() -> list[Call]:
    made = _graph()
    equations = bg.state_equations(made)
    time = bg.RunTime(equations)
    states = [1.0]
    element = made.elements[0]
    one = lambda kind, name: lambda **given: bg.state_equations(_with(kind(**given)))  # noqa: E731

    def element_call(kind: Any) -> Call:
        function = one(kind, kind.__name__)
        function.__signature__ = inspect.signature(kind)  # type: ignore[attr-defined]
        return Call(kind.__name__, function, lambda: {"modulus": 2.0} if kind in (bg.TF, bg.GY) else {})

    return [
        *map(element_call, (bg.C, bg.I, bg.R, bg.Se, bg.Sf, bg.MSe, bg.MSf, bg.TF, bg.GY)),
        Call("One", bg.One),
        Call("Zero", bg.Zero),
        Call("BondGraph", bg.BondGraph, positional=lambda: [(1, bg.Se("tau"), bg.R("b"))]),
        Call("BondGraph named", lambda name: bg.BondGraph((1, bg.Se("tau"), bg.R("b")), name=name), lambda: {"name": "a"}),
        Call(
            "BondGraph of",
            lambda number, tail, head: bg.BondGraph((number, tail, head)),
            lambda: {"number": 1, "tail": bg.Se("tau"), "head": bg.R("b")},
        ),
        Call("BondGraph.at", made.at, lambda: {"element": element}),
        Call("BondGraph.element", made.element, lambda: {"number": 1}),
        Call("BondGraph.label", made.label, lambda: {"element": element}),
        Call("BondGraph.of_kind", made.of_kind, positional=lambda: [bg.R]),
        Call("assign_causality", bg.assign_causality, lambda: {"graph": made}),
        Call("state_equations", bg.state_equations, lambda: {"graph": made}),
        Call("StateEquations.latex", equations.latex),
        Call("energy_symbol", bg.energy_symbol, lambda: {"kind": "p", "bond": 1}),
        Call("rate_of", bg.rate_of, lambda: {"variable": sympy.Symbol("x")}),
        Call("draw", bg.draw, lambda: {"graph": made}),
        Call("RunTime", bg.RunTime, lambda: {"equations": equations}),
        Call(
            "RunTime.rhs",
            time.rhs,
            lambda: {"t": 0.0, "x": states, "u": [1.0] * len(time.inputs), "parameters": [1.0] * len(time.parameters)},
        ),
        Call("RunTime.matrices", time.matrices, lambda: {"parameters": [1.0] * len(time.parameters)}),
        Call("RunTime.bind", time.bind, lambda: {"parameters": [1.0] * len(time.parameters)}),
        Call(
            "RunTime.bond_variables",
            time.bond_variables,
            lambda: {"t": 0.0, "x": states, "u": [1.0] * len(time.inputs), "parameters": [1.0] * len(time.parameters)},
        ),
    ]


def _with(element: Any) -> bg.BondGraph:
    rotor = bg.One("rotor")
    if isinstance(element, (bg.TF, bg.GY)):
        return bg.BondGraph((1, bg.Se("tau"), rotor), (2, rotor, bg.I("J")), (3, rotor, element), (4, element, bg.R("b")))
    fourth = (4, element, rotor) if isinstance(element, (bg.Se, bg.Sf, bg.MSe, bg.MSf)) else (4, rotor, element)
    return bg.BondGraph((1, bg.Se("tau"), rotor), (2, rotor, bg.I("J")), (3, rotor, bg.R("b")), fourth)


def components() -> list[Call]:
    """The constructors of all parts; what they make is flattened."""
    calls = []
    for name in gp.__all__:
        kind = getattr(gp, name)
        if isinstance(kind, type) and issubclass(kind, gl.Component) and kind not in (gp.BondGraphPart, gp.FMU):
            calls.append(Call(name, _part(kind), taken=frozenset(kind._bindable) | {"start", "guess", "nominal", "state"}))
    path = gl.compile(Characteristic(), outputs=["tau"]).export_fmu(FOLDER / "part.fmu", kind="cs")
    calls.append(Call("FMU", gp.FMU, lambda: {"path": path, "speed": "w", "torque": "tau", "period": 1e-3}))
    return calls


def _part(kind: type[gl.Component]) -> Callable[..., Any]:
    needed = {
        n: min(2.0, d.max / 2) if isinstance(d, gl.Parameter) else 0.5
        for n, d in type(kind.__new__(kind))._bindable.items()  # a class may make one of its own models
        if getattr(d, "default", None) is NO_VALUE
    }
    needed |= {"r_p": 0.5} if {"r_p", "r_h"} <= set(needed) else {}

    def make(**given: Any) -> Any:
        class Model(gl.Component):
            def assemble(self) -> list[gl.Connection]:
                self.part = kind(**{**needed, **given})
                return []

        model = flatten(Model())
        return model.parameters.defaults.tolist()

    return make


GROUPS: dict[str, Callable[[], list[Call]]] = {
    "analyses": analyses,
    "files": files,
    "plots": plots,
    "formulas": formulas,
    "methods": methods,
    "language": language,
    "bond graphs": bond_graphs,
    "components": components,
}
