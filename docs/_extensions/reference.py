"""The reference: signatures and docstrings, read from the source without importing it."""

import ast
import re
from collections.abc import Collection
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
NAMED = re.compile(r"^<!-- site: names (\S+) (.*) -->$", re.MULTILINE)
LONGEST = 48
"""Most characters of a default that is shown."""
Definition = ast.ClassDef | ast.FunctionDef
FIELD = re.compile(r"^([*\w]+(?:, [*\w]+)*): (?=\S)", re.MULTILINE)
EXAMPLE = re.compile(r"^(>>> .*(?:\n.+)*)", re.MULTILINE)
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)


def rooms() -> dict[str, dict[str, list[str]]]:
    """Documented names by their rooms, the folders of the package, and by their modules.

    They are what the package exports, and what docs/reference.md names.
    """
    found: dict[str, dict[str, list[str]]] = {}
    exports = [(defined("seastar_gym", name), name) for name in exported("seastar_gym")]
    named = NAMED.findall((DOCS / "reference.md").read_text(encoding="utf-8"))
    pairs = [(module, name) for (module, node), name in exports if node]
    pairs += [(module, name) for module, words in named for name in words.split()]
    for module, name in sorted(pairs):
        found.setdefault(module.split(".")[1], {}).setdefault(module, []).append(name)
    return found


def pages() -> dict[str, str]:
    """Pages of all rooms in Markdown, by the names of the rooms."""
    return {room: page(room, modules) for room, modules in rooms().items()}


def page(room: str, modules: dict[str, list[str]]) -> str:
    """Page of a room: what its package says, then its names, module by module."""
    parts = [f"# seastar_gym.{room}", (ast.get_docstring(parsed(f"seastar_gym.{room}")) or "").partition("\n\n")[0]]
    for module, names in modules.items():
        found = [defined(module, name) for name in names]
        parts += [f"## {module}", *(described(node, place) for place, node in found if node)]
    return "\n\n".join(parts) + "\n"


def table() -> str:
    """Table of all rooms and their names, with links."""
    rows = ["| room | names |", "|---|---|"]
    for room, modules in rooms().items():
        names = sorted((name for found in modules.values() for name in found), key=str.lower)
        links = ", ".join(f"[{name}](reference/{room}.md#{name.lower()})" for name in names)
        rows.append(f"| [{room}](reference/{room}.md) | {links} |")
    return "\n".join(rows)


def file_of(module: str) -> Path:
    place = ROOT.joinpath(*module.split("."))
    return place / "__init__.py" if place.is_dir() else place.with_suffix(".py")


def parsed(module: str) -> ast.Module:
    return ast.parse(file_of(module).read_text(encoding="utf-8"))


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


def described(node: Definition, module: str) -> str:
    """Heading, and a directive that describes a class with its public methods, or a function; then its source."""
    kind = "class" if isinstance(node, ast.ClassDef) else "function"
    parts = [listed(markdown(without_sections(ast.get_docstring(node) or "")), arguments_of(node))]
    if isinstance(node, ast.ClassDef):
        parts += [member(each) for each in node.body if isinstance(each, ast.FunctionDef) and is_told(each)]
        parts += attributes(node)
    file = file_of(module).relative_to(ROOT)
    source = f"Source: [{file}](../../{file}), line {node.lineno}."
    text = directive(f"py:{kind}", f"{module}.{node.name}{signature(node)}", parts, 6)
    return "\n\n".join([f"### {node.name}", text, source])


def without_sections(text: str) -> str:
    """Docstring of a task, with its arguments alone of the sections that the pages of its ids have."""
    intro, *others = re.split(r"^## ", text, flags=re.MULTILINE)
    said = [part.partition("\n")[2] for part in others if part.startswith("Arguments")]
    pages = "Episodes, observation, reward and `info` are on the pages of [its ids](../environments.md#ids)."
    return "\n".join([intro, pages, "", *said]) if said else text


def is_told(method: ast.FunctionDef) -> bool:
    return not method.name.startswith("_") and ast.get_docstring(method) is not None


def member(node: ast.FunctionDef) -> str:
    decorators = [ast.unparse(each) for each in node.decorator_list]
    text = [listed(markdown(ast.get_docstring(node) or ""), arguments_of(node))]
    if any("property" in each for each in decorators):
        return directive("py:property", node.name, text, 5)
    arguments = of_function(node, bound="staticmethod" not in decorators)
    return directive("py:method", f"{node.name}{arguments}", text, 5)


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
        kw_defaults=[value and abridged(value) for value in arguments.kw_defaults],
        kwarg=arguments.kwarg and ast.arg(arguments.kwarg.arg),
        defaults=[abridged(value) for value in arguments.defaults],
    )
    return f"({ast.unparse(plain)})"


def arguments_of(node: Definition) -> list[str]:
    """Names of a function's arguments, of a class's constructor, or of its fields."""
    if isinstance(node, ast.ClassDef):
        made = [each for each in node.body if isinstance(each, ast.FunctionDef) and each.name == "__init__"]
        fields = [each.target for each in node.body if isinstance(each, ast.AnnAssign)]
        return arguments_of(made[0]) if made else [field.id for field in fields if isinstance(field, ast.Name)]
    given = node.args
    return [each.arg for each in (*given.posonlyargs, *given.args, *given.kwonlyargs) if each.arg != "self"]


def abridged(value: ast.expr) -> ast.expr:
    """A default, or dots for one that is long."""
    return value if len(ast.unparse(value)) <= LONGEST else ast.Constant(...)


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
        return ast.unparse(abridged(value))
    chosen = {word.arg: word.value for word in value.keywords}
    if "default" in chosen:
        return ast.unparse(chosen["default"])
    factory = chosen.get("default_factory")
    if isinstance(factory, ast.Call):
        return f"{ast.unparse(factory.args[0])}({', '.join(ast.unparse(word) for word in factory.keywords)})"
    return f"{ast.unparse(factory)}()" if factory else "..."


def markdown(text: str) -> str:
    """Docstring with its headings as words, its examples as code, and rows of tables in one line each."""
    pieces = EXAMPLE.split(text)
    pieces[::2] = [one_line_each(HEADING.sub(r"**\1**", words)) for words in pieces[::2]]
    pieces[1::2] = [f"```pycon\n{example}\n```" for example in pieces[1::2]]
    return "".join(pieces)


def one_line_each(text: str) -> str:
    """Text in which a row of a table with a single cell goes on in that cell of the row above."""
    lines: list[str] = []
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else []
        if len(cells) > 2 and sum(map(bool, cells)) == 1 and lines:
            above = [cell.strip() for cell in lines[-1].strip("|").split("|")]
            lines[-1] = f"| {' | '.join(f'{a} {b}'.strip() for a, b in zip(above, cells, strict=True))} |"
        else:
            lines.append(line)
    return "\n".join(lines)


def listed(text: str, arguments: Collection[str] = ()) -> str:
    """Text with its arguments as a list.

    A line `name: ..` begins one unless the line before goes on in it, and so does the name of one of the arguments
    after a full stop.
    """
    lines = text.splitlines()
    ends = [True, *(not line or line.startswith(("#", "**")) or line.endswith((".", ":")) for line in lines)]
    told = "\n".join(FIELD.sub(r"- **\1**: ", line) if end else line for line, end in zip(lines, ends, strict=False))
    names = "|".join(map(re.escape, arguments))
    return re.sub(rf"(?<=\.)\s+((?:{names})(?:, (?:{names}))*): ", r"\n- **\1**: ", told) if names else told
