"""
A report of a test
==================

One HTML file with everything on a recording: who, which bench and sensors, the plan, every point with its quality, figures. The
same from Python as ``rig report`` makes.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import identification
import rig
from rig.report.report import write_report
from rig.results.files import save

with TemporaryDirectory() as folder:
    recording, model, page = (Path(folder) / name for name in ("backbone.h5", "model.h5", "report.html"))
    run = rig.run("magnet-beam/backbone-short", output=recording, operator="A. Tester", notes=["first assembly"])
    mode = identification.nonlinear_mode(run.backbone())
    save(mode, model)
    write_report([recording, model], page, title="Magnet beam, first assembly")
    print(f"{page.name}: {page.stat().st_size / 1024:.0f} kB, {page.read_text().count('<svg')} figures")

# %%
# The figures in it are those of ``rig plot`` and of ``plot``.

mode.plot()
