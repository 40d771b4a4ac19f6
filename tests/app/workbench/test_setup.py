"""An experiment is set up from photographs by requests; `rodsight check` reads the same files."""

import io
import shutil
import tomllib

import numpy as np
import pytest
from PIL import Image
from rodsight.experiment.experiment import load_experiment, read_grain_guess
from rodsight.experiment.reading.tables import read_table
from rodsight.experiment.scaling import make_scale
from rodsight.experiment.walls import read_walls
from rodsight.workbench.service import project
from rodsight.workbench.service.workbench import Workbench
from rodsight.workbench.setup.draft import Draft

from tests.app.workbench.conftest import Visitor
from tests.program import rodsight

RADII = [0.007, 0.008, 0.011]
BESIDE = 160.0  # [px] from a wall: on the table


@pytest.fixture
def begun(visitor):
    described = visitor.request("home")
    (series,) = described["series"]
    return visitor, visitor.request("begin", **{key: series[key] for key in ("folder", "suffix", "name")})


def marks(described):
    return {step["name"]: step["mark"] for step in described["steps"]}


def test_photographs_of_no_experiment_become_one(begun, photographs_only):
    visitor, described = begun
    assert described["files"] == ["DSC_7.jpg", "DSC_11.jpg", "DSC_15.jpg", "DSC_19.jpg"]
    assert (photographs_only / "my photographs" / "experiment.toml").is_file()
    assert visitor.request("home")["series"] == []
    assert marks(described) == {
        "photographs": "missing", "scale": "missing", "walls": "missing", "rods": "doubtful", "material": "doubtful",
    }  # fmt: skip


@pytest.mark.thorough
def test_the_quality_of_photographs_is_measured_once(begun, monkeypatch):
    visitor, described = begun
    measured: list[bool] = []
    measure = project.measure_photographs
    monkeypatch.setattr(
        project,
        "measure_photographs",
        lambda *what, **more: (measured.append(what[1] is None), measure(*what, **more))[1],
    )
    answer = visitor.request("quality", at=described["at"])
    assert answer["frame"] == [0, 1, 2, 3]
    assert "px wide" in answer["facts"][1]
    assert answer["faults"] == []
    visitor.request("set_photographs", at=described["at"], interval=30.0)  # changes nothing that is seen
    assert visitor.request("quality", at=described["at"]) == answer
    assert measured == [True]
    visitor.request("set_photographs", at=described["at"], region=[0, 0, 200, 200])
    visitor.request("quality", at=described["at"])
    visitor.request("detect_rods", at=described["at"], radii=[])
    assert "the position of a rod" in visitor.request("quality", at=described["at"])["facts"][1]
    assert measured == [True, True, False]


def test_every_step_is_undone_and_done_again(begun):
    visitor, described = begun
    at = described["at"]
    described = visitor.request("set_photographs", at=at, interval=30.0)
    assert marks(described)["photographs"] == "good"
    described = visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    assert marks(described)["scale"] == "good"
    assert marks(visitor.request("undo", at=at))["scale"] == "missing"
    assert marks(visitor.request("redo", at=at))["scale"] == "good"
    visitor.request("undo", at=at)
    visitor.request("undo", at=at)
    assert "no action left" in visitor.refused("undo", at=at)


def test_a_known_length_and_known_rods_set_the_scale(begun):
    visitor, described = begun
    at = described["at"]
    described = visitor.request("set_scale", at=at, line=[[10.0, 20.0], [410.0, 320.0]], metres=0.125)
    assert described["pixel"] == pytest.approx(2.5e-4)
    described = visitor.request(
        "set_scale", at=at, rods=[{"radius": 0.008, "pixels": 32.0}, {"radius": 0.011, "pixels": 44.0}]
    )
    assert described["pixel"] == pytest.approx(2.5e-4)
    assert "distance" not in described["photographs"]


def test_walls_stay_in_the_picture_when_the_scale_changes(begun):
    visitor, described = begun
    at = described["at"]
    visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    before = visitor.request("draw_wall", at=at, line=[[60.0, 300.0], [300.0, 310.0]], snap=False)["walls"]
    described = visitor.request("set_scale", at=at, pixel_size=5e-4)
    np.testing.assert_allclose(described["walls"][0]["line"], before[0]["line"], atol=1e-4)
    described = visitor.request("undo", at=at)
    assert described["pixel"] == pytest.approx(2.5e-4)
    np.testing.assert_allclose(described["walls"][0]["line"], before[0]["line"], atol=1e-4)


def test_a_lens_is_set_and_removed_and_walls_stay_in_the_picture(begun):
    visitor, described = begun
    at = described["at"]
    visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    visitor.request("draw_wall", at=at, line=[[20.0, 380.0], [300.0, 384.0]], name=None, snap=False)
    before = visitor.request("project", at=at)["walls"][0]["line"]
    lens = {"xc": 160.0, "yc": 200.0, "K1": 1e-7}
    described = visitor.request("set_lens", at=at, lens=lens)
    assert described["photographs"]["lens"] == lens
    assert marks(described)["scale"] == "good"
    assert np.abs(np.array(described["walls"][0]["line"]) - before).max() < 1e-3
    assert "fx" in visitor.refused("set_lens", at=at, lens={"k1": 0.1})
    assert visitor.request("project", at=at)["photographs"]["lens"] == lens  # a refused value leaves no trace
    assert "lens" not in visitor.request("set_lens", at=at, lens=None)["photographs"]
    assert visitor.request("undo", at=at)["photographs"]["lens"] == lens


def test_what_sensors_measured_at_walls_becomes_a_table(begun, photographs_only):
    visitor, described = begun
    at, folder = described["at"], photographs_only / "my photographs"
    visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    visitor.request("set_photographs", at=at, interval=30.0)
    table = "frame,wall,force\n" + "".join(f"{k},floor,{100 + k}\n" for k in range(4))
    assert "draw the walls" in visitor.refused("set_table", at=at, name="load", table=table)
    wall = visitor.request("draw_wall", at=at, line=[[20.0, 380.0], [300.0, 384.0]], snap=False)["wall"]
    visitor.request("rename_wall", at=at, name=wall, to="floor")
    described = visitor.request("set_table", at=at, name="load", table=table)
    assert described["tables"] == {"times": None, "load": "load.csv", "forces": None}
    assert (folder / "load.csv").read_text() == table
    walls = read_walls(load_experiment(folder), 4)
    assert walls.load[2, walls.name.index("floor")] == 102.0
    assert "no column force" in visitor.refused("set_table", at=at, name="load", table="frame,wall\n0,floor\n")
    assert "roof" in visitor.refused("set_table", at=at, name="load", table=table.replace("floor", "roof"))
    assert (folder / "load.csv").read_text() == table
    described = visitor.request("set_table", at=at, name="load", table=None)
    assert described["tables"]["load"] is None
    assert visitor.request("undo", at=at)["tables"]["load"] == "load.csv"


def test_uneven_times_come_as_a_table_in_place_of_the_interval(begun):
    visitor, described = begun
    at = described["at"]
    visitor.request("set_photographs", at=at, interval=30.0)
    assert "3 frames" in visitor.refused("set_table", at=at, name="times", table="frame,time\n0,0\n1,2\n2,5\n")
    described = visitor.request("set_table", at=at, name="times", table="frame,time\n0,0\n1,2\n2,5\n3,9\n")
    assert described["tables"]["times"] == "times.csv"
    assert "interval" not in described["photographs"]
    assert marks(described)["photographs"] == "good"
    assert visitor.request("undo", at=at)["photographs"]["interval"] == 30.0


def test_walls_need_the_scale_and_names_are_words(begun):
    visitor, described = begun
    at = described["at"]
    line = [[60.0, 300.0], [300.0, 310.0]]
    assert "scale" in visitor.refused("draw_wall", at=at, line=line)
    visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    described = visitor.request("draw_wall", at=at, line=line, snap=False)
    assert described["wall"] == "top" or described["wall"] == "bottom"
    assert "word" in visitor.refused("rename_wall", at=at, name=described["wall"], to="two words")
    described = visitor.request("rename_wall", at=at, name=described["wall"], to="plate")
    described = visitor.request("set_plate", at=at, name="plate", pressure=5e4)
    assert (described["walls"][0]["name"], described["walls"][0]["pressure"]) == ("plate", 5e4)
    described = visitor.request("delete_wall", at=at, name="plate")
    assert described["walls"] == []


def test_a_circle_is_a_wall_beside_bars_and_check_reads_it(begun, photographs_only):
    visitor, described = begun
    at = described["at"]
    visitor.request("set_photographs", at=at, name="mine", interval=30.0)
    visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    visitor.request("draw_wall", at=at, line=[[60.0, 300.0], [300.0, 310.0]], snap=False, name=None)
    x, y, r = 240.0, 260.0, 200.0
    points = [[x + r, y], [x, y + r], [x - r, y]]
    assert "line" in visitor.refused("draw_circle", at=at, points=[[0.0, 0.0], [50.0, 50.0], [100.0, 100.0]])
    described = visitor.request("draw_circle", at=at, points=points)
    ring = next(wall for wall in described["walls"] if wall["circle"])["circle"]
    assert (ring["x"], ring["y"], ring["radius"]) == pytest.approx((x, y, r), abs=1e-2)
    visitor.request("set_plate", at=at, name="circle", pressure=5e4)
    visitor.request("rename_wall", at=at, name="circle", to="drum")
    described = visitor.request("set_scale", at=at, pixel_size=5e-4)  # it stays where it is in the picture
    ring = next(wall for wall in described["walls"] if wall["circle"])
    assert (ring["name"], ring["pressure"]) == ("drum", 5e4)
    assert ring["circle"]["radius"] == pytest.approx(r, abs=1e-2)
    walls = read_walls(load_experiment(photographs_only / "my photographs"), 4)
    np.testing.assert_allclose(np.linalg.norm(walls.endpoints[0, 1, 1] - walls.endpoints[0, 1, 0]), 2.0 * r * 5e-4)
    bar = next(wall["name"] for wall in described["walls"] if not wall["circle"])
    visitor.request("delete_wall", at=at, name=bar)
    described = visitor.request("draw_circle", at=at, place=[x, y, 1.1 * r], name="drum", side="out")
    assert [wall["circle"]["side"] for wall in described["walls"]] == ["out"]
    assert described["walls"][0]["pressure"] == 5e4
    assert read_walls(load_experiment(photographs_only / "my photographs"), 4).count == 1
    described = visitor.request("delete_wall", at=at, name="drum")
    assert described["walls"] == []
    assert "walls" not in load_toml(photographs_only / "my photographs")


def test_settings_of_a_circle_are_removed_with_it_and_bars_stay(begun, photographs_only):
    visitor, described = begun
    at = described["at"]
    visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    visitor.request("draw_wall", at=at, line=[[60.0, 300.0], [300.0, 310.0]], snap=False, name=None)
    visitor.request("draw_circle", at=at, place=[240.0, 260.0, 200.0])
    visitor.request("set_plate", at=at, name="circle", pressure=5e4)
    described = visitor.request("delete_wall", at=at, name="circle")
    assert [wall["circle"] for wall in described["walls"]] == [None]
    assert load_toml(photographs_only / "my photographs")["walls"].keys() == {"file"}


def test_the_least_circle_holds_all_rods(begun, made_photographs, photographs_only):
    visitor, described = begun
    at = described["at"]
    visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    assert "rods" in visitor.refused("draw_circle", at=at)
    shutil.copy(made_photographs / "grains.csv", photographs_only / "my photographs")
    Draft(photographs_only / "my photographs").set_keys("rods", {"photographs.grains": "grains.csv"})
    described = visitor.request("draw_circle", at=at)
    ring, rods = described["walls"][0]["circle"], described["rods"]
    reach = np.hypot(np.array(rods["x"]) - ring["x"], np.array(rods["y"]) - ring["y"]) + np.array(rods["r"])
    assert reach.max() == pytest.approx(ring["radius"], rel=0.01)
    assert not any(
        "beyond" in text for step in described["steps"] for text in step["messages"] if step["name"] == "walls"
    )


def load_toml(folder):
    return tomllib.loads((folder / "experiment.toml").read_text())


@pytest.mark.thorough
def test_the_whole_set_up_gives_what_check_accepts(begun, made_photographs, photographs_only):
    visitor, described = begun
    at, truth = described["at"], load_experiment(made_photographs)
    section = truth.config.photographs
    visitor.request("set_photographs", at=at, name="mine", interval=section.interval)
    visitor.request("set_scale", at=at, pixel_size=section.pixel_size)
    described = visitor.request("detect_rods", at=at, radii=list(section.radii))
    true_rods = read_table(made_photographs / "grains.csv", ("x", "y"))
    assert len(described["rods"]["id"]) == len(true_rods)
    assert "still missing" in visitor.refused("prediction", at=at)
    described = visitor.request("find_walls", at=at)
    described = visitor.request("set_plate", at=at, name="top", pressure=5e4)
    described = visitor.request("set_material", at=at, density=2700.0, length=0.06, friction="measured")
    assert described["ready"]
    assert marks(described) == dict.fromkeys(("photographs", "scale", "walls", "rods", "material"), "good")
    folder = photographs_only / "my photographs"
    assert rodsight("check", str(folder), "--quiet") == 0
    predicted = visitor.request("prediction", at=at)
    assert any("noise" in each and "neighbours move" in each for each in predicted["messages"])
    assert predicted["mark"] in ("good", "doubtful")
    made = load_experiment(folder)
    scale = make_scale(made.config.photographs, truth.photographs().shape[0])
    assert_on_lines(scale, read_walls(made, 4), read_walls(truth, 4))
    guess = read_grain_guess(made)
    place = np.stack([true_rods.numbers("x"), true_rods.numbers("y")], axis=1)
    away = np.linalg.norm(np.stack([guess.x, guess.y], axis=1)[:, None] - place, axis=2).min(axis=1)
    assert away.max() < 0.5


def assert_on_lines(scale, found, true):
    """Every wall that was found lies on the true one of its name, to a pixel."""
    for name, ends in zip(found.name, found.endpoints[0], strict=True):
        a, b = scale.to_pixels(true.endpoints[0, true.name.index(name)])
        normal = np.array([b[1] - a[1], a[0] - b[0]]) / np.linalg.norm(b - a)
        assert np.abs((scale.to_pixels(ends) - a) @ normal).max() < 1.0


def test_rods_are_added_on_their_rims_moved_and_deleted(begun, made_photographs):
    visitor, described = begun
    at = described["at"]
    visitor.request("set_scale", at=at, pixel_size=load_experiment(made_photographs).config.photographs.pixel_size)
    table = read_table(made_photographs / "grains.csv", ("x", "y", "radius"))
    x, y, r = (float(table.numbers(name)[4]) for name in ("x", "y", "radius"))
    described = visitor.request("add_rod", at=at, x=x + 1.0, y=y - 1.0, radius=1.05 * r)
    rods = described["rods"]
    assert (rods["x"][0], rods["y"][0], rods["r"][0]) == pytest.approx((x, y, r), abs=0.6)
    described = visitor.request("move_rod", at=at, id=0, x=50.0, y=60.0, radius=20.0)
    assert (described["rods"]["x"], described["rods"]["r"]) == ([50.0], [20.0])
    described = visitor.request("delete_rods", at=at, ids=[0])
    assert described["rods"] is None
    assert "grains" not in described["photographs"]


def test_a_message_of_check_stands_at_its_step(begun, photographs_only):
    visitor, described = begun
    file = photographs_only / "my photographs" / "experiment.toml"
    file.write_text(file.read_text() + "interval = -3.0\n[material]\nfriction = 7.0\n[photograph]\nx = 1\n")
    described = visitor.request("project", at=described["at"])
    messages = {step["name"]: " ".join(step["messages"]) for step in described["steps"]}
    assert "photographs.interval" in messages["photographs"]
    assert "material.friction" in messages["material"]
    assert "did you mean photographs" in described["other_messages"][0]
    assert not described["ready"]


def test_what_somebody_else_writes_is_seen(begun, photographs_only):
    visitor, described = begun
    Draft(photographs_only / "my photographs").set_keys("elsewhere", {"photographs.interval": 12.0})
    assert marks(visitor.request("project", at=described["at"]))["photographs"] == "good"


def test_the_first_page_shows_photographs_that_wait(visitor):
    for query in ({"folder": "my photographs/pictures", "suffix": ".jpg"}, {}):
        answer = visitor.client.get("/thumbnail", params=query)
        assert (answer.status_code, answer.headers["Content-Type"]) == (200, "image/jpeg")
    assert visitor.client.get("/thumbnail", params={"folder": "elsewhere"}).status_code == 422


def test_the_first_of_them_stands_for_a_series(visitor, photographs_only):
    first = photographs_only / "my photographs" / "pictures" / "DSC_7.jpg"
    Image.new("L", (600, 400)).save(first)
    answer = visitor.client.get("/thumbnail", params={"folder": "my photographs/pictures", "suffix": ".jpg"})
    assert np.asarray(Image.open(io.BytesIO(answer.content))).max() < 10


def test_photographs_come_as_pictures_of_any_size(begun):
    visitor, described = begun
    answer = visitor.client.get("/photograph", params={"at": described["at"], "frame": 1, "size": 100})
    assert answer.headers["Content-Type"] == "image/jpeg"
    whole = visitor.client.get("/photograph", params={"at": described["at"], "frame": 1})
    assert len(whole.content) > len(answer.content) > 500
    assert visitor.client.get("/photograph", params={"at": described["at"], "frame": 99}).status_code == 422


def test_the_first_comment_of_an_experiment_stays(tmp_path):
    (tmp_path / "experiment.toml").write_text("# Mine.\n# Do not touch.\nname = 'a'\n")
    draft = Draft(tmp_path)
    draft.set_keys("name", {"name": "b", "photographs.files": "*.png"})
    assert draft.file.read_text().startswith("# Mine.\n# Do not touch.\nname = ")
    assert draft.data() == {"name": "b", "photographs": {"files": "*.png"}}
    draft.undo()
    assert draft.data() == {"name": "a"}


def test_a_wall_that_no_rod_touches_is_named_before_the_run(spoiled):
    visitor = Visitor(Workbench(spoiled)).enter()
    described = visitor.request("project", at="mine")
    assert marks(described)["walls"] == "good"
    (right,) = [wall["line"] for wall in described["walls"] if wall["name"] == "right"]
    described = visitor.request(
        "draw_wall", at="mine", name="right", line=[[x + BESIDE, y] for x, y in right], snap=False
    )
    (step,) = [step for step in described["steps"] if step["name"] == "walls"]
    assert step["mark"] == "doubtful"
    assert any(text.startswith("The packing has a free surface at the right") for text in step["messages"])
