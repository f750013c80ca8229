"""Numba's compiler as kernels need it.

Absent terms are constants, what depends on the form of rows is put in place, and what is found out for one kernel holds
for all.

Numba would search its templates at every operator, look for what kernels do not have, and link, optimise and emit every
kernel by itself, with all that it calls, although only compiled code calls it: here that is done once, for what Python
calls. None of that changes a bit.
"""

import functools
import gc
import operator
from types import SimpleNamespace

from numba.core import ir, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import (
    FunctionPass,
    LoweringPass,
    PassManager,
    _pass_registry,
    register_pass,
)
from numba.core.interpreter import Interpreter, peep_hole_delete_with_exit, peep_hole_fuse_dict_add_updates
from numba.core.ir_utils import get_definition, guard
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import (
    InlineOverloads,
    NativeLowering,
    NoPythonBackend,
    NopythonRewrites,
    NoPythonSupportedFeatureValidation,
    NopythonTypeInference,
)
from numba.core.untyped_passes import (
    DeadBranchPrune,
    FindLiterallyCalls,
    FixupArgs,
    GenericRewrites,
    InlineClosureLikes,
    InlineInlinables,
    LiteralUnroll,
    MakeFunctionToJitFunction,
    RewriteDynamicRaises,
    RewriteSemanticConstants,
    WithLifting,
)

from seastar_gym.lanes.registers import PLAIN, Bundle, Operation


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


@register_pass(mutates_CFG=False, analysis_only=False)
class _OfForm(FunctionPass):
    """Puts in place what depends on the form of rows: `borrow`, `splat`, and the kernels that replace others there.

    The form of a kernel is that of its arguments; that of an entry point is what its compiler was told.
    """

    _name = "of_form"

    def __init__(self):
        FunctionPass.__init__(self)

    def run_pass(self, state):
        form = state.form or next(filter(None, map(form_of, state.args)), None)
        if form is None:
            return False
        function, changed = state.func_ir, False
        for block in function.blocks.values():
            for statement in block.find_insts(ir.Assign):
                named = statement.value
                if not isinstance(named, ir.Global | ir.FreeVar):
                    continue
                there = _there(form, named.value, state.func_id.func)
                if there is not named.value:
                    statement.value = ir.Global(named.name, there, named.loc)
                    function._definitions[statement.target.name] = [statement.value]
                    changed = True
        if changed:
            state.typingctx.refresh()
        return changed


def _there(form, value, caller):
    """What a global of a kernel is on rows of a form; a kernel that replaces another one can call that."""
    if isinstance(value, CPUDispatcher):
        other = form.instead.get(value)
        return value if other is None or other.py_func is caller else other
    return value.at(form) if isinstance(value, Operation) and hasattr(value, "at") else value


def form_of(kind):
    """Form of lanes, a mask, rows or a borrowed bundle, or of the first in a tuple; None for anything else."""
    if isinstance(kind, types.BaseTuple) and not isinstance(kind, Bundle):
        return next(filter(None, map(form_of, kind)), None)
    return getattr(kind, "form", None)


class _Interpreter(Interpreter):
    """Numba's reader of Python's bytecode, without the search for what no kernel has."""

    def post_process(self, peepholes, func_ir):
        needless = (peep_hole_delete_with_exit, peep_hole_fuse_dict_add_updates)
        return super().post_process([each for each in peepholes if each not in needless], func_ir)


@register_pass(mutates_CFG=True, analysis_only=False)
class _Read(FunctionPass):
    """Has a kernel's bytecode read."""

    _name = "read_kernel"

    def __init__(self):
        FunctionPass.__init__(self)

    def run_pass(self, state):
        state.func_ir = _Interpreter(state.func_id).interpret(state.bc)
        return True


class _Known:
    """A typing context that remembers what numba's functions give, and attributes are, by the types that they get.

    A kernel is a function of another type. It is compiled when first asked for, and keeps what it gives itself.
    """

    def __init__(self, context):
        self.context, self._functions, self._attributes = context, {}, {}

    def __getattr__(self, name):
        return getattr(self.context, name)

    def resolve_function_type(self, func, args, kws):
        if kws or not isinstance(func, types.Function):
            return self.context.resolve_function_type(func, args, kws)
        key = func, tuple(args)
        if key not in self._functions:
            self._functions[key] = self.context.resolve_function_type(func, args, kws)
        return self._functions[key]

    def resolve_getattr(self, typ, attr):
        key = typ, attr
        if key not in self._attributes:
            self._attributes[key] = self.context.resolve_getattr(typ, attr)
        return self._attributes[key]


_known = functools.cache(_Known)


@register_pass(mutates_CFG=True, analysis_only=False)
class _Typed(NopythonTypeInference):
    """Numba's inference of types, asking what is known."""

    _name = "typed_kernel"

    def run_pass(self, state):
        context = state.typingctx
        state.typingctx = _known(context)
        try:
            return super().run_pass(state)
        finally:
            state.typingctx = context


MANGLED = "seastar_gym"
"""Part of the name of every kernel."""


class Part(JITCodeLibrary):
    """Code that compiled code alone calls: its own, one module, without that of the kernels which it calls."""

    is_rare = False

    def add_ir_module(self, ir_module):
        for function in ir_module.functions:
            if function.blocks:
                function.linkage = "linkonce_odr"  # whoever links it may inline it and leave it out
                if self.is_rare and "alwaysinline" not in function.attributes:
                    function.attributes.add("noinline")
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


class _Lowered(LoweringPass):
    """Has a function lowered into a library of the given kind."""

    def __init__(self):
        LoweringPass.__init__(self)

    def run_pass(self, state):
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return True


@functools.cache
def _size_of(target, kind):
    """Bytes of one of LLVM's types; llvmlite has a module with such a variable parsed to find out."""
    return kind.get_abi_size(target)


@register_pass(mutates_CFG=False, analysis_only=False)
class _AsPart(_Lowered):
    _name, library = "as_part", Part

    def run_pass(self, state):
        state.targetctx.get_abi_sizeof = functools.partial(_size_of, state.targetctx.target_data)
        super().run_pass(state)
        state.library.is_rare = getattr(state.func_id.func, "is_rare", False)
        return True


@register_pass(mutates_CFG=False, analysis_only=False)
class _AsWhole(_Lowered):
    _name, library = "as_whole", Whole


NEEDLESS = frozenset({
    WithLifting, InlineClosureLikes, RewriteDynamicRaises, MakeFunctionToJitFunction, InlineInlinables,
    FindLiterallyCalls, LiteralUnroll, InlineOverloads, NopythonRewrites, NoPythonSupportedFeatureValidation,
})  # fmt: skip
"""Numba's passes for what no compiled function of ours has: closures, `with`, exceptions, expressions of arrays."""


class EntryCompiler(CompilerBase):
    """Compiler of functions that Python calls. Absent terms are constants before numba looks for dead branches.

    form: Of the rows that arrays are borrowed as.
    """

    form = PLAIN

    def compile_extra(self, func):
        """Compile with all kernels below. Python's search for garbage would take an eighth of the time."""
        collects = gc.isenabled()
        gc.disable()
        try:
            return super().compile_extra(func)
        finally:
            if collects:
                gc.enable()

    def define_pipelines(self):
        self.state.form = self.form
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_AbsentTerms, RewriteSemanticConstants)
        passes.add_pass_after(_OfForm, RewriteSemanticConstants)
        passes.passes = [each for each in passes.passes if each[0] not in NEEDLESS]
        lowering = [kind for kind, _ in passes.passes].index(NativeLowering)
        passes.add_pass_after(_AsWhole, passes.passes[lowering - 1][0])
        passes.finalize()
        return [passes]


@functools.cache
def compiler_of(form):
    """The compiler of functions that borrow arrays as rows of a form."""
    return type(EntryCompiler.__name__, (EntryCompiler,), {"form": form})


class _PlainPasses(PassManager):
    """Passes one after the other. Numba's own are timed, told to listeners and looked at for printing."""

    def run(self, state):
        for kind, _ in self.passes:
            each = _pass_registry.get(kind).pass_inst
            each.analysis = self._analysis
            each.run_pass(state)


OF_KERNELS = (
    _Read, FixupArgs, RewriteSemanticConstants, _OfForm, _AbsentTerms, DeadBranchPrune, GenericRewrites, _Typed,
    _AsPart, NativeLowering, NoPythonBackend,
)  # fmt: skip
"""Numba's passes that kernels need: their variables have one type each, and what calls them owns the arrays."""


class KernelCompiler(CompilerBase):
    """Compiler of kernels, which only compiled code calls."""

    def define_pipelines(self):
        self.state.form = None
        passes = _PlainPasses("kernel")
        passes.passes = [(kind, "") for kind in OF_KERNELS]
        passes.finalize()
        return [passes]
