"""What analyses refuse: each wrong argument is named, with what was found and what was expected."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, GearlibError, NameLookupError

NAN = float("nan")
HUGE = 10**400  # a whole number that no float holds
VERY_HUGE = 10**5000  # and that Python does not even write
LOOP = ("torque.tau", "load.w")


class Drive(gl.Component):
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


@pytest.fixture(scope="module")
def system() -> gl.System:
    return gl.compile(Drive())


@pytest.fixture(scope="module")
def run(system: gl.System) -> gl.Result:
    return system.simulate(10.0, samples=501, method="exact", inputs={"torque.tau": 10.0})


def balance(system: Any, **options: Any) -> Any:
    return gl.harmonic_balance(system, 1.0, 2.0, **{"outputs": ["load.w"], **options})


ANALYSES: dict[str, Callable[[Any], Any]] = {
    "modes": gl.modes,
    "campbell": lambda s: gl.campbell(s, [1.0, 2.0], [1.0]),
    "mobility": gl.mobility,
    "power_flow": lambda s: gl.power_flow(s, speeds={"load.w": 1.0}),
    "speed_ratio": lambda s: gl.speed_ratio(s, "motor.w", "load.w"),
    "transmission_error_response": lambda s: gl.transmission_error_response(s, [1.0]),
    "harmonic_balance": balance,
    "frequency_response": lambda s: gl.frequency_response(s, [1.0]),
    "stability": gl.stability,
    "stability of a loop": lambda s: gl.stability(s, LOOP),
    "bode_plot": lambda s: gl.bode_plot(s, LOOP),
}


@pytest.mark.parametrize("analysis", ANALYSES)
def test_an_analysis_takes_a_compiled_system(analysis: str, run: gl.Result) -> None:
    for given, message in (
        (Drive(), r"expected a .*[sS]ystem.*, got the component Drive; compile it: gl\.compile\(Drive\(\.\.\.\)\)"),
        (Drive, r"got the component class Drive; make one and compile it: gl\.compile\(Drive\(\.\.\.\)\)"),
        (run, r"got the result of a run; give the system that was simulated"),
        (None, r"expected a .*[sS]ystem.*, got None"),
        (np.eye(2), r"expected a .*[sS]ystem.*, got a ndarray"),
    ):
        with pytest.raises(ArgumentError, match=message):
            ANALYSES[analysis](given)


def test_order_analysis_takes_a_result(system: gl.System) -> None:
    message = r"expected the result of a run, got a compiled system; simulate it first: system\.simulate\(t_end\)"
    with pytest.raises(ArgumentError, match=message):
        gl.order_spectrum(system, "load.w", "load.phi")  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match=r"got the component Drive; compile it"):
        gl.order_waterfall(Drive(), "load.w", "load.phi")  # type: ignore[arg-type]


OF_A_SYSTEM: list[tuple[Callable[[Any], Any], type[GearlibError], str]] = [
    (lambda s: gl.campbell(s, [1, 2], 3), ArgumentError, r"orders is 3; expected events for each revolution: a sequence of numbers"),
    (lambda s: gl.campbell(s, [1, 2], ["2"]), ArgumentError, r"orders is \['2'\]; expected events"),
    (lambda s: gl.campbell(s, [1, 2], [NAN]), ArgumentError, r"orders is \[nan\]; expected events"),
    (lambda s: gl.campbell(s, [1, 2], {"mesh": NAN}), ArgumentError, r"order mesh is nan; expected a finite number"),
    (lambda s: gl.campbell(s, [[1, 2]], [1.0]), ArgumentError, r"speeds is \[\[1, 2\]\]; expected an increasing sequence of two"),
    (lambda s: gl.campbell(s, ["1", "2"], [1.0]), ArgumentError, r"speeds is \['1', '2'\]; expected an increasing sequence"),
    (lambda s: gl.campbell(s, [1, HUGE], [1.0]), ArgumentError, r"speeds is \[1, 10000.* \.\.\.; expected an increasing"),
    (lambda s: gl.modes(s, at=np.ones(2)), ArgumentError, r"at is array.* expected start values by path, 'steady', or"),
    (lambda s: gl.frequency_response(s, [1], 3), ArgumentError, r"inputs is 3; expected a list of names, such as \['torque\.tau'\]"),
    (lambda s: gl.frequency_response(s, [1], [3]), NameLookupError, r"3 is not a name; names are strings, such as 'torque\.tau'"),
    (lambda s: gl.frequency_response(s, "1"), ArgumentError, r"omega is '1'; expected a sequence of finite numbers"),
    (lambda s: gl.frequency_response(s, [1j]), ArgumentError, r"omega is \[1j\]; expected a sequence of finite numbers"),
    (lambda s: gl.frequency_response(s, [-1.0]), ArgumentError, r"omega is \[-1\.0\]; expected .* not negative"),
    (lambda s: gl.transmission_error_response(s, [1], meshes=3), ArgumentError, r"meshes is 3; expected a list of names"),
    (
        lambda s: gl.transmission_error_response(s, [1], meshes={"torque.tau": NAN}), ArgumentError,
        r"the amplitude of torque\.tau in meshes is nan; expected a finite number, which may be complex",
    ),
    (lambda s: gl.stability(s, LOOP, gain="2"), ArgumentError, r"gain is '2'; expected a finite number"),
    (lambda s: gl.stability(s, LOOP, gain=NAN), ArgumentError, r"gain is nan; expected a finite number"),
    (lambda s: gl.stability(s, gain="2"), ArgumentError, r"gain is '2'; expected a finite number"),
    (lambda s: gl.stability(s, 5), ArgumentError, r"loop is 5; expected \(input, output\)"),
    (lambda s: gl.bode_plot(s, LOOP, gain=[1.0]), ArgumentError, r"gain is \[1\.0\]; expected a finite number"),
    (lambda s: gl.bode_plot(s, LOOP, axes=3), ArgumentError, r"axes is 3; expected 2 matplotlib Axes, such as .*subplots\(2\)"),
    (lambda s: gl.nichols_plot(s, LOOP, axes=[3]), ArgumentError, r"axes is \[3\]; expected matplotlib Axes"),
    (lambda s: gl.root_locus_plot(s, LOOP, gains=[NAN]), ArgumentError, r"gains is \[nan\]; expected an increasing sequence of"),
    (lambda s: gl.root_locus_plot(s, LOOP, gains=2.0), ArgumentError, r"gains is 2\.0; expected an increasing sequence of"),
    (lambda s: gl.power_flow(s, ["load.w"]), ArgumentError, r"speeds is \['load\.w'\]; expected a mapping of paths to numbers"),
    (lambda s: gl.power_flow(s, {"load.w": 1}, "x"), ArgumentError, r"torques is 'x'; expected a mapping of paths to numbers"),
    (lambda s: gl.power_flow(s, {"load.w": HUGE}), ArgumentError, r"speed load\.w is 1000.* \.\.\.; expected a finite number"),
    (lambda s: gl.power_flow(s, {3: 1.0}), NameLookupError, r"3 is not a name; names are strings"),
    (lambda s: gl.speed_ratio(s, "motor.w", "load.w", held=5), ArgumentError, r"held is 5; expected a list of names"),
    (lambda s: gl.speed_ratio(s, "motor.w", "load.w", held="load.w"), ArgumentError, r"held is 'load\.w'; .* \['load\.w'\]"),
    (lambda s: gl.speed_ratio(s, ["motor.w"], "load.w"), ArgumentError, r"driving is \['motor\.w'\]; expected a name"),
    (lambda s: balance(s, inputs=["x"]), ArgumentError, r"inputs is \['x'\]; expected a mapping of paths to numbers, or functions"),
    (lambda s: balance(s, inputs={"torque.tau": lambda p, w: "x"}), ArgumentError, r"torque\.tau returned 'x'; expected a number"),
    (lambda s: balance(s, turning=1.0), ArgumentError, r"turning is 1\.0; expected a mapping of states to periods of 2 pi"),
    (lambda s: balance(s, parameters=["x"]), ArgumentError, r"parameters is \['x'\]; expected a mapping of paths to numbers"),
    (lambda s: balance(s, guess=3), ArgumentError, r"guess is 3; expected a mapping of start values by path"),
    (lambda s: balance(s, outputs=3), ArgumentError, r"outputs is 3; expected a list of names"),
    (lambda s: balance(s, frequency=["x"]), ArgumentError, r"frequency is \['x'\]; expected a name"),
    (lambda s: balance(s, step=HUGE), ArgumentError, r"step is 1000.* \.\.\.; expected a finite number"),
    (lambda s: s.linearize(5), ArgumentError, r"inputs is 5; expected a list of names"),
    (lambda s: s.linearize([5]), NameLookupError, r"5 is not a name; names are strings, such as 'torque\.tau' \(in inputs\)"),
    (lambda s: s.linearize(outputs=5), ArgumentError, r"outputs is 5; expected a list of names"),
    (lambda s: s.simulate(HUGE), ArgumentError, r"t_end is 1000.* \.\.\.; expected a finite number of seconds"),
    (lambda s: s.simulate(VERY_HUGE), ArgumentError, r"t_end is a number of very many digits; expected a finite number of seconds"),
    (lambda s: s.simulate(1.0, start=np.ones(2)), ArgumentError, r"start is array.* expected a mapping of start values"),
    (lambda s: s.simulate(1.0, start={"load.w": HUGE}), ArgumentError, r"start of load\.w is 1000.*; expected a finite number"),
    (lambda s: s.simulate(1.0, inputs={"torque.tau": HUGE}), ArgumentError, r"input torque\.tau is 1000.*; expected a finite"),
    (lambda s: s.simulate(1.0, parameters={"load.J": HUGE}), ArgumentError, r"parameter load\.J is 1000.*; expected a finite"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "error", "message"), OF_A_SYSTEM, ids=[message for _, _, message in OF_A_SYSTEM])
def test_wrong_arguments_are_named(
    call: Callable[[Any], Any], error: type[GearlibError], message: str, system: gl.System
) -> None:
    with pytest.raises(error, match=message):
        call(system)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda r: gl.order_spectrum(r, "load.w", "load.phi", t_start="0"), r"t_start is '0'; expected a finite number of sec"),
        (lambda r: gl.order_spectrum(r, "load.w", "load.phi", t_end=[1]), r"t_end is \[1\]; expected a finite number of sec"),
        (lambda r: gl.order_spectrum(r, ["load.w"], "load.phi"), r"name is \['load\.w'\]; expected a name"),
        (lambda r: gl.order_spectrum(r, "load.w", ["load.phi"]), r"reference is \['load\.phi'\]; expected a name"),
        (lambda r: gl.order_waterfall(r, "load.w", "load.phi", overlap="x"), r"overlap is 'x'; expected a number from 0 to 0\.95"),
        (lambda r: r[["load.w"]], r"result\[\['load\.w'\]\]: expected one name, such as result\['load\.w'\]; to_dataframe\(names\)"),
        (lambda r: r.to_dataframe("load.w"), r"names is 'load\.w'; expected a list of names"),
        (lambda r: r.to_dataframe(3), r"names is 3; expected a list of names"),
    ],
)  # fmt: skip
def test_wrong_arguments_for_a_result_are_named(call: Callable[[Any], Any], message: str, run: gl.Result) -> None:
    with pytest.raises(ArgumentError, match=message):
        call(run)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: gl.backlash_describing_function("x"), r"amplitude is 'x'; expected positive numbers"),
        (lambda: gl.backlash_describing_function([0.0]), r"amplitude is \[0\.0\]; expected positive numbers"),
        (
            lambda: gl.backlash_describing_function([1, 2], [1, 2, 3]),
            r"have the shapes \(2,\) and \(3,\); expected one that fits",
        ),
        (lambda: gl.backlash_describing_function(1.0, NAN), r"mean is nan; expected finite numbers"),
        (lambda: gl.backlash_describing_function(1.0, c="x"), r"c is 'x'; expected a finite number"),
        (lambda: gl.backlash_describing_function(1.0, c_gap=1j), r"c_gap is 1j; expected a finite number"),
        (lambda: gl.backlash_describing_function(1.0, b=-1.0), r"b is -1\.0; expected a backlash that is not negative"),
        (lambda: gl.equivalent_stiffness(["x"], c=1.0, b=1.0), r"amplitude is \['x'\]; expected positive numbers"),
        (lambda: gl.equivalent_stiffness(1.0, [1.0], c=1.0, b=1.0), r"preload is \[1\.0\]; expected a finite force"),
        (lambda: gl.equivalent_stiffness(1.0, c=0.0, b=1.0), r"c is 0\.0; expected a positive stiffness"),
        (lambda: gl.equivalent_stiffness(1.0, c=1.0, b="1"), r"b is '1'; expected a backlash that is not negative"),
        (lambda: gl.PreloadedBacklash("x", 1.0, 1.0), r"c is 'x'; expected a positive stiffness"),
        (lambda: gl.PreloadedBacklash(1.0, -1.0, 1.0), r"b is -1\.0; expected a backlash that is not negative"),
        (lambda: gl.PreloadedBacklash(1.0, 1.0, NAN), r"preload is nan; expected a finite force"),
    ],
)
def test_wrong_numbers_of_a_backlash_are_named(call: Callable[[], Any], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        call()


def test_numbers_of_other_kinds_are_taken(system: gl.System) -> None:
    orders = gl.campbell(system, np.array([1, 2]), np.array([1, 2])).orders
    assert orders == {"1": 1.0, "2": 2.0}
    assert gl.speed_ratio(system, "motor.w", "load.w", held=()) == pytest.approx(1.0)
    assert system.simulate(np.int64(1), samples=2, method="exact", inputs={"torque.tau": 0.0}).time[-1] == 1.0


def test_the_response_of_a_transfer_function() -> None:
    import control

    response = gl.frequency_response(control.tf([1.0], [1.0, 1.0]), [1.0])
    np.testing.assert_allclose(response.values[0, 0], 1 / (1 + 1j), rtol=1e-14)
    with pytest.raises(
        ArgumentError, match=r"expected a System, StateSpace, TransferFunction or LinearModel, got a FrequencyResp"
    ):
        gl.frequency_response(control.frd([1.0], [1.0]), [1.0])


def test_wrong_keys_of_what_is_found_are_named(system: gl.System, run: gl.Result) -> None:
    found = gl.modes(system)
    for mode in ("1", 0.5, None, True, [0]):
        with pytest.raises(ArgumentError, match=r"there is no mode .*; there are \d+, from 0"):
            found.shape(mode, "load.w")  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match=r"the flange is \['load\.flange_a'\]; expected a name, such as 'motor\.flange_b'"):
        gl.power_flow(system, {"load.w": 1.0})[["load.flange_a"]]  # type: ignore[index]
    with pytest.raises(ArgumentError, match=r"expected response\[output\] or response\[output, input\]"):
        gl.frequency_response(system, [1.0])["load.w", "torque.tau", 1]  # type: ignore[index]
    with pytest.raises(ArgumentError, match=r"order is '1'; expected a finite number"):
        gl.order_spectrum(run, "load.w", "load.phi").at("1")  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match=r"decibels is 0; expected a positive range, dB"):
        gl.order_waterfall(run, "load.w", "load.phi", revolutions=2).plot(decibels=0)
