"""Numba's compiler as kernels need it: absent terms are constants, and a kernel is optimised in what calls it alone.

Numba would link, optimise and turn into machine code every kernel by itself, although only compiled code calls it; and
it would look for what kernels do not have. Without that, the same bits are there in half the time.
"""

import operator
from types import SimpleNamespace

from numba.core import ir, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import FunctionPass, LoweringPass, register_pass
from numba.core.ir_utils import get_definition, guard
from numba.core.typed_passes import (
    InlineOverloads,
    IRLegalization,
    NativeLowering,
    NopythonRewrites,
    NoPythonSupportedFeatureValidation,
    PreLowerStripPhis,
)
from numba.core.untyped_passes import (
    FindLiterallyCalls,
    InlineClosureLikes,
    InlineInlinables,
    LiteralUnroll,
    MakeFunctionToJitFunction,
    ReconstructSSA,
    RewriteDynamicRaises,
    RewriteSemanticConstants,
    WithLifting,
)


@register_pass(mutates_CFG=False, analysis_only=False)
class _AbsentTerms(FunctionPass):
    """Makes `rods.body is None` a constant, as numba does for arguments alone: the types of members are known, too.

    So a kernel asks the bundle that it gets, and what is behind the question is gone when compiled.
    """

    _name = "absent_terms"

    def __init__(self):
        FunctionPass.__init__(self)

    def run_pass(self, state):
        function, changed = state.func_ir, False
        for block in function.blocks.values():
            for statement in block.find_insts(ir.Assign):
                absent = _is_absent(function, state.args, statement.value)
                if absent is not None:
                    statement.value = ir.Const(absent, statement.loc)
                    function._definitions[statement.target.name] = [statement.value]
                    changed = True
        return changed


def _is_absent(function, arguments, question):
    """What `member is None` or `member is not None` says of an argument's member; None where nothing is asked so."""
    if not (isinstance(question, ir.Expr) and question.op == "binop"):
        return None
    member, other = (guard(get_definition, function, side) for side in (question.lhs, question.rhs))
    kind = _type_of(function, arguments, member)
    if kind is None or not (isinstance(other, ir.Const) and other.value is None):
        return None
    absent = isinstance(kind, types.NoneType | types.Omitted)
    return {operator.is_: absent, operator.is_not: not absent}.get(question.fn)


def _type_of(function, arguments, value):
    """Type of an argument, of its member or of a member's member; None for anything else."""
    if isinstance(value, ir.Arg):
        return arguments[value.index]
    if isinstance(value, ir.Expr) and value.op == "getattr":
        bundle = _type_of(function, arguments, guard(get_definition, function, value.value))
        if isinstance(bundle, types.BaseNamedTuple) and value.attr in bundle.fields:
            return bundle.types[bundle.fields.index(value.attr)]
    return None


MANGLED = "seastar_gym"
"""Part of the name of every kernel."""


class _Part(JITCodeLibrary):
    """Code that compiled code alone calls: its own, without that of the kernels which it calls.

    A `_Whole` optimises it and turns it into machine code. By itself it would be both for nothing.
    """

    def _optimize_functions(self, ll_module):
        ll_module.data_layout = self._codegen._data_layout
        passes, builder = self._codegen._function_pass_manager()
        for function in ll_module.functions:
            if not function.is_declaration:
                passes.run(function, builder)

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


class _Whole(JITCodeLibrary):
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
                if isinstance(called, _Part):
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


class _Lowered(LoweringPass):
    """Has a function lowered into a library of the given kind."""

    def __init__(self):
        LoweringPass.__init__(self)

    def run_pass(self, state):
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return True


@register_pass(mutates_CFG=False, analysis_only=False)
class _AsPart(_Lowered):
    _name, library = "as_part", _Part


@register_pass(mutates_CFG=False, analysis_only=False)
class _AsWhole(_Lowered):
    _name, library = "as_whole", _Whole


NEEDLESS = frozenset({
    WithLifting, InlineClosureLikes, RewriteDynamicRaises, MakeFunctionToJitFunction, InlineInlinables,
    FindLiterallyCalls, LiteralUnroll, InlineOverloads, NopythonRewrites, NoPythonSupportedFeatureValidation,
})  # fmt: skip
"""Numba's passes for what no compiled function of ours has: closures, `with`, exceptions, expressions of arrays."""
NEEDLESS_IN_KERNELS = frozenset({ReconstructSSA, PreLowerStripPhis, IRLegalization})
"""Those for variables of several types, and for counting references: what calls kernels owns the arrays."""


class EntryCompiler(CompilerBase):
    """Compiler of functions that Python calls. Absent terms are constants before numba looks for dead branches."""

    lowered = _AsWhole
    needless = NEEDLESS

    def define_pipelines(self):
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_AbsentTerms, RewriteSemanticConstants)
        passes.passes = [each for each in passes.passes if each[0] not in self.needless]
        lowering = [kind for kind, _ in passes.passes].index(NativeLowering)
        passes.add_pass_after(self.lowered, passes.passes[lowering - 1][0])
        passes.finalize()
        return [passes]


class KernelCompiler(EntryCompiler):
    """Compiler of kernels, which only compiled code calls."""

    lowered = _AsPart
    needless = NEEDLESS | NEEDLESS_IN_KERNELS
