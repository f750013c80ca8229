"""Source that never had a term: the package is copied, and the term's code cut out of the copy.

Scenes without a term have None where its coefficients would be. That None is carried through the kernels as a compiler
would carry it, until nothing changes any more: into the functions that are always called with it, through `if x is
None`, out of the functions that are left with nothing to do, and at last out of `Rods` and `Work` themselves. What the
copy still says, it would say had nobody ever thought of the term.
"""

import ast
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import get_args, get_type_hints

from seastar_gym.der.compilation import PACKAGE
from seastar_gym.der.rods import Rods

BUNDLES = {"rods": "Rods", "work": "Work"}
"""The bundles that hold coefficients and memory of terms: what kernels call them, and their classes."""
ABSENT = "ABSENT"
"""Stands for what a term would have added."""

Functions = dict[str, ast.FunctionDef]
Replacement = Callable[[list[ast.expr]], ast.expr]


def optional_terms() -> tuple[str, ...]:
    """The fields of Rods that scenes may go without."""
    return tuple(name for name, hint in get_type_hints(Rods).items() if type(None) in get_args(hint))


def copy_without(terms: tuple[str, ...], folder: Path) -> Path:
    """Copy the package into `folder` and cut out what is there for the `terms`; returns the copy."""
    copy = folder / PACKAGE.name
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    if terms:
        files = sorted((copy / "der").glob("*.py")) + sorted((copy / "morphology").glob("*.py"))
        trees = [ast.parse(file.read_text(encoding="utf-8")) for file in files]
        cut_out(terms, trees)
        for file, tree in zip(files, trees, strict=True):
            file.write_text(ast.unparse(ast.fix_missing_locations(tree)) + "\n", encoding="utf-8")
    return copy


def cut_out(terms: tuple[str, ...], trees: list[ast.Module]) -> None:
    """Cut terms out of modules, in place."""
    always, uncalled = set(parameters_given_none(trees)), set(functions_of(trees)) - names_in(trees)
    fields = {("rods", term) for term in terms}
    replacements: dict[str, Replacement] = {}
    before = ""
    while (now := "".join(map(ast.unparse, trees))) != before:
        before = now
        given_none = set(parameters_given_none(trees)) - always
        for tree in trees:
            _Fold(fields, given_none, replacements).visit(tree)
            fields |= _drop_fields(tree, fields)
        drop_parameters(trees, given_none)
        drop_unused(trees, set(replacements), uncalled)


def functions_of(trees: list[ast.Module]) -> Functions:
    """Functions of modules, by name."""
    return {node.name: node for tree in trees for node in tree.body if isinstance(node, ast.FunctionDef)}


def calls_of(trees: list[ast.Module]) -> Iterator[tuple[str, ast.Call]]:
    """Calls of functions by their names."""
    for tree in trees:
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                yield node.func.id, node


def is_none(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and node.value is None


def is_absent(node: ast.expr) -> bool:
    """What a term would have added: nothing, zero, or a pair of zeros."""
    if isinstance(node, ast.Tuple):
        return all(map(is_absent, node.elts))
    return (isinstance(node, ast.Name) and node.id == ABSENT) or ast.unparse(node) == "splat(0.0)"


def parameters_given_none(trees: list[ast.Module]) -> Iterator[tuple[str, str]]:
    """(function, parameter) that every call gives None to."""
    functions = functions_of(trees)
    calls: dict[str, list[ast.Call]] = {}
    for name, call in calls_of(trees):
        calls.setdefault(name, []).append(call)
    for name, own in calls.items():
        for k, parameter in enumerate(functions[name].args.args if name in functions else ()):
            if all(len(call.args) > k and is_none(call.args[k]) for call in own):
                yield name, parameter.arg


def drop_parameters(trees: list[ast.Module], given_none: set[tuple[str, str]]) -> None:
    """Out of definitions, which no longer read them, and calls."""
    functions = functions_of(trees)
    kept = {
        name: [(name, parameter.arg) not in given_none for parameter in function.args.args]
        for name, function in functions.items()
        if any(name == its for its, _ in given_none)
    }
    for name, call in calls_of(trees):
        if name in kept:
            call.args = [argument for argument, keep in zip(call.args, kept[name], strict=True) if keep]
    for name, keeps in kept.items():
        arguments = functions[name].args
        arguments.args = [parameter for parameter, keep in zip(arguments.args, keeps, strict=True) if keep]


def names_in(trees: list[ast.Module]) -> set[str]:
    """All that modules name."""
    return {node.id for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Name)}


def drop_unused(trees: list[ast.Module], gone: set[str], uncalled: set[str]) -> None:
    """Out of the modules: functions that are gone, kernels that only they called, and imports of either.

    uncalled: Functions that nobody called from the beginning.
    """
    while True:
        for tree in trees:
            tree.body = [node for node in tree.body if not (isinstance(node, ast.FunctionDef) and node.name in gone)]
            for node in tree.body:
                if isinstance(node, ast.ImportFrom):
                    node.names = [alias for alias in node.names if alias.name not in gone]
            tree.body = [node for node in tree.body if not (isinstance(node, ast.ImportFrom) and not node.names)]
        kernels = {name for name, function in functions_of(trees).items() if _is_kernel(function)}
        idle = kernels - names_in(trees) - uncalled
        if not idle:
            return
        gone |= idle


def _is_kernel(function: ast.FunctionDef) -> bool:
    return bool({"kernel", "inlined_kernel"} & set(map(ast.unparse, function.decorator_list)))


def _drop_fields(tree: ast.Module, fields: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """Out of the bundles' classes and of the calls that make them; returns the fields that nothing else fills."""
    found = set()
    for bundle, name in BUNDLES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == name:
                found |= {(bundle, str(keyword.arg)) for keyword in node.keywords if is_none(keyword.value)}
                node.keywords = [k for k in node.keywords if (bundle, k.arg) not in fields | found]
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and node.name == name:
                node.body = [
                    line
                    for line in node.body
                    if not (
                        isinstance(line, ast.AnnAssign)
                        and isinstance(line.target, ast.Name)
                        and (bundle, line.target.id) in fields | found
                    )
                ]
    return found


class _Fold(ast.NodeTransformer):
    """Carries None and what is absent through functions; notes those that are left with nothing to do."""

    def __init__(
        self, fields: set[tuple[str, str]], given_none: set[tuple[str, str]], replacements: dict[str, Replacement]
    ):
        self.fields, self.given_none, self.replacements = fields, given_none, replacements
        self.known: dict[str, ast.expr] = {}
        self.stores: Counter[str] = Counter()

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        self.known = {
            p.arg: ast.Constant(None) for p in node.args.args if (node.name, p.arg) in self.given_none
        }  # fmt: skip
        has_gate = bool(self.known)
        self.stores = Counter(n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store))
        self.generic_visit(node)
        returns = [k for k, line in enumerate(node.body) if isinstance(line, ast.Return)]
        if returns:
            node.body = node.body[: returns[0] + 1]
        self.known = {}
        if has_gate or len(node.body) == 1:
            self._note_replacement(node)
        return node

    def _note_replacement(self, node: ast.FunctionDef) -> None:
        """Of a function that returns its arguments, nothing or zeros."""
        *lines, last = [line for line in node.body if not isinstance(line, ast.Expr)] or [ast.Return()]
        if not isinstance(last, ast.Return):
            return
        zeros = set()
        for line in lines:
            if not (isinstance(line, ast.Assign) and is_absent(line.value)):
                return
            zeros |= {n.id for n in ast.walk(line.targets[0]) if isinstance(n, ast.Name)}
        value = last.value if last.value is not None else ast.Constant(None)
        parameters = [parameter.arg for parameter in node.args.args]
        parts = value.elts if isinstance(value, ast.Tuple) else [value]
        results: list[int | ast.expr] = []
        for part in parts:
            if isinstance(part, ast.Name) and part.id in parameters:
                results.append(parameters.index(part.id))
            elif is_absent(part) or (isinstance(part, ast.Name) and part.id in zeros):
                results.append(ast.Name(ABSENT, ast.Load()))
            elif is_none(part):
                results.append(part)
            else:
                return
        whole = isinstance(value, ast.Tuple)

        def replacement(arguments: list[ast.expr]) -> ast.expr:
            chosen = [arguments[part] if isinstance(part, int) else part for part in results]
            return ast.Tuple(chosen, ast.Load()) if whole else chosen[0]

        self.replacements[node.name] = replacement

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return self.known.get(node.id, node) if isinstance(node.ctx, ast.Load) else node

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        if isinstance(node.value, ast.Name) and (node.value.id, node.attr) in self.fields:
            return ast.Constant(None)
        return self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        self.generic_visit(node)
        if is_none(node.left) and isinstance(node.ops[0], ast.Is):
            return ast.Constant(True)
        return node

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        self.generic_visit(node)
        if isinstance(node.op, ast.And):
            node.values = [value for value in node.values if ast.unparse(value) != "True"] or [ast.Constant(True)]
        return node.values[0] if len(node.values) == 1 else node

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        self.generic_visit(node)
        return node.body if ast.unparse(node.test) == "True" else node

    def visit_If(self, node: ast.If) -> ast.AST | list[ast.stmt]:
        self.generic_visit(node)
        return node.body if ast.unparse(node.test) == "True" else node

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        was_call = isinstance(node.value, ast.Call)
        self.generic_visit(node)
        return None if was_call and is_none(node.value) else node

    def visit_Assign(self, node: ast.Assign) -> ast.AST | None:
        self.generic_visit(node)
        target, value = node.targets[0], node.value
        pairs = [(target, value)]
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            pairs = list(zip(target.elts, value.elts, strict=True))
        left = []
        for name, one in pairs:
            is_known = is_none(one) or (isinstance(one, ast.Name) and one.id == ABSENT)
            if is_known and isinstance(name, ast.Name) and self.stores[name.id] == 1:
                self.known[name.id] = one
            elif ast.unparse(name) != ast.unparse(one):
                left.append((name, one))
        if len(left) == len(pairs):
            return node
        if not left:
            return None
        names, values = zip(*left, strict=True)
        if len(left) == 1:
            node.targets, node.value = [names[0]], values[0]
        else:
            node.targets, node.value = [ast.Tuple(list(names), ast.Store())], ast.Tuple(list(values), ast.Load())
        return node

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        is_sum = isinstance(node.op, ast.Add | ast.Sub)
        return node.left if is_sum and isinstance(node.right, ast.Name) and node.right.id == ABSENT else node

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        if not isinstance(node.func, ast.Name):
            return node
        if node.func.id in ("add_product", "subtract_product") and any(map(is_absent, node.args[1:])):
            return node.args[0]
        if node.func.id in self.replacements:
            return self.replacements[node.func.id](node.args)
        return node
