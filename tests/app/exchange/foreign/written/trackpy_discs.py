"""Three pictures of bright discs, the upper right of which rises; found and linked by trackpy, saved by pandas."""

import numpy as np
import trackpy

PLACES = [(x, y) for y in (20.0, 50.0, 80.0) for x in (20.0, 50.0, 80.0)]  # [px], y down


def picture(rise: float) -> np.ndarray:
    rows, columns = np.mgrid[:100, :100]
    light = np.zeros((100, 100))
    for x, y in PLACES:
        lifted = y - rise if (x, y) == (80.0, 20.0) else y
        light += np.exp(-((columns - x) ** 2 + (rows - lifted) ** 2) / 18.0)
    return (250.0 * light).astype(np.uint8)


trackpy.quiet()
found = trackpy.batch([picture(rise) for rise in (0.0, 1.5, 3.0)], diameter=13, minmass=500, processes=1)
trackpy.link(found, search_range=5).to_csv("trackpy_discs.csv")
