"""The reference: signatures and docstrings, read from the source without importing it."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
Definition = ast.ClassDef | ast.FunctionDef
FIELD = re.compile(r"^([*\w]+(?:, [*\w]+)*): (?=\S)", re.MULTILINE)
EXAMPLE = re.compile(r"^(>>> .*(?:\n.+)*)", re.MULTILINE)
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)


def public(package: str) -> str:
    """Reference of the names that a package exports, in its order."""
    return "\n\n".join(
        described(node, package, 6) for _, node in (defined(package, name) for name in exported(package)) if node
    )


def names(module: str, *named: str) -> str:
    """Docstring of a module, and reference of some of its names."""
    told = [described(node, module, 6) for _, node in (defined(module, name) for name in named) if node]
    return "\n\n".join([markdown(ast.get_docstring(parsed(module)) or ""), *told])


def parsed(module: str) -> ast.Module:
    place = ROOT.joinpath(*module.split("."))
    file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    return ast.parse(file.read_text(encoding="utf-8"))


def exported(package: str) -> list[str]:
    """Names that a package's stub imports."""
    imports = (node for node in stub(package).body if isinstance(node, ast.ImportFrom) and node.module)
    return sorted(alias.name for node in imports for alias in node.names)


def stub(package: str) -> ast.Module:
    """What a package says that it exports, if it imports it when it is asked for."""
    file = ROOT.joinpath(*package.split("."), "__init__.pyi")
    return ast.parse(file.read_text(encoding="utf-8") if file.is_file() else "")


def defined(module: str, name: str) -> tuple[str, Definition | None]:
    """The module in which a class or function is defined, and its definition; None for anything else."""
    for node in (*ast.walk(parsed(module)), *stub(module).body):
        if isinstance(node, Definition) and node.name == name:
            return module, node
        if isinstance(node, ast.ImportFrom) and node.module and any(alias.name == name for alias in node.names):
            return defined(f"{module}.{node.module}" if node.level else node.module, name)
    return module, None


def described(node: Definition, module: str, fence: int) -> str:
    """Directive that describes a class with its public methods, or a function, folded under its name."""
    kind = "class" if isinstance(node, ast.ClassDef) else "function"
    folded = '<details class="name"><summary>{}</summary>\n\n{}\n\n</details>'.format
    parts = [markdown(ast.get_docstring(node) or "")]
    if isinstance(node, ast.ClassDef):
        parts += [member(each, fence - 1) for each in node.body if isinstance(each, ast.FunctionDef) and is_told(each)]
        parts += attributes(node)
    return folded(node.name, directive(f"py:{kind}", f"{module}.{node.name}{signature(node)}", parts, fence))


def is_told(method: ast.FunctionDef) -> bool:
    return not method.name.startswith("_") and ast.get_docstring(method) is not None


def member(node: ast.FunctionDef, fence: int) -> str:
    decorators = [ast.unparse(each) for each in node.decorator_list]
    text = [markdown(ast.get_docstring(node) or "")]
    if any("property" in each for each in decorators):
        return directive("py:property", node.name, text, fence)
    arguments = of_function(node, bound="staticmethod" not in decorators)
    return directive("py:method", f"{node.name}{arguments}", text, fence)


def attributes(node: ast.ClassDef) -> list[str]:
    """Fields that have a docstring of their own, as a list."""
    pairs = zip(node.body, node.body[1:], strict=False)
    told = [
        f"- **{field.target.id}**: {' '.join(text.value.value.split())}"
        for field, text in pairs
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and isinstance(text, ast.Expr)
        and isinstance(text.value, ast.Constant)
        and isinstance(text.value.value, str)
    ]
    return ["\n".join(told)] if told else []


def directive(name: str, argument: str, parts: list[str], fence: int) -> str:
    marks = ":" * fence
    return "\n".join([f"{marks}{{{name}}} {argument}", "", "\n\n".join(filter(None, parts)), marks])


def signature(node: Definition) -> str:
    if isinstance(node, ast.FunctionDef):
        return of_function(node, bound=False)
    for each in node.body:
        if isinstance(each, ast.FunctionDef) and each.name == "__init__":
            return of_function(each, bound=True)
    return of_fields(node)


def of_function(node: ast.FunctionDef, bound: bool) -> str:
    """Arguments without annotations, which docstrings explain; `bound`: without the first."""
    arguments = node.args
    plain = ast.arguments(
        posonlyargs=[ast.arg(each.arg) for each in arguments.posonlyargs],
        args=[ast.arg(each.arg) for each in arguments.args][1 if bound else 0 :],
        vararg=arguments.vararg and ast.arg(arguments.vararg.arg),
        kwonlyargs=[ast.arg(each.arg) for each in arguments.kwonlyargs],
        kw_defaults=arguments.kw_defaults,
        kwarg=arguments.kwarg and ast.arg(arguments.kwarg.arg),
        defaults=arguments.defaults,
    )
    return f"({ast.unparse(plain)})"


def of_fields(node: ast.ClassDef) -> str:
    """Fields of a dataclass or a named tuple, with their defaults."""
    fields = [
        field.target.id + (f"={default(field.value)}" if field.value else "")
        for field in node.body
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and "ClassVar" not in ast.unparse(field.annotation)
        and not field.target.id.startswith("_")
    ]
    return f"({', '.join(fields)})" if fields else ""


def default(value: ast.expr) -> str:
    """A field's default; of a `field(...)`, what its factory makes."""
    if not (isinstance(value, ast.Call) and ast.unparse(value.func) == "field"):
        return ast.unparse(value)
    chosen = {word.arg: word.value for word in value.keywords}
    if "default" in chosen:
        return ast.unparse(chosen["default"])
    factory = chosen.get("default_factory")
    if isinstance(factory, ast.Call):
        return f"{ast.unparse(factory.args[0])}({', '.join(ast.unparse(word) for word in factory.keywords)})"
    return f"{ast.unparse(factory)}()" if factory else "..."


def markdown(text: str) -> str:
    """Docstring with its arguments as a list, its headings as words, and its examples as code."""
    pieces = EXAMPLE.split(text)
    pieces[::2] = [HEADING.sub(r"**\1**", FIELD.sub(r"- **\1**: ", words)) for words in pieces[::2]]
    pieces[1::2] = [f"```pycon\n{example}\n```" for example in pieces[1::2]]
    return "".join(pieces)
