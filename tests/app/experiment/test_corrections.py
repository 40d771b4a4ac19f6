"""A mistake in experiment.toml ends in one line with what to write instead."""

from __future__ import annotations

import re
import shutil

import pytest
from rodsight.experiment.config.corrections import read_quantity

from tests.app.experiment.tables import edit
from tests.program import rodsight

PRESSURE = "pressure = 50000.0"


@pytest.mark.parametrize(
    ("text", "unit", "number"),
    [
        ("50 kPa", "Pa", 50e3), ("50kpa", "Pa", 50e3), ("0,5 bar", "Pa", 50e3), ("5e4 N/m²", "Pa", 50e3),
        ("0.25 mm", "m", 0.25e-3), ("711 µm", "m", 711e-6), ("6 cm", "m", 0.06), ("60", "m", 60.0),
        ("2.7 g/cm^3", "kg/m³", 2700.0), ("30 min", "s", 1800.0), ("60 furlongs", "m", None), ("6 Mm", "m", None),
        ("much", "Pa", None), ("5 s", "Pa", None), ("", "Pa", None),
    ],
)  # fmt: skip
def test_a_quantity_is_converted_to_the_unit_of_its_key(text, unit, number):
    assert read_quantity(text, unit) == (None if number is None else pytest.approx(number))


@pytest.mark.parametrize(
    ("old", "new", "written"),
    [
        ("[walls.top]", "[walls.Top]", "write [walls.top]"),
        ("[walls.top]", "[walls.north]", "there are bottom, right, top, left"),
        (f"[walls.top]\n{PRESSURE}", 'top = "50 kPa"', "write [walls.top] and, below it, pressure = 50000.0"),
        (PRESSURE, 'pressure = "50 kPa"', "key walls.top.pressure: value '50 kPa'; walls.top.pressure is a number"),
        (PRESSURE, 'pressure = "50 kPa"', ": write pressure = 50000.0"),
        (PRESSURE, 'pressure = "50e3"', ": write pressure = 50000.0"),
        (PRESSURE, "pressure = [50e3]", ": write pressure = 50000.0"),
        (PRESSURE, "pressure = 50 kPa", "line 19: 'pressure = 50 kPa': write pressure = 50000.0"),
        (PRESSURE, "pressure: 50e3", "write pressure = 50e3"),
        (PRESSURE, f"{PRESSURE}\n{PRESSURE}", "this key is given twice"),
        ("length = 0.06", 'length = "6 cm"', ": write length = 0.06"),
        ("density = 2700.0", "density = 2700,0", "write density = 2700.0"),
        ("density = 2700.0", "density == 2700.0", "'density == 2700.0': write density = 2700.0\n"),
        ("density = 2700.0", "density := 2.7 g/cm3", ": write density = 2700.0\n"),
        ("density = 2700.0", "density = two", "'density = two': invalid value\n"),
        ("density = 2700.0", 'density = "2.7 g/cm³"', ": write density = 2700.0"),
        ("density = 2700.0", "density = 2.7", "number ≥ 10, ≤ 23000 (Density of the rods [kg/m³])"),
        ("density = 2700.0", "density = 2.7", ": write density = 2700.0"),
        ("density = 2700.0", "density = 2.7e6", ": write density = 2700.0"),
        ("density = 2700.0", "density = 0", "≥ 10, ≤ 23000"),
        ("\nfriction = 0.25", '\nfriction = "mesured"', ': write friction = "measured"'),
        ("\nfriction = 0.25", "\nfriction = measured", 'write friction = "measured"'),
        ("[material]", "[material", "write [material]"),
        ("[material]", "[material]\n[material]", "this section is given twice"),
        ("[walls]", "[wall]", "key wall: is not known: did you mean walls?"),
        ("[material]", '[boundary]\ngrains = "outter"\n[material]', 'write grains = "outer"'),
    ],
)
def test_a_mistake_is_named_with_what_to_write(tracked, capsys, old, new, written):
    edit(tracked / "experiment.toml", old, new)
    assert rodsight("check", tracked) == 2
    message = capsys.readouterr().err
    assert written in message
    assert message.count("\n") == 1
    assert "NAME" not in message


@pytest.mark.parametrize(
    ("given", "written"),
    [
        ("radii = 0.007", "write radii = [0.007]"),
        ('radii = "7, 8, 11 mm"', "write radii = [0.007, 0.008, 0.011]"),
        ('radii = ["7 mm"]', "write radii = [0.007]"),
        ('pixel_size = "0.25 mm"', "write pixel_size = 0.00025"),
        ('channel = "gray"', 'write channel = "grey"'),
        ("region = [1, 2, 3]", "photographs.region is a list of 4, each a whole number ≥ 0"),
    ],
)
def test_a_mistake_of_photographs_is_named_with_what_to_write(tmp_path, capsys, given, written):
    (tmp_path / "experiment.toml").write_text(f'name = "x"\n[photographs]\nfiles = "*.png"\ninterval = 1.0\n{given}\n')
    assert rodsight("check", tmp_path) == 2
    message = capsys.readouterr().err
    assert written in message
    assert message.count("\n") == 1


@pytest.mark.parametrize(
    ("radii", "named"),
    [
        ("[0.0001]", "are 0.4 px at this pixel_size, but must exceed 3 px: correct one of both"),
        ("[0.5]", "of the radii photographs.radii, 2e+03 px at this pixel_size: correct one of both"),
    ],
)
def test_radii_that_do_not_fit_the_photograph_are_named_in_pixels(made_photographs, tmp_path, capsys, radii, named):
    text = (made_photographs / "experiment.toml").read_text()
    shutil.copytree(made_photographs, tmp_path / "test", ignore=shutil.ignore_patterns(".*"))
    (tmp_path / "test/experiment.toml").write_text(re.sub(r"(?m)^radii = .*$", f"radii = {radii}", text))
    assert rodsight("check", tmp_path / "test") == 2
    message = capsys.readouterr().err
    assert named in message
    assert message.count("\n") == 1
