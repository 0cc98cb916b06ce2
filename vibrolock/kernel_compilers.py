"""How numba compiles kernels. Importing this module loads numba.

numba's own compiler optimises each kernel that others call and makes it machine code, which nobody calls, and optimises it
anew within each kernel that calls it. Here such a kernel stays text until then.
"""

import gc
from typing import Any

import llvmlite.binding
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, compile_result

TEXT = "text"
"""What a stored library is that is no machine code, beside numba's own kinds."""


class KernelLibrary(JITCodeLibrary):
    """Machine code of a kernel that Python calls, with all that it calls."""

    def _optimize_final_module(self) -> None:
        """Optimise what is called as this kernel's alone: LLVM then knows that no other definition takes its place."""
        for function in self._final_module.functions:
            if function.linkage == llvmlite.binding.Linkage.linkonce_odr:
                function.linkage = llvmlite.binding.Linkage.internal
        super()._optimize_final_module()  # type: ignore[no-untyped-call]


class InnerLibrary(JITCodeLibrary):
    """The text of a kernel that only other kernels call, with that of all that it calls itself."""

    @property
    def codegen(self) -> Any:
        """What keeps the environments of machine code, of which there is none."""
        return _NoMachineCode()

    def _optimize_final_module(self) -> None:
        """Leave it to the kernels that call this one."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        self._finalized = True

    def serialize_using_object_code(self) -> Any:
        """Return what is stored."""
        return self.name, TEXT, self._get_module_for_linking().as_bitcode()  # type: ignore[no-untyped-call]


class _NoMachineCode:
    def set_env(self, name: str, environment: Any) -> None:
        """Tell nobody; the machine code of kernels that call this one is told."""


class KernelCompiler(Compiler):
    """numba's compiler, which looks for no garbage meanwhile: nearly all that it makes stays until it is done."""

    library: Any = KernelLibrary

    def compile_extra(self, function: Any) -> Any:
        """Compile a function."""
        state: Any = self.state
        state.library = self.library(state.targetctx.codegen(), function.__qualname__)
        state.library.enable_object_caching()
        was_enabled = gc.isenabled()
        gc.disable()
        try:
            made: Any = super().compile_extra(function)  # type: ignore[no-untyped-call]
        finally:
            if was_enabled:
                gc.enable()
        for environment in made._find_referenced_environments():  # of the kernels that it calls; numba tells it its own
            made.library.codegen.set_env(environment.env_name, environment)
        return made


class InnerCompiler(KernelCompiler):
    """The compiler of kernels that only other kernels call, as far as the text of LLVM."""

    library: Any = InnerLibrary


def restored(context: Any, stored: Any) -> Any:
    """Return what an inner kernel was compiled to, from what is stored of it; None for other kernels."""
    (name, kind, text), description, environment, signature, objectmode, lifted, annotation, reload_init, known = stored
    if kind != TEXT:
        return None
    library = InnerCompiler.library(context.codegen(), name)
    library._final_module = library._shared_module = llvmlite.binding.parse_bitcode(text)
    library._finalized = True
    for reload in reload_init:
        reload()
    made: Any = compile_result
    return made(
        target_context=context,
        typing_context=context.typing_context,
        library=library,
        entry_point=context.get_executable(library, description, environment),
        fndesc=description,
        environment=environment,
        signature=signature,
        objectmode=objectmode,
        lifted=lifted,
        type_annotation=annotation,
        reload_init=reload_init,
        referenced_envs=known,
    )
