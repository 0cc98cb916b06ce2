import subprocess
import sys

import identification
from tests.refused import refused


def test_importing_the_package_imports_none_of_its_libraries() -> None:
    code = (
        "import identification, sys; "
        "print([name for name in ('numpy', 'scipy', 'pydantic') if name in sys.modules]); "
        "identification.nonlinear_mode; "
        "print('numpy' in sys.modules, 'pydantic' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split("\n")[:2] == ["[]", "True False"]


def test_every_public_name_is_there_and_no_module_hides_it() -> None:
    for name in identification.__all__:
        assert getattr(identification, name).__name__ == name
        assert name in dir(identification)
    with refused(AttributeError, "no-attribute-nonsense"):
        _ = identification.nonsense
