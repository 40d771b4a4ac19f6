"""Five slightly inclined rods seen end on, the last of which rises and is hidden at the end; saved by RodTracker."""

import sys
from pathlib import Path

import pandas as pd
from PyQt5 import QtWidgets
from RodTracker.backend import rod_data

PLACES = [(40.0, 80.0), (70.0, 80.0), (100.0, 80.0), (55.0, 54.0), (85.0, 54.0)]  # [px], y down

rows = []
for frame in (500, 501, 502):
    for k, (x, y) in enumerate(PLACES):
        last = k == len(PLACES) - 1
        lifted = y - 1.5 * (frame - 500) if last else y
        hidden = last and frame == 502
        ends = [-1.0] * 4 if hidden else [x - 3.0, lifted - 2.0, x + 3.0, lifted + 2.0]
        names = [f"{axis}{end}_{camera}" for camera in ("gp3", "gp4") for end in (1, 2) for axis in "xy"]
        observed = {"seen_gp3": int(not hidden), "seen_gp4": int(not hidden)}
        rows.append(
            {**dict(zip(names, 2 * ends, strict=True)), **observed, "particle": k, "frame": frame, "color": "black"}
        )

application = QtWidgets.QApplication(sys.argv)  # QT_QPA_PLATFORM=offscreen
rods = rod_data.RodData()
rods.add_data(pd.DataFrame(rows))
rods.threads.waitForDone()
rods.set_out_folder("saved")
rods.save_changes()
Path("saved/rods_df_black.csv").rename("rodtracker_rods.csv")
Path("saved").rmdir()
