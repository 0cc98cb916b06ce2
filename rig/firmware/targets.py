"""Processors for which the tick is compiled."""

import platform
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rig.errors import ConfigurationError

if TYPE_CHECKING:
    from llvmlite.binding import TargetMachine

ARM_LAYOUT = "e-m:e-p:32:32-Fi8-i64:64-v128:64:128-a:0:32-n32-S64"
"""Of the ABI of 32-bit ARM (AAPCS), in LLVM's words: little end first, pointers of 32 bits, numbers of 64 bits at 8 bytes."""


@dataclass(frozen=True)
class Target:
    """A processor as LLVM names it."""

    name: str
    triple: str
    cpu: str
    features: str = ""
    layout: str = ""
    """Layout of data that the code is made for; empty: the one that the kernels have already, the host's."""
    note: str = ""
    """What it has, for people."""

    def machine(self) -> "TargetMachine":
        """Return LLVM's target machine. Raises `ConfigurationError` if llvmlite was built without this back end."""
        import llvmlite
        import llvmlite.binding as llvm

        llvm.initialize_all_targets()
        llvm.initialize_all_asmprinters()
        try:
            found: Any = llvm.Target.from_triple(self.triple)
        except RuntimeError as error:
            raise ConfigurationError(
                f"llvmlite {llvmlite.__version__} has no back end for {self.triple}: {error}",
                field="target",
                value=self.name,
                hint="the wheels of PyPI have it",
            ) from None
        reloc = "pic" if self.name == HOST else "static"
        return found.create_target_machine(cpu=self.cpu, features=self.features, opt=2, reloc=reloc, codemodel="small")


TARGETS = {
    target.name: target
    for target in (
        Target(
            "cortex-m7",
            "thumbv7em-unknown-none-eabihf",
            "cortex-m7",
            "+fp-armv8d16,+fp64",
            ARM_LAYOUT,
            "double precision in hardware: STM32H7, i.MX RT1060",
        ),
        Target(
            "cortex-m33",
            "thumbv8m.main-unknown-none-eabihf",
            "cortex-m33",
            "",
            ARM_LAYOUT,
            "single precision in hardware, double precision by functions of the compiler: RP2350, STM32H5",
        ),
    )
}
"""Targets by name, without the host's."""
HOST = "host"


def target_named(name: str) -> Target:
    """Return a target by its name. Raises `ConfigurationError` if there is none, or if the host writes no ELF files."""
    ConfigurationError.unless_one_of("target", name, (*TARGETS, HOST))
    if name in TARGETS:
        return TARGETS[name]
    if sys.platform != "linux":
        raise ConfigurationError(f"object files of {platform.system()} are no ELF files", field="target", value=name)
    import llvmlite.binding as llvm

    return Target(name, llvm.get_process_triple(), "generic", note="this computer")
