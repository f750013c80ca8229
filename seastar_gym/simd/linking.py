"""LLVM's code of kernels, which is optimised and turned into machine code only together, in what Python calls.

Numba would link, optimise and emit every kernel by itself, with all that it calls.
"""

from types import SimpleNamespace

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock

MANGLED = "seastar_gym"
"""Part of the name of every kernel."""


class Part(JITCodeLibrary):
    """Code that compiled code alone calls: its own, one module, without that of the kernels which it calls."""

    def add_ir_module(self, ir_module):
        for function in ir_module.functions:
            if function.blocks:
                function.linkage = "linkonce_odr"  # whoever links it may inline it and leave it out
        super().add_ir_module(ir_module)

    def add_llvm_module(self, ll_module):
        """Keep the module, simplified: LLVM would inline less of what is not, and fast strokes take 5 to 7 % longer."""
        ll_module.data_layout = self._codegen._data_layout
        passes, builder = self._codegen._function_pass_manager()
        for function in ll_module.functions:
            if not function.is_declaration:
                passes.run(function, builder)
        self._final_module = ll_module

    def _get_module_for_linking(self):
        return self._final_module

    def finalize(self):
        self._raise_if_finalized()
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name):
        return 0

    @property
    def codegen(self):
        """There is no machine code that an environment of Python's could be given to."""
        return SimpleNamespace(set_env=lambda name, environment: None)


class Whole(JITCodeLibrary):
    """Code that Python calls, with that of all kernels below it, each linked in once."""

    def finalize(self):
        self._linking_libraries = _reached(self)
        super().finalize()

    def _optimize_final_module(self):
        """Optimise once: numba's first pass gathers reference counts, of which kernels have none."""
        missing = [each.name for each in self._final_module.functions if each.is_declaration and MANGLED in each.name]
        assert not missing, missing
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)


def _reached(library):
    """The libraries that one calls, and those that these call, each once and after all that call it.

    LLVM's linker leaves out what nothing calls yet.
    """
    found, seen = [], set()

    def visit(caller):
        for called in reversed(caller._linking_libraries):
            if called not in seen:
                seen.add(called)
                if isinstance(called, Part):
                    visit(called)
                found.append(called)

    visit(library)
    return found[::-1]


def linked(kernel, signature):
    """A compiled kernel's description, and its LLVM code with that of all that it calls."""
    compiled = kernel.overloads[signature]
    with global_compiler_lock:
        module = compiled.library._get_module_for_linking().clone()
        for called in _reached(compiled.library):
            module.link_in(called._get_module_for_linking(), preserve=True)
    return compiled.fndesc, module
