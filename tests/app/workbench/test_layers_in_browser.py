"""Layers of the picture in a real Chromium: drawing, opacity, colours and range; colours that differ for everybody."""

from base64 import b64decode
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect
from rodsight.recording.curve_layers.settling import STATUS_COLOURS
from rodsight.results.hdf5.store import load_results, origin_of, save_results

from tests.app.recording.fake_results import with_fringes
from tests.app.workbench.hand import go, idle, on_screen, opened
from tests.browser import read_picture

pytestmark = pytest.mark.screen
FRAME = 3  # a photograph with forces and motion; the stored run begins at photograph 2
LEGENDS = 200  # [px] to their right
PATIENCE = 600  # tenths of a second until what is drawn must be loaded
BOX = [-8, 416, 236, 606]  # [px] of the photograph around the walls of the stored run


def inspect(tab: Page) -> None:
    """Show the stored frame in the step Inspect, with its walls in view."""
    go(tab, "inspect")
    tab.evaluate(f"workbench.show({FRAME})")
    idle(tab)
    tab.wait_for_function("() => workbench.step.isLoaded(workbench)")
    tab.evaluate(f"workbench.stage.fit({BOX})")


@pytest.fixture
def tab(page: Page, solved: Path) -> Iterator[Page]:
    with opened(page, solved) as tab:
        tab.locator(".tile").first.click()
        idle(tab)
        inspect(tab)
        yield tab


def shown(tab: Page, **layers: dict | bool) -> np.ndarray:
    """The composed picture (h, w, 3) with these layers alone."""
    settings = {name: {"on": True, **(each if isinstance(each, dict) else {})} for name, each in layers.items()}
    tab.evaluate("""async (settings) => {
        const { layers, resetLayers, setLayer } = await import("/page/layers/settings.js");
        resetLayers();
        for (const name of Object.keys(layers)) setLayer(name, { on: false });
        for (const [name, values] of Object.entries(settings)) setLayer(name, values);
        workbench.stage.redraw();
    }""", settings)  # fmt: skip
    idle(tab)
    # Drawing requests the motions that the layers need; `wait_for_function` awaits nothing asynchronous.
    for _ in range(PATIENCE):
        png = tab.evaluate("""async () => {
            const { isLoaded } = await import("/page/layers/rods.js"), { step, stage } = workbench;
            const picture = stage.composed(), loaded = !step.isLoaded || step.isLoaded(workbench);
            return loaded && isLoaded() ? picture.toDataURL("image/png") : "";
        }""")  # fmt: skip
        if png:
            break
        tab.wait_for_timeout(100.0)
    return read_picture(b64decode(png.split(",")[1]))


def drawn(picture: np.ndarray) -> float:
    """Fraction of the picture beside the legends that is not empty."""
    return float((picture[:, LEGENDS:].max(axis=2) > 40).mean())


def light(picture: np.ndarray, empty: np.ndarray) -> float:
    """Sum of the picture over that of an empty one, beside the legends."""
    return float((picture.astype(float) - empty)[:, LEGENDS:].sum())


def test_every_layer_draws_something_of_its_own_and_less_with_less_opacity(tab: Page):
    empty = shown(tab)
    assert drawn(empty) == 0.0
    for name in ("photograph", "walls", "rods", "forces", "uncertainty", "contacts", "displacement", "strain"):
        full = shown(tab, **{name: {"since": "first"} if name in ("displacement", "strain") else True})
        assert drawn(full) > 0.002, name
        faint = shown(tab, **{name: {"opacity": 0.2, "since": "first"}})
        assert light(faint, empty) < 0.6 * light(full, empty), name
        assert not np.array_equal(full, empty)


def test_forces_have_the_range_of_the_recording_until_it_is_changed(tab: Page, solved: Path):
    results = load_results(solved / "runs" / "mine" / "results.h5")
    strong = np.concatenate([frame.fn for frame in results.frames])
    own = "import('/page/layers/network.js').then((n) => n.networkLegends(NET)[0])"
    net = f"fetch('/api/network', {{ method: 'POST', headers: {{ 'Content-Type': 'application/json' }}, body: JSON.stringify({{ at: workbench.project.at, frame: {FRAME} }}) }}).then((a) => a.json())"  # noqa: E501
    script = f"{net}.then((NET) => {own}).then((l) => [l.words, l.scale.low, l.scale.high])"
    words, low, high = tab.evaluate(script)
    assert words == "normal force, all frames"
    assert low == pytest.approx(0.5 * strong[strong > 0].mean(), rel=1e-3)
    assert high == pytest.approx(max(np.quantile(strong[strong > 0], 0.998), 4.0 * low), rel=1e-3)
    tab.keyboard.press("y")
    tab.locator(".layer", has=tab.locator("#layer-forces")).locator("summary").click()
    tab.fill("#layer-forces-high", "500")
    tab.keyboard.press("Enter")
    words, _, high = tab.evaluate(script)
    assert (words, high) == ("normal force, not as in the recording", 500.0)
    tab.fill("#layer-forces-high", "much")
    tab.keyboard.press("Enter")
    expect(tab.locator("#toast")).to_contain_text("much is not a number")
    tab.click("#layers-reset")
    assert tab.evaluate(script)[0] == "normal force, all frames"


def test_a_row_that_was_just_opened_stays_open_when_the_list_is_drawn_anew(tab: Page):
    tab.keyboard.press("y")
    assert tab.evaluate("""() => {
        const row = () => document.querySelector("details:has(#layer-forces-high)");
        row().querySelector("summary").click();
        document.getElementById("layer-contacts").click(); // within the same task: the row's event has not come yet
        return row().open;
    }""")


def test_bars_get_thinner_than_the_rods_when_they_are_enlarged(tab: Page):
    def widest(zoom: float) -> float:
        tab.evaluate(f"workbench.stage.fit(); workbench.stage.zoom({zoom})")
        return tab.evaluate("""() => new Promise((done) => {
            const c = new OffscreenCanvas(1, 1).getContext("2d"), { stage } = workbench;
            let most = 0;
            Object.defineProperty(c, "lineWidth", { set: (wide) => { most = Math.max(most, wide * stage.view.k); } });
            stage.window = [-1e9, -1e9, 1e9, 1e9];
            stage.draw(c, stage.view.k);
            done(most / stage.view.k);
        })""")  # fmt: skip

    assert widest(12.0) < 0.6 * widest(1.0)


def test_gamma_lightens_the_dark_and_the_stretch_uses_the_whole_range(tab: Page):
    plain = shown(tab, photograph=True)
    light = shown(tab, photograph={"gamma": 2.5})
    dark, bright = plain[..., 0] < 60, plain[..., 0] > 120
    assert light[dark].mean() > 1.4 * max(plain[dark].mean(), 1.0)
    assert light[bright].mean() < 255.0
    stretched = tab.evaluate("workbench.stage.picture.stretched()")
    picture = shown(tab, photograph=stretched)[..., 0]
    dim = tab.evaluate("workbench.step.dim")  # of all photographs below forces
    assert np.ptp(np.percentile(picture, (0.5, 99.5))) > max(0.93 * 255 * dim, 1.05 * np.ptp(plain[..., 0]))


# Machado, Oliveira & Fernandes, IEEE Trans. Vis. Comput. Graph. 15, 1291 (2009), severity 1, on linear sRGB.
DEFICIENCIES = {
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.3039]],
}
APART = 20.0  # CIE76 difference of two marks that mean different things


def seen_by(colours: list[str], matrix: list[list[float]]) -> np.ndarray:
    """CIELAB (k, 3) of colours as a person with a deficiency sees them."""
    rgb = np.array([[int(each[k : k + 2], 16) for k in (1, 3, 5)] for each in colours]) / 255.0
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    seen = np.clip(linear @ np.array(matrix).T, 0.0, 1.0)
    srgb = np.where(seen <= 0.0031308, 12.92 * seen, 1.055 * seen ** (1 / 2.4) - 0.055)
    return cv2.cvtColor(srgb[None].astype(np.float32), cv2.COLOR_RGB2LAB)[0]


@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_colours_of_every_layer_differ_for_everybody(tab: Page, scheme: Literal["dark", "light"]):
    tab.emulate_media(color_scheme=scheme)
    ramps, states, series, tones, classes, kinds = tab.evaluate("""async () => {
        const { look } = await import("/page/layers/colours.js"), { STATES } = await import("/page/layers/rods.js");
        const { TONES } = await import("/page/time/strip.js"), { colour } = await import("/page/dom.js");
        const series = [1, 2, 3, 4].map((n) => colour(`series-${n}`));
        const { CLASS_COLOURS } = await import("/page/steps/rods.js");
        const { PARTS } = await import("/page/parts/agreement.js");
        return [look.ramps, Object.values(STATES), series, TONES, CLASS_COLOURS, PARTS.map(([, , shade]) => shade)];
    }""")  # fmt: skip
    for name, matrix in {"all": np.eye(3).tolist(), **DEFICIENCIES}.items():
        for ramp, colours in ramps.items():
            lab = seen_by(colours, matrix)
            lightness = np.diff(lab[:, 0])
            assert (lightness > -0.6).all() or (lightness < 0.6).all(), (name, ramp)  # monotonic: read in grey
            ends = np.linalg.norm(lab[-1] - lab[0])
            assert ends > 2.5 * APART, (name, ramp)
        for group in (states, series, classes, kinds):
            lab = seen_by(group, matrix)
            apart = np.linalg.norm(lab[:, None] - lab[None], axis=2)[~np.eye(len(lab), dtype=bool)]
            assert apart.min() > APART, (name, group)
    # Those of the recording, which tests/app/recording/look/test_palette.py compares in every vision.
    assert tones == {status.name.lower(): "#" + bytes(shade[:3]).hex() for status, shade in STATUS_COLOURS.items()}


def test_marks_of_pairs_differ_by_shape_where_their_colours_may_not(tab: Page):
    inside = tab.evaluate("""async () => {
        const { drawMark, COLOURS } = await import("/page/parts/verdicts.js");
        return Object.fromEntries(Object.keys(COLOURS).map((kind) => {
            const c = Object.assign(document.createElement("canvas"), { width: 40, height: 40 }).getContext("2d");
            drawMark(c, 1, { point: [20, 20], normal: [1, 0] }, 50, kind);
            const painted = (x, y) => c.getImageData(x, y, 1, 1).data[3] > 128;
            return [kind, [painted(20, 20), painted(26, 20), painted(20, 26)]];
        }));
    }""")  # fmt: skip
    assert inside.pop("contact") == [True, True, False]
    assert inside.pop("no contact") == [True, False, True]
    assert inside.pop("unsure") == [True, False, False]
    assert inside == {kind: [False, False, False] for kind in ("detected", "undetected", "hidden")}


def test_another_photograph_is_drawn_coarsely_at_once_and_sharply_once_it_is_still(browser: Browser, solved: Path):
    context = browser.new_context(device_scale_factor=2)
    with opened(context.new_page(), solved) as tab:
        tab.locator(".tile").first.click()
        idle(tab)
        inspect(tab)
        tab.wait_for_function("() => workbench.stage.drawing.dense === 2")
        tab.evaluate("""() => {
            const { stage } = workbench, paint = stage.paint.bind(stage);
            globalThis.drawn = [];
            stage.paint = () => {
                paint();
                const { dense, canvas } = stage.drawing;
                if (!stage.waits()) drawn.push([workbench.frame, dense, canvas.width / stage.boxWidth]);
            };
        }""")
        tab.locator("#canvas").focus()
        tab.keyboard.press("ArrowLeft")
        tab.wait_for_function(f"() => drawn.some(([frame, dense]) => frame === {FRAME - 1} && dense === 2)")
        found = [[dense, wide] for frame, dense, wide in tab.evaluate("drawn") if frame == FRAME - 1]
        margins = 1.24  # of the stage are drawn
        assert found[0] == [1, pytest.approx(margins, abs=0.01)]
        assert found[-1] == [2, pytest.approx(2 * margins, abs=0.01)]
        count = tab.evaluate("workbench.stage.drawn")
        tab.wait_for_timeout(700.0)
        assert tab.evaluate("workbench.stage.drawn") <= count + 1  # nothing is drawn again and again
        tab.evaluate(
            "() => { drawn.length = 0; workbench.stage.zoom(3); }"
        )  # more than a former drawing is enlarged by
        tab.wait_for_function("() => drawn.some(([, dense]) => dense === 2)")
        assert tab.evaluate("drawn[0]")[1] == 1
    context.close()


def test_a_chosen_rod_shows_its_track(tab: Page):
    rods = tab.evaluate("workbench.step.rodsOfFrame()")
    card = tab.locator("#card")
    for place in zip(rods[0::3], rods[1::3], strict=True):
        tab.keyboard.press("Escape")
        before = shown(tab, marks=True)
        tab.mouse.click(*on_screen(tab, place))
        idle(tab)
        if "–" not in (card.locator(".fact").first.text_content() or "") and card.get_by_text("radius").count():
            break
    tab.wait_for_selector("#card canvas")
    after = shown(tab, marks=True)
    yellow = (after[..., 0] > 200) & (after[..., 1] > 190) & (after[..., 2] < 130)
    assert yellow.any()
    assert not ((before[..., 0] > 200) & (before[..., 1] > 190) & (before[..., 2] < 130)).any()
    assert not np.array_equal(before, after)


def test_the_mask_is_a_layer_of_the_photographs(tab: Page):
    go(tab, "photographs")
    tab.wait_for_function("() => workbench.stage.image !== null")
    tab.evaluate("workbench.change('set_photographs', { region: [0, 400, 100, 500] })")
    idle(tab)
    tab.wait_for_function("() => workbench.stage.image !== null")
    masked, whole = shown(tab, photograph=True, mask=True), shown(tab, photograph=True)
    assert masked.astype(float).sum() < 0.8 * whole.astype(float).sum()


def test_values_by_fringes_are_offered_and_drawn_only_where_the_run_has_them(tab: Page, solved: Path):
    """The choice of another run, which this one lacks, shows the shear strain."""
    fringed = {"by": "fringes", "since": "first"}
    assert drawn(shown(tab, strain=fringed)) > 0.002
    open_details(tab, "strain")
    expect(tab.locator("#layer-strain-by option[value=fringes]")).to_have_count(0)
    file = solved / "runs" / "mine" / "results.h5"
    save_results(file, with_fringes(load_results(file)), origin_of(file))
    tab.reload()
    idle(tab)
    inspect(tab)
    by_fringes, by_forces = (shown(tab, strain={**fringed, "by": name}) for name in ("fringes", "residual"))
    assert drawn(by_fringes) > 0.002
    assert not np.array_equal(by_fringes, by_forces)
    open_details(tab, "strain")
    expect(tab.locator("#layer-strain-by option[value=fringes]")).to_have_count(1)


def open_details(tab: Page, layer: str) -> None:
    """Open the list of layers and the row of one of them."""
    if not tab.locator("#layers-panel").is_visible():
        tab.locator("#layers-button").click()
    tab.evaluate(f"document.querySelector('#layers-panel details[data-layer={layer}]').open = true")
