"""An experiment is set up from flags as from the page; what fails leaves nothing behind."""

import cv2
import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment, read_grain_guess
from rodsight.workbench.setup import edits, found_walls

from tests.program import rodsight


@pytest.fixture
def folder(photographs_only):
    return photographs_only / "my photographs"


@pytest.mark.thorough
def test_a_wrong_value_gives_one_line_and_leaves_nothing(folder, capsys):
    flags = ("--photographs", "pictures/*.jpg", "--interval", "30", "--pixel-size", "2.5e-4")
    for wrong, named in (
        (("--pixel-size", "-1"), "pixel_size"), (("--photographs", "none/*.jpg"), "no file matches"),
        (("--friction", "slippery"), "material.friction"), (("--pressure", "top"), "WALL=PASCAL"),
        (("--radii", "7mm"), "--radii"), (("--interval", "0"), "interval"),
        (("--region", "1,2,3"), "--region"), (("--radius-range", "60:40"), "--radius-range"),
        (("--region", "30,30,20,20"), "region value"),
    ):  # fmt: skip
        assert rodsight("init", folder, *flags, *wrong) == 2, wrong
        message = capsys.readouterr().err
        assert named in message
        assert message.count("\n") == 1
        assert [each.name for each in folder.iterdir()] == ["pictures"], wrong


def test_an_experiment_that_is_there_is_not_overwritten(folder, capsys):
    file = folder / "experiment.toml"
    file.write_text("name = 'mine'\n")
    assert rodsight("init", folder, "--photographs", "pictures/*.jpg") == 2
    assert "is there already" in capsys.readouterr().err
    assert file.read_text() == "name = 'mine'\n"


@pytest.mark.slow
def test_a_new_folder_is_made_beside_the_photographs_and_goes_if_nothing_is_made(tmp_path, capsys):
    discs(tmp_path)
    flags = ("--photographs", "../shots/*.png", "--channel", "red", "--pixel-size", "1e-4", "--interval", "1")
    assert rodsight("init", tmp_path / "new", *flags, "--quiet") == 0
    assert load_experiment(tmp_path / "new").config.name == "new"
    assert rodsight("init", tmp_path / "other", "--photographs", "../none/*.png") == 2
    assert "no file matches" in capsys.readouterr().err
    assert not (tmp_path / "other").exists()
    assert rodsight("init", tmp_path / "no" / "such", *flags) == 2
    assert "cannot be created" in capsys.readouterr().err
    (tmp_path / "file").touch()
    assert rodsight("init", tmp_path / "file", *flags) == 2
    assert "is no folder" in capsys.readouterr().err


@pytest.mark.screen
def test_flags_make_an_experiment_and_a_picture(folder, made_photographs):
    section = load_experiment(made_photographs).config.photographs
    radii = ",".join(str(radius) for radius in section.radii)
    status = rodsight(
        "init", folder, "--photographs", "pictures/*.jpg", "--interval", 30, "--pixel-size", section.pixel_size,
        "--radii", radii, "--pressure", "top=50e3", "--friction", "measured", "--quiet",
    )  # fmt: skip
    assert status == 0
    made = load_experiment(folder).config
    assert made.walls.plates["top"].pressure == 50e3
    assert made.material.friction == "measured"
    assert rodsight("check", folder, "--quiet") == 0
    picture = cv2.imread(str(folder / "understood.png"))
    colourful = np.ptp(picture.astype(int), axis=2) > 60
    assert colourful.mean() > 0.01


def discs(folder, columns: int = 6, rows: int = 5, radius: float = 24.0, green: float = 0.0) -> None:
    """Three photographs of discs that stand out in the red channel, and by so much in green, in a hexagonal packing."""
    y, x = np.mgrid[: int(2 * radius * rows + 40), : int(2 * radius * (columns + 1) + 40)]
    red = np.full(x.shape, 40.0)
    for row in range(rows):
        for column in range(columns):
            at = 20 + radius * (1 + 2 * column + row % 2), 20 + radius * (1 + row * np.sqrt(3.0))
            depth = radius - 1.5 - np.hypot(x - at[0], y - at[1])
            red = np.maximum(red, 40.0 + 160.0 * np.clip(depth + 0.5, 0.0, 1.0))
    picture = np.stack([np.full(x.shape, 90.0), 90.0 + green * (red - 40.0) / 160.0, red], axis=2)
    rng = np.random.default_rng(0)
    (folder / "shots").mkdir(parents=True)
    for k in range(3):
        noise = rng.normal(0.0, 2.0, picture.shape)
        cv2.imwrite(str(folder / f"shots/{k}.png"), np.clip(picture + noise, 0, 255).astype(np.uint8))


@pytest.mark.thorough
def test_the_channel_that_shows_the_rods_is_found_with_known_radii_too(tmp_path):
    discs(tmp_path, green=-160.0 * 0.299 / 0.587)  # as light in grey as their surroundings
    flags = ("--photographs", "shots/*.png", "--interval", 5, "--pixel-size", 1e-4, "--walls", "none", "--quiet")
    assert rodsight("init", tmp_path, *flags, "--radii", 0.0024) == 0
    assert load_experiment(tmp_path).config.photographs.channel == "red"
    assert len((tmp_path / "grains.csv").read_text().splitlines()) - 1 == 30


@pytest.mark.thorough
def test_channel_region_outline_and_range_of_radii_are_used(tmp_path, capsys):
    discs(tmp_path)
    flags = ("--photographs", "shots/*.png", "--interval", 5, "--pixel-size", 1e-4, "--quiet")
    region = "0,0,330,279"
    assert rodsight(
        "init", tmp_path, *flags, "--channel", "red", "--region", region, "--follow", "outline",
        "--radius-range", "18:30", "--walls", "none",
    ) == 0  # fmt: skip
    section = load_experiment(tmp_path).config.photographs
    assert (section.channel, section.follow, section.region) == ("red", "outline", (0, 0, 330, 279))
    rows = (tmp_path / "grains.csv").read_text().splitlines()[1:]
    assert 26 <= len(rows) <= 30
    assert {round(float(row.split(",")[3])) for row in rows} <= {21, 22, 23}


@pytest.mark.thorough
def test_walls_that_cut_through_rods_are_left_out_and_named(tmp_path, capsys, monkeypatch):
    discs(tmp_path)
    lines = np.array([
        [[20.0, 262.0], [340.0, 262.0]], [[334.0, 262.0], [334.0, 18.0]], [[334.0, 18.0], [20.0, 18.0]],
        [[20.0, 18.0], [150.0, 262.0]],
    ])  # fmt: skip
    monkeypatch.setattr("rodsight.workbench.setup.walls.bars.find_walls", lambda *_: lines)
    monkeypatch.setattr(found_walls, "can_be_followed", lambda _, ends, *__: 2 * (ends[:, 0, 0] > -1,))
    flags = ("--photographs", "shots/*.png", "--interval", 5, "--pixel-size", 1e-4, "--channel", "red")
    assert rodsight("init", tmp_path, *flags, "--radius-range", "18:30") == 0
    printed = capsys.readouterr().out.replace("\n", " ")
    assert "'left' is left out, since it would cut through" in printed
    assert "left" not in (tmp_path / "walls.csv").read_text()
    assert "bottom" in (tmp_path / "walls.csv").read_text()


@pytest.mark.slow
def test_bars_without_texture_are_no_walls_but_impose_the_motion_of_the_outermost_rods(tmp_path, capsys):
    discs(tmp_path / "data")
    folder = tmp_path / "new"
    photographs = tmp_path / "data" / "shots" / "*.png"
    assert rodsight("init", folder, "--photographs", photographs, "--channel", "red", "--radius-range", "18:30") == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "show nothing by which they could be followed" in printed
    assert '([boundary] grains = "outer")' in printed
    assert "0.0001 m is assumed" in printed
    assert "1 s is assumed" in printed
    made = load_experiment(folder)  # a folder that was made for photographs elsewhere
    assert made.config.boundary.grains == "outer"
    assert made.config.walls is None
    assert not (folder / "walls.csv").exists()


def test_a_part_of_a_packing_has_no_walls_where_the_picture_ends(tmp_path, capsys):
    discs(tmp_path, columns=8, rows=8)
    for file in (tmp_path / "shots").glob("*.png"):
        picture = cv2.imread(str(file))
        cv2.imwrite(str(file), picture[60:-90, 48:-100])  # some of the discs with their centres outside
    flags = ("--photographs", "shots/*.png", "--channel", "red", "--radius-range", "18:30", "--follow", "outline")
    assert rodsight("init", tmp_path, *flags) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "goes on beyond the picture at 'bottom', 'right', 'top', 'left': no wall is there" in printed
    made = load_experiment(tmp_path)
    assert made.config.walls is None
    assert made.config.boundary.grains == "outer"
    assert 20 < len(read_grain_guess(made).id) < 64


def test_one_photograph_without_bars_has_no_walls(tmp_path, capsys):
    discs(tmp_path)
    flags = ("--photographs", "shots/0.png", "--channel", "red", "--radius-range", "18:30")
    assert rodsight("init", tmp_path, *flags) == 0
    assert "No bar is seen at 'bottom', 'right', 'top', 'left': the motion of the outermost" in capsys.readouterr().out
    assert load_experiment(tmp_path).config.boundary.grains == "outer"


def test_bars_that_are_seen_but_cannot_be_followed_impose_the_motion_of_the_outermost_rods(
    tmp_path, monkeypatch, capsys
):
    discs(tmp_path)
    monkeypatch.setattr(found_walls.bars, "shows_edge", lambda *_: True)
    monkeypatch.setattr(found_walls, "can_be_followed", lambda *_: np.zeros((2, 4), bool))
    flags = ("--channel", "red", "--radius-range", "18:30", "--follow", "outline")
    assert rodsight("init", tmp_path, "--photographs", "shots/*.png", *flags) == 0
    assert "show nothing by which they could be followed" in " ".join(capsys.readouterr().out.split())
    assert rodsight("init", tmp_path / "one", "--photographs", "../shots/0.png", *flags) == 0
    assert load_experiment(tmp_path / "one").config.walls is not None
    assert "No bar is seen" not in capsys.readouterr().out


def test_bars_need_some_rods(tmp_path, capsys):
    discs(tmp_path, columns=3, rows=2)
    flags = ("--photographs", "shots/*.png", "--channel", "red", "--radius-range", "18:30", "--quiet")
    assert rodsight("init", tmp_path, *flags) == 2
    assert "bars: cannot be found around 6 rods: at least 8 are needed" in capsys.readouterr().err


@pytest.mark.slow
def test_bars_that_do_not_hold_the_rods_do_not_end_the_set_up(tmp_path, capsys, monkeypatch):
    discs(tmp_path)
    lines = np.array([  # each runs the wrong way round
        [[340.0, 262.0], [20.0, 262.0]], [[334.0, 18.0], [334.0, 262.0]], [[20.0, 18.0], [334.0, 18.0]],
        [[20.0, 262.0], [20.0, 18.0]],
    ])  # fmt: skip
    monkeypatch.setattr("rodsight.workbench.setup.walls.bars.find_walls", lambda *_: lines)
    flags = ("--photographs", "shots/*.png", "--channel", "red", "--radius-range", "18:30")
    assert rodsight("init", tmp_path, *flags) == 0
    assert "The bars that were found do not hold the rods" in capsys.readouterr().out
    assert load_experiment(tmp_path).config.boundary.grains == "outer"


@pytest.mark.thorough
def test_a_folder_is_made_only_for_photographs_that_are_there_and_metres_need_a_scale(tmp_path, capsys):
    discs(tmp_path)
    new, there = tmp_path / "new", tmp_path / "shots"
    for flags, named in (
        (("--photographs", "shots/*.png"), "no file matches"),
        (("--photographs", there / "*.jpg"), "no file matches"),
        (("--photographs", there / "*.png", "--radii", "0.002"), "--pixel-size: is missing"),
        (("--photographs", there / "*.png", "--pressure", "top=5e3"), "--pixel-size: is missing"),
    ):
        assert rodsight("init", new, *flags) == 2
        assert named in capsys.readouterr().err
        assert not new.exists()


@pytest.mark.thorough
def test_defaults_choose_channel_and_following_and_state_what_they_saw(tmp_path, capsys):
    discs(tmp_path)
    flags = ("--photographs", "shots/*.png", "--interval", 5, "--pixel-size", 1e-4, "--walls", "none")
    assert rodsight("init", tmp_path, *flags) == 0
    section = load_experiment(tmp_path).config.photographs
    assert section.follow == "outline"  # plain discs: noise alone differs between photographs
    assert section.channel in ("red", "grey")
    assert len((tmp_path / "grains.csv").read_text().splitlines()) - 1 == 30
    printed = capsys.readouterr().out.replace("\n", " ")
    assert "light discs in" in printed
    assert "30 of 30 rods are followed to the second photograph" in " ".join(printed.split())


def labelled_discs(folder, radius: float = 24.0) -> np.ndarray:
    """The photographs of `discs` as a video, and the label image of their first one."""
    discs(folder, radius=radius)
    pictures = [cv2.imread(str(file)) for file in sorted((folder / "shots").iterdir())]
    height, width = pictures[0].shape[:2]
    writer = cv2.VideoWriter(str(folder / "test.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 2.0, (width, height))
    for picture in pictures:
        writer.write(picture)
    writer.release()
    red = pictures[0][..., 2]
    distance = cv2.distanceTransform((red > red.mean()).astype(np.uint8), cv2.DIST_L2, 5)
    _, labels = cv2.connectedComponents((distance > 3.0).astype(np.uint8))
    cv2.imwrite(str(folder / "labels.png"), labels.astype(np.uint16))
    return labels


@pytest.mark.thorough
def test_a_video_and_the_rods_of_another_program_make_an_experiment(tmp_path):
    labels = labelled_discs(tmp_path)
    camera = cv2.FileStorage(str(tmp_path / "camera.yml"), cv2.FILE_STORAGE_WRITE)
    camera.write("camera_matrix", np.array([[900.0, 0.0, 150.0], [0.0, 900.0, 130.0], [0.0, 0.0, 1.0]]))
    camera.write("distortion_coefficients", np.array([[-0.01, 0.0, 0.0, 0.0, 0.0]]))
    camera.release()
    status = rodsight(
        "init", tmp_path, "--photographs", "test.avi", "--pixel-size", 1e-4, "--interval", 0.5, "--walls", "none",
        "--lens", tmp_path / "camera.yml", "--grains", tmp_path / "labels.png", "--quiet",
    )  # fmt: skip
    assert status == 0
    made = load_experiment(tmp_path)
    section = made.config.photographs
    assert section.files == "test_frames/*.png"
    assert section.interval == pytest.approx(0.5)
    assert section.lens.k1 == -0.01
    assert len(made.photographs()) == 3
    assert len(read_grain_guess(made).id) == labels.max()


@pytest.mark.slow
def test_each_frame_of_a_time_lapse_is_a_photograph(tmp_path, capsys):
    labelled_discs(tmp_path)
    flags = ("--pixel-size", 1e-4, "--walls", "none", "--grains", tmp_path / "labels.png")
    assert rodsight("init", tmp_path, "--photographs", "test.avi", "--interval", 52.0, *flags) == 0
    made = load_experiment(tmp_path)
    assert len(made.photographs()) == 3
    assert made.config.photographs.interval == 52.0
    printed = " ".join(capsys.readouterr().out.split())
    assert "test.avi plays for 1.5 s, less than --interval 52: each of its 3 frames" in printed


def test_a_failure_leaves_no_frames_of_a_video(tmp_path, capsys):
    labelled_discs(tmp_path)
    before = sorted(tmp_path.iterdir())
    flags = ("--photographs", "test.avi", "--pixel-size", 1e-4, "--lens", tmp_path / "none.yml")
    assert rodsight("init", tmp_path, *flags) == 2
    assert "none.yml: there is no such file" in capsys.readouterr().err
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("sizes", "scatter", "odd", "expected"),
    [
        ((20.0, 30.0), 0.02, 4, [20.0, 30.0]),
        ((25.0,), 0.02, 4, [25.0]),
        ((20.0, 30.0), 0.02, 12, None),  # too many of no size
        ((20.0, 30.0), 0.4, 0, None),  # readings that scatter by more than the sizes are known
    ],
)
def test_sizes_that_nearly_all_rods_have_are_evident(sizes, scatter, odd, expected):
    rng = np.random.default_rng(4)
    radius = np.repeat(sizes, 60 // len(sizes)) + rng.normal(0.0, scatter, 60)
    radius[:odd] *= np.linspace(0.75, 0.95, odd)
    found = edits.evident_classes(radius)
    assert (None if found is None else [round(each, 1) for each in found.tolist()]) == expected


def test_a_continuous_law_of_radii_and_few_rods_have_no_evident_sizes():
    assert edits.evident_classes(np.linspace(20.0, 30.0, 60)) is None
    assert edits.evident_classes(np.full(10, 20.0)) is None


@pytest.mark.thorough
def test_rods_of_one_size_all_have_it(tmp_path, capsys):
    discs(tmp_path)
    flags = ("--photographs", "shots/*.png", "--interval", 5, "--pixel-size", 1e-4, "--walls", "none")
    assert rodsight("init", tmp_path, *flags) == 0
    stated = " ".join(capsys.readouterr().out.split())
    assert "The rods have one size, radius 2.251 mm in the photograph" in stated
    rows = (tmp_path / "grains.csv").read_text().splitlines()[1:]
    assert len({row.split(",")[3] for row in rows}) == 1


@pytest.mark.thorough
@pytest.mark.parametrize(("radius", "stated"), [(0.002255, ""), (0.00231, "% smaller than the known radii")])
def test_radii_that_the_rims_contradict_are_reported(tmp_path, capsys, radius, stated):
    discs(tmp_path)
    flags = ("--photographs", "shots/*.png", "--interval", 5, "--pixel-size", 1e-4, "--walls", "none")
    assert rodsight("init", tmp_path, *flags, "--radii", radius) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert stated in printed
    assert ("By their rims" in printed) == bool(stated)


@pytest.mark.thorough
@pytest.mark.parametrize("followed", [False, True])
def test_a_side_without_a_bar_leaves_the_others(folder, monkeypatch, capsys, followed):
    def shows_edge(image, line, rods):
        return bool(line[:, 1].mean() > 0.2 * image.shape[0])  # not at the top

    def can_be_followed(images, ends, *_):
        return 2 * (followed | (ends[:, :, 1].mean(axis=1) < 0.9 * ends[:, :, 1].max()),)

    monkeypatch.setattr(found_walls.bars, "shows_edge", shows_edge)
    monkeypatch.setattr(found_walls, "can_be_followed", can_be_followed)
    flags = (
        "--photographs",
        "pictures/*.jpg",
        "--interval",
        30,
        "--pixel-size",
        2.5e-4,
        "--radii",
        "0.007,0.008,0.011",
    )
    assert rodsight("init", folder, *flags) == 0
    # Paint that can be followed is a bar, whether its edge is seen or not.
    assert ("No bar is seen at 'top'" in " ".join(capsys.readouterr().out.split())) != followed
    rows = (folder / "walls.csv").read_text().splitlines()[1:]
    assert sorted({row.split(",")[1] for row in rows}) == ["bottom", "left", "right", *["top"] * followed]
