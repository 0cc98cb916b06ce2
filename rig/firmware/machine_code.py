"""Machine code of the tick for another processor, from the LLVM text that numba makes of the kernels."""

import hashlib
import re
from functools import cache
from typing import Any

import numpy as np

from rig.errors import ConfigurationError
from rig.firmware.header import DIGEST, SYMBOL, header
from rig.firmware.signature import Arguments, example
from rig.firmware.targets import Target
from rig.tick.kernels import tick_block
from vibrolock.compiled import compiled_text
from vibrolock.content_digest import content_digest

_ANY_ADDRESS = re.compile(r"((?:load|store) (?:i64|double)[ ,].*?, align) 1\b")
"""An access to a number of 64 bits that may lie at any address, as numba writes them for all records."""


@cache
def kernels_digest() -> str:
    """Return the digest of the tick: of its kernels and of the records that they take, 64 hexadecimal digits.

    A device tells the one that it was built with, a host compares it with its own. It differs between versions of Python, whose
    byte code it covers.
    """
    digest = hashlib.sha256(content_digest(tick_block).encode())
    digest.update(header(example(), "").encode())
    return digest.hexdigest()


def object_file(target: Target) -> bytes:
    """Return the object file of the tick for a target, with the symbols `SYMBOL` and `DIGEST`.

    Only machine code is made anew: LLVM has optimised the text for the host already, and what is computed in which order stays.
    Raises `ConfigurationError` if llvmlite has no back end for the target, or numba is told not to compile.
    """
    import llvmlite.binding as llvm

    machine = target.machine()
    text, name = _text()
    module = llvm.parse_assembly(_for_target(text, target, kernels_digest()))
    for function in module.functions:
        if not function.is_declaration:
            function.linkage = "external" if function.name == name else "internal"
    for variable in module.global_variables:
        if not variable.is_declaration and variable.name != DIGEST:
            variable.linkage = "internal"
    module.get_function(name).name = SYMBOL
    _drop_unused(module, machine)
    module.verify()
    return bytes(machine.emit_object(module))


@cache
def _text() -> tuple[str, str]:
    """Return the LLVM text of the tick with all that it calls, and the name of its function there."""
    import numba

    config: Any = numba.config
    if config.DISABLE_JIT:
        raise ConfigurationError(
            "there is no machine code of kernels that are not compiled", hint="unset NUMBA_DISABLE_JIT"
        )
    return compiled_text(tick_block, *example())


def _for_target(text: str, target: Target, digest: str) -> str:
    """Return the text for another processor, with the digest as a constant of its own."""
    text = re.sub(r'"target-(?:cpu|features)"="[^"]*"', "", text)
    text = re.sub(r'^target triple = ".*"', f'target triple = "{target.triple}"', text, flags=re.MULTILINE)
    if target.layout:
        text = re.sub(r'^target datalayout = ".*"', f'target datalayout = "{target.layout}"', text, flags=re.MULTILINE)
    if _all_in_place(example()):
        text = _ANY_ADDRESS.sub(r"\1 8", text)
    return f'{text}\n@{DIGEST} = constant [65 x i8] c"{digest}\\00"\n'


def _all_in_place(arguments: Arguments) -> bool:
    """Whether every number of 64 bits lies at a multiple of 8 bytes in arrays that begin at one."""
    return all(_in_place(array.dtype) for array in arguments.by_name().values())


def _in_place(dtype: np.dtype) -> bool:
    base = dtype.base
    if base.names is None:
        return True
    inner = [base.fields[name][:2] for name in base.names]  # type: ignore[index]  # it has names
    wide = any(_has_wide(kind) for kind, _ in inner)
    return not wide or (
        base.itemsize % 8 == 0 and all(_in_place(kind) and (not _has_wide(kind) or at % 8 == 0) for kind, at in inner)
    )


def _has_wide(dtype: np.dtype) -> bool:
    base = dtype.base
    if base.names is None:
        return base.str[1:] in ("f8", "i8", "c16")
    return any(_has_wide(base.fields[name][0]) for name in base.names)  # type: ignore[index]  # it has names


def _drop_unused(module: Any, machine: Any) -> None:
    """Remove what nothing calls: entries for Python and C, and kernels that are inlined wherever they are called."""
    import llvmlite.binding as llvm

    if hasattr(llvm, "create_new_module_pass_manager"):
        passes = llvm.create_new_module_pass_manager()
        passes.add_global_dead_code_eliminate_pass()
        passes.run(module, llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=0)))
    else:  # llvmlite below 0.45
        passes = llvm.create_module_pass_manager()
        passes.add_global_dce_pass()
        passes.run(module)
