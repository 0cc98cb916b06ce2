"""`import vibrolock` leads to what is installed with it, and loads none of it."""

import subprocess
import sys

import pytest

import vibrolock


def test_its_packages_are_names_of_it_and_are_imported_on_use():
    code = (
        "import sys, vibrolock; before = set(sys.modules); assert not before & {'rig', 'identification', 'numpy', 'numba'};"
        "import rig; assert vibrolock.rig is rig; assert vibrolock.identification.__name__ == 'identification'"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    assert {"rig", "identification", "controller", "simulators", "__version__"} <= set(dir(vibrolock))
    assert "vibrolock.rig" in (vibrolock.__doc__ or "")


def test_a_name_that_is_none_of_them_is_told_which_there_are():
    with pytest.raises(
        AttributeError, match=r"no attribute 'nothing'; allowed: rig, identification, controller, simulators$"
    ):
        vibrolock.nothing  # noqa: B018
