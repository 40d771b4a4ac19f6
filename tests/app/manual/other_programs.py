"""python -m tests.app.manual.other_programs FOLDER: the manual's pictures of OVITO and of ParaView's library.

FOLDER holds what `rodsight export vtk RUN --out FOLDER/vtk` and `rodsight export ovito RUN --out FOLDER/ovito` write.
Needs `pip install ovito vtk matplotlib pillow`, which neither Rodsight nor its tests install.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

PICTURES = Path(__file__).parents[3] / "app/docs/pictures"
FRAME, SIZE = 11, (1000, 800)
LINES = (2e-4, 2e-3)  # [m] radii of the weakest and the strongest force
STRONGEST = 303.0  # [N] as in the recording of the sample


def draw_paraview(folder: Path, target: Path) -> None:
    """Draw rods, walls and forces with ParaView's library: tubes as wide as f_n, dark where it is large."""
    import vtkmodules.vtkInteractionStyle
    import vtkmodules.vtkRenderingFreeType
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  # these three register what draws
    from vtkmodules import vtkFiltersCore, vtkIOImage, vtkRenderingAnnotation, vtkRenderingCore

    renderer, window = vtkRenderingCore.vtkRenderer(), vtkRenderingCore.vtkRenderWindow()
    renderer.SetBackground(1.0, 1.0, 1.0)
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    window.SetSize(*SIZE)
    window.AddRenderer(renderer)
    colours = _inferno()
    tubes = vtkFiltersCore.vtkTubeFilter()
    contacts = _read(folder, "contacts")
    contacts.GetPointData().SetActiveScalars("fn")
    tubes.SetInputData(contacts)
    tubes.SetRadius(LINES[0])
    tubes.SetRadiusFactor(LINES[1] / LINES[0])
    tubes.SetVaryRadiusToVaryRadiusByScalar()
    tubes.SetNumberOfSides(12)
    for source, colour in (
        (_discs(folder), (0.82, 0.82, 0.80)),
        (_read(folder, "walls"), (0.0, 0.0, 0.0)),
        (tubes, None),
    ):
        mapper, actor = vtkRenderingCore.vtkPolyDataMapper(), vtkRenderingCore.vtkActor()
        if hasattr(source, "GetOutputPort"):
            mapper.SetInputConnection(source.GetOutputPort())
        else:
            mapper.SetInputData(source)
        actor.SetMapper(mapper)
        if colour is None:
            mapper.SetLookupTable(colours)
            mapper.SetScalarRange(0.0, STRONGEST)
        else:
            mapper.ScalarVisibilityOff()
            actor.GetProperty().SetColor(*colour)
            actor.GetProperty().LightingOff()
            actor.GetProperty().SetLineWidth(3.0)
        renderer.AddActor(actor)
    bar = vtkRenderingAnnotation.vtkScalarBarActor()
    bar.SetLookupTable(colours)
    bar.SetTitle("fn [N]")
    bar.SetLabelFormat("%.0f")
    bar.SetOrientationToHorizontal()
    bar.SetPosition(0.2, 0.01)
    bar.SetWidth(0.6)
    bar.SetHeight(0.09)
    for text in (bar.GetTitleTextProperty(), bar.GetLabelTextProperty()):
        text.SetColor(0.0, 0.0, 0.0)
        text.ItalicOff()
        text.BoldOff()
        text.ShadowOff()
    renderer.AddViewProp(bar)
    camera = renderer.GetActiveCamera()
    camera.ParallelProjectionOn()
    left, right, bottom, top, *_ = _read(folder, "walls").GetBounds()
    camera.SetFocalPoint(0.5 * (left + right), 0.5 * (bottom + top) - 0.08 * (top - bottom), 0.0)
    camera.SetPosition(0.5 * (left + right), 0.5 * (bottom + top) - 0.08 * (top - bottom), 10.0)
    camera.SetParallelScale(0.62 * (top - bottom))
    renderer.ResetCameraClippingRange()
    window.Render()
    grab, writer = vtkRenderingCore.vtkWindowToImageFilter(), vtkIOImage.vtkPNGWriter()
    grab.SetInput(window)
    writer.SetInputConnection(grab.GetOutputPort())
    writer.SetFileName(str(target))
    writer.Write()


def _read(folder: Path, name: str) -> Any:
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    reader = vtkXMLPolyDataReader()
    reader.SetFileName(str(folder / "vtk" / f"{name}_{FRAME:04d}.vtp"))
    reader.Update()
    return reader.GetOutput()


def _discs(folder: Path) -> Any:
    """Return a disc for every rod, behind the forces."""
    from vtkmodules.vtkFiltersCore import vtkGlyph3D
    from vtkmodules.vtkFiltersSources import vtkRegularPolygonSource

    disc, glyphs, grains = vtkRegularPolygonSource(), vtkGlyph3D(), _read(folder, "grains")
    disc.SetNumberOfSides(48)
    disc.SetRadius(1.0)
    disc.SetCenter(0.0, 0.0, -1.0)
    grains.GetPointData().SetActiveScalars("radius")
    glyphs.SetInputData(grains)
    glyphs.SetSourceConnection(disc.GetOutputPort())
    glyphs.SetScaleModeToScaleByScalar()
    glyphs.SetScaleFactor(1.0)
    return glyphs


def _inferno() -> Any:
    from vtkmodules.vtkCommonCore import vtkLookupTable

    table, shades = vtkLookupTable(), _shades()
    table.SetNumberOfTableValues(len(shades))
    table.SetRange(0.0, STRONGEST)
    for row, shade in enumerate(shades):
        table.SetTableValue(row, *shade, 1.0)
    return table


def _shades() -> Any:
    """Return colours (256, 3) from pale to dark, for a white ground."""
    import numpy as np
    from matplotlib import colormaps

    return colormaps["inferno"](np.linspace(0.92, 0.0, 256))[:, :3]


def draw_ovito(folder: Path, target: Path) -> None:
    """Draw rods and forces with OVITO: lines in the colours of f_n."""
    from ovito.io import import_file
    from ovito.modifiers import ColorCodingModifier
    from ovito.vis import ColorLegendOverlay, LinesVis, TachyonRenderer, Viewport
    from PySide6.QtCore import Qt

    pipeline = import_file(str(folder / "ovito" / f"frame_{FRAME:04d}.vtm"))
    pipeline.add_to_scene()
    particles, (lines,) = pipeline.source.data.particles, pipeline.source.data.lines.values()
    particles.vis.radius = 1e-3
    look = lines.vis
    assert isinstance(look, LinesVis)
    look.enabled, look.width, look.shading, look.rounded_caps = True, 3e-3, LinesVis.Shading.Flat, True
    look.color_mapping_property, look.color_mapping_interval = "fn", (0.0, STRONGEST)
    look.color_mapping_gradient = ColorCodingModifier.Gradient(_shades())
    view = Viewport(type=Viewport.Type.Top)
    view.overlays.append(ColorLegendOverlay(
        color_mapping_source=look, title=" fn ", label1=f"\u2003{STRONGEST:.0f} N\u2003",  # the last sign may be cut
        alignment=Qt.AlignmentFlag.AlignHCenter ^ Qt.AlignmentFlag.AlignBottom,
        orientation=Qt.Orientation.Horizontal, legend_size=0.35, font_size=0.1,
    ))  # fmt: skip
    view.zoom_all(size=SIZE)
    view.fov *= 1.15
    view.render_image(filename=str(target), size=SIZE, background=(1.0, 1.0, 1.0), renderer=TachyonRenderer())


if __name__ == "__main__":
    given = Path(sys.argv[1])
    draw_paraview(given, PICTURES / "paraview.png")
    draw_ovito(given, PICTURES / "ovito.png")
