"""Pages that go on with files of other pages, or with programs of the firmware: which files, and of which page.

The other page is followed once in a run of the tests, in a folder of its own, and its files are copied.
"""

import contextlib
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

from joblib.externals.loky import get_reusable_executor

from tests.docs.pages import ROOT
from tests.docs.reader import Reader
from tests.firmware.building import built, built_with_loop
from tests.sharing import made_once, shared_folder

RECORDINGS = "docs/tutorials/recordings-to-prediction.md"
EXCITER, SWEEP, PNLSS = (
    f"docs/how-to/{name}.md" for name in ("identify-an-exciter", "predict-a-sweep", "identify-a-pnlss-model")
)
TAKES: dict[str, dict[str, tuple[str, ...]]] = {
    "docs/how-to/identify-a-linear-model.md": {RECORDINGS: ("modal.h5",)},
    "docs/how-to/identify-a-nonlinear-mode.md": {RECORDINGS: ("backbone.h5", "linear.h5")},
    "docs/how-to/combine-several-backbones.md": {RECORDINGS: ("linear.h5",)},
    "docs/how-to/predict-a-frequency-response.md": {RECORDINGS: ("mode.h5", "linear.h5", "sine.h5")},
    SWEEP: {RECORDINGS: ("mode.h5", "linear.h5"), EXCITER: ("exciter.h5",)},
    PNLSS: {RECORDINGS: ("backbone.h5",)},
    "docs/how-to/predict-with-a-pnlss-model.md": {
        PNLSS: ("low.h5", "pnlss.h5", "lines.h5"),
        SWEEP: ("sweep-test.toml", "sweep.h5"),
        EXCITER: ("exciter.h5",),
    },
    "docs/how-to/which-model.md": {RECORDINGS: ("backbone.h5",), EXCITER: ("exciter.h5",)},
    "docs/how-to/export-to-other-programs.md": {RECORDINGS: ("backbone.h5", "mode.h5")},
    "docs/how-to/write-a-report.md": {
        RECORDINGS: ("backbone.h5", "mode.h5"),
        "docs/how-to/reproduce-the-paper.md": ("look",),
    },
    "docs/how-to/run-a-parameter-study.md": {
        "docs/tutorials/a-rig-of-your-own.md": ("end-stop.toml",),
        "docs/how-to/make-a-specimen-scatter-or-wear.md": ("scatter.toml",),
    },
}

HOST = Path("firmware/build/host")
BUILT = {
    "docs/how-to/try-the-firmware.md": (HOST, lambda: built("host")),
    "docs/how-to/put-the-loop-on-a-board.md": (HOST, lambda: built_with_loop("host")),
}
"""Programs of the firmware that a page builds: where it finds them, and what builds them."""


def followed(page: str, needs: dict[str, Path]) -> Path:
    """Follow a page, named as in TAKES, once for all workers; return the folder in which that was done.

    A page of ``needs`` finds the file of this name and contents there.
    """
    return made_once(shared_folder() / "pages" / page.replace("/", "-"), lambda folder: _follow(page, needs, folder))


def _follow(page: str, needs: dict[str, Path], folder: Path) -> None:
    for name, file in needs.items():
        shutil.copyfile(file, folder / name)
    for source, names in TAKES.get(page, {}).items():
        for name in names:
            copy(followed(source, {}) / name, folder)
    if page in BUILT:
        place, program = BUILT[page]
        (folder / place).parent.mkdir(parents=True)
        shutil.copy(program(), folder / place)
    with alone_in(folder):
        Reader(ROOT / page).follow()


def copy(source: Path, folder: Path) -> None:
    """Copy a file or a folder into a folder."""
    if source.is_dir():
        shutil.copytree(source, folder / source.name)
    else:
        shutil.copy(source, folder)


@contextlib.contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """The folder is the present one and on the import path; neither its modules nor worker processes stay."""
    get_reusable_executor().shutdown()
    before = set(sys.modules)
    sys.path.insert(0, str(folder))
    try:
        with contextlib.chdir(folder):
            yield
    finally:
        sys.path.remove(str(folder))
        get_reusable_executor().shutdown()
        for name in set(sys.modules) - before:
            if str(getattr(sys.modules[name], "__file__", None)).startswith(str(folder)):
                del sys.modules[name]
