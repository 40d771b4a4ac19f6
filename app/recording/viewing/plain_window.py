"""The window of the viewer without its menus and buttons, for pictures of tabs.

Panels are hidden by the blueprint, and of nested rows of tabs only the tab in front stays; the others join the outer
row. The empty bar at the top, the outer row and the buttons in the titles of the views remain; they are removed from
the picture, their places follow from the relative sizes of the containers.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np

TOP_BAR = 65  # [px] height of the empty bar at the top of the window and of the row of tabs
TITLE = 27  # [px] height of the title of a view
BUTTONS = 82  # [px] width of the buttons at its right end
ICON = 27  # [px] width of the icon at its left end

Blueprint = dict[str, Any]  # parts by path
Box = tuple[float, float, float, float]  # left, top, width, height [px]


def without_panels(blueprint: Blueprint) -> Blueprint:
    """Hide all panels of a blueprint, and move the tabs of nested rows that are not in front to the root; return it."""
    for path, part in (
        ("/top_panel", "PanelBlueprint"), ("/blueprint_panel", "PanelBlueprint"),
        ("/selection_panel", "PanelBlueprint"), ("/time_panel", "TimePanelBlueprint"),
    ):  # fmt: skip
        blueprint.setdefault(path, {}).setdefault(part, {})["state"] = "Hidden"
    root = "/container/" + str(blueprint["/viewport"]["ViewportBlueprint"]["root_container"])
    for path, parts in blueprint.items():
        container = parts.get("ContainerBlueprint")
        if container is not None and path != root and container["container_kind"] == "Tabs":
            front = container.get("active_tab") or contents_of(container)[0]
            others = [each for each in contents_of(container) if each != front]
            blueprint[root]["ContainerBlueprint"]["contents"] += others
            container["contents"] = [front]
            if path_of(front).startswith("/container/"):  # a view alone has a title, which needs no row of tabs
                container["container_kind"] = "Vertical"
    return blueprint


def erase_buttons(picture: bytes, blueprint: Blueprint, tab: str) -> bytes:
    """Cut the bar at the top off a picture of the window (PNG) and erase the buttons in the titles of the views."""
    image = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    image = image[TOP_BAR:]
    height, width = image.shape[:2]
    for left, top, wide, _ in _view_boxes(blueprint, tab, (0.0, 0.0, float(width), float(height))):
        x, y, end = round(left), round(top), round(left + wide)
        colour = image[min(y + 4, height - 1), min(x + 4, width - 1)].copy()
        image[y : y + TITLE, x + 2 : x + ICON] = colour
        image[y : y + TITLE, end - BUTTONS : end - 2] = colour
    done, data = cv2.imencode(".png", image)
    assert done
    return data.tobytes()


def _view_boxes(blueprint: Blueprint, item: str, box: Box) -> Iterator[Box]:
    """Yield the boxes of all views below a container, each with its title."""
    container = blueprint[item].get("ContainerBlueprint")
    if container is None:
        yield box
        return
    children = [path_of(each) for each in contents_of(container)]
    kind, (left, top, width, height) = container["container_kind"], box
    count = len(children)
    columns = {"Horizontal": count, "Grid": int(container.get("grid_columns") or count)}.get(kind, 1)
    rows = 1 if kind == "Tabs" else -(-count // columns)
    across = _edges(container.get("col_shares"), columns)
    down = _edges(container.get("row_shares"), rows)
    for number, child in enumerate(children if kind != "Tabs" else children[:1]):
        row, column = divmod(number, columns)
        inner = (
            left + across[column] * width, top + down[row] * height, (across[column + 1] - across[column]) * width,
            (down[row + 1] - down[row]) * height,
        )  # fmt: skip
        yield from _view_boxes(blueprint, child, inner)


def _edges(shares: list[float] | float | None, count: int) -> np.ndarray:
    """Return the edges (count + 1,) of parts with these shares, from 0 to 1; equal ones where none are given."""
    given = np.ones(count) if shares is None or np.size(shares) != count else np.array(shares, np.float64, ndmin=1)
    return np.concatenate([[0.0], np.cumsum(given)]) / given.sum()


def contents_of(container: dict[str, Any]) -> list[str]:
    """Return the items of a container; the viewer gives a single one as a text."""
    contents = container["contents"]
    return [contents] if isinstance(contents, str) else contents


def path_of(item: str) -> str:
    """Return the blueprint path of a container's item, which is stored with or without a leading slash."""
    return "/" + item.lstrip("/")
