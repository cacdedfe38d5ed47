"""What is printed fits 100 columns, and notebooks show tables and pictures."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gearlib as gl
import gearparts as gp
from gearlib.drawing.printed import COLUMNS, fitted, shortened


@settings(max_examples=25)
@given(
    st.text(st.characters(codec="utf-8", exclude_characters="\r\x0b\x0c\x1c\x1d\x1e\x85\u2028\u2029"), max_size=400),
    st.integers(20, 120),
)
def test_all_words_stay_and_lines_fit(text: str, columns: int) -> None:
    found = fitted(text, columns)
    assert all(len(line) <= columns for line in found.split("\n"))
    if max(map(len, text.split()), default=0) <= columns // 2:
        assert found.split() == text.split()


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("twenty letters fit in", "twenty letters fit\n  in"),
        ("twenty letters do fit", "twenty letters do\n  fit"),
        ("these twenty letters", "these twenty letters"),
        ("labels 2  one two three", "labels 2  one two\n          three"),  # a label of half the columns
        ("labels 10  one two three", "labels 10  one two\n  three"),  # a longer one
        ("  indented by two words and more", "  indented by two\n    words and more"),
        ("                  far to the right", "          far to the\n          right"),
        ("name  abcdefghijklmnopqrstuvwxyz", "name  abcde...uvwxyz"),
        ("  abcdefghijklmnopqrstuvwxyz rest", "    abcdef...tuvwxyz\n    rest"),
        ("xxxxxxxxxxxxxxxxxxxx y", "xxxxxxxxxxxxxxxxxxxx\n  y"),
        ("well-known words are-not-cut at hyphens", "well-known words\n  are-not-cut at\n  hyphens"),
    ],
)
def test_continued_lines_stand_under_the_text(line: str, expected: str) -> None:
    """Of their label, or two columns further in than their line, at most in the middle."""
    assert fitted(line, 20) == expected
    assert fitted(f"{line}\n{line}", 20) == f"{expected}\n{expected}"


@given(st.text(max_size=80), st.integers(10, 60))
def test_shortened_names_have_both_ends(name: str, columns: int) -> None:
    found = shortened(name, columns)
    assert len(found) <= columns
    assert found == name or (len(found) == columns and found[0] == name[0] and found[-1] == name[-1])


class LongNames(gl.Component):
    """Bodies in bodies in bodies, with long names."""

    class Housing(gl.Component):
        class Assembly(gl.Component):
            def assemble(self):
                self.first_intermediate_shaft_body, self.second_intermediate_shaft_body = gp.Inertia(J=1.0), gp.Inertia(J=2.0)
                self.torsionally_elastic_connection = gp.SpringDamper(c=1e4, d=1.0)
                self.pinion_of_the_final_drive = gp.IdealGear(ratio=-3.0)
                self.crown_wheel_with_the_differential = gp.Inertia(J=3.0)
                return [
                    gl.connect(self.first_intermediate_shaft_body.flange_b, self.torsionally_elastic_connection.flange_a),
                    gl.connect(self.torsionally_elastic_connection.flange_b, self.second_intermediate_shaft_body.flange_a),
                    gl.connect(self.second_intermediate_shaft_body.flange_b, self.pinion_of_the_final_drive.flange_a),
                    gl.connect(self.pinion_of_the_final_drive.flange_b, self.crown_wheel_with_the_differential.flange_a),
                ]

        def assemble(self):
            self.assembly_of_the_intermediate_shafts = self.Assembly()
            return []

    def assemble(self):
        self.housing_of_the_main_gearbox = self.Housing()
        inner = self.housing_of_the_main_gearbox.assembly_of_the_intermediate_shafts
        self.driving_torque_of_the_motor, self.braking_torque_of_the_machine = gp.Torque(), gp.Torque()
        return [
            gl.connect(self.driving_torque_of_the_motor.flange, inner.first_intermediate_shaft_body.flange_a),
            gl.connect(self.braking_torque_of_the_machine.flange, inner.crown_wheel_with_the_differential.flange_b),
        ]


@pytest.fixture(scope="module")
def shown():
    inner = "housing_of_the_main_gearbox.assembly_of_the_intermediate_shafts"
    torques = {"driving_torque_of_the_motor.tau": 1.0, "braking_torque_of_the_machine.tau": 2.9}
    system = gl.compile(LongNames())
    run = system.simulate(0.1, samples=11, inputs=torques)
    flow = system.power_flow(
        speeds={f"{inner}.first_intermediate_shaft_body.w": 10.0}, torques={"driving_torque_of_the_motor.tau": 1.0}
    )
    loop = ("driving_torque_of_the_motor.tau", f"{inner}.crown_wheel_with_the_differential.w")
    response = gl.frequency_response(system, [1.0, 2.0], [loop[0]], [loop[1]])
    xp = gl.compile(gp.ZhouCui2022())
    return {
        "Result": run, "Modes": gl.modes(system), "System": system, "Component": LongNames(), "PowerFlow": flow,
        "StabilityReport": gl.stability(system, loop=(loop[0], f"{inner}.first_intermediate_shaft_body.w")),
        "EnergyBalance": run.energy_balance(), "FrequencyResponse": response,
        "Campbell": gl.campbell(system, [0.0, 100.0], {"an excitation with a long name": 3.0}), "XP modes": gl.modes(xp),
        "XP stability": gl.stability(xp), "XP flow": xp.power_flow(torques={"tau_in": 1.0, **dict.fromkeys(
            ["e_rate_ring", "e_rate_sun", "e_rate_pair"], 0.0)}), "XP": xp,
    }  # fmt: skip


def test_print_fits(shown) -> None:
    texts = {name: str(thing) for name, thing in shown.items()}
    for name, text in texts.items():
        assert max(map(len, text.split("\n"))) <= COLUMNS, (name, max(text.split("\n"), key=len))


def test_notebooks_show_tables_and_pictures(shown) -> None:
    for name in (
        "Result",
        "Modes",
        "System",
        "Component",
        "StabilityReport",
        "PowerFlow",
        "XP modes",
        "XP stability",
        "XP flow",
    ):
        root = ET.fromstring(f"<div>{shown[name]._repr_html_()}</div>")
        assert len(root), name
    assert "<table>" in shown["Modes"]._repr_html_()
    assert "<svg" in shown["Component"]._repr_html_()
    rows = ET.fromstring(f"<div>{shown['StabilityReport']._repr_html_()}</div>").findall(".//tbody/tr")
    assert len(rows) == len(shown["StabilityReport"].eigenvalues)
    frequencies = ET.fromstring(f"<div>{shown['Modes']._repr_html_()}</div>").findall(".//tbody/tr/td[2]")
    assert np.allclose([float(f.text) for f in frequencies], shown["Modes"].frequencies, rtol=1e-5, atol=1e-9)


def test_a_component_that_cannot_be_assembled_says_why() -> None:
    class Broken(gl.Component):
        """A component with a slip."""

        def assemble(self):
            return [1]

    assert "must return a list of connect" in Broken()._repr_html_()
