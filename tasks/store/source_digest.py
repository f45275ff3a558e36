"""Digest of the source a function can reach: its module and, through imports, further modules of ours.

A stored result may only be served while the code that made it is unchanged. Which code that is
follows from the import statements, so nobody has to declare it and nobody can forget to: the
statements are read (not executed) from the module of the function, then from every module of
this application they name, lazy imports inside functions included.

A package's ``__init__.py`` runs whenever one of its modules is imported, so its text counts; its
own imports are followed only when a name is taken from the package itself. Otherwise a register
of formats would tie every stage to every format.

Templates are source as well: the files in a folder ``templates`` count with every module next to it.
"""

from __future__ import annotations

import ast
import hashlib
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path

PACKAGES = ("flows", "tasks", "adjust")
#: Folder next to a module whose files are part of the source: texts that the modules fill in.
TEMPLATES = "templates"
#: Functions that import what they are given.
IMPORT_CALLS = ("import_module", "__import__")
#: The folder of our packages.
ROOT = Path(__file__).resolve().parents[2]


def digest_of_sources(function: Callable[..., object]) -> str:
    """SHA-256 over the sorted (name, content) of all source files that `function` reaches."""
    return digest_behind(source_of(function))


def source_of(function: Callable[..., object]) -> Path:
    """The module file of a function."""
    module = sys.modules[function.__module__]
    if module.__file__ is None:
        raise TypeError(f"{function.__module__} has no source file to take a digest of")
    return Path(module.__file__).resolve()


def digest_of_application() -> str:
    """SHA-256 over all source files of this application."""
    folders = [ROOT / package for package in PACKAGES]
    modules = [module for folder in folders for module in folder.rglob("*.py")]
    filled_in = [
        template for folder in {module.parent for module in modules} for template in _templates(folder)
    ]
    return _digest_of({_name(file): file for file in (*modules, *filled_in)})


def sources_reached(start: Path) -> dict[str, Path]:
    """All source files reached from the module file `start`.

    Returns
    -------
    name → file : paths relative to the folder of our packages; a file outside of it (a test's own
        stage) has its bare name.
    """
    reached: dict[str, Path] = {}
    followed: set[Path] = set()
    ahead = [start]
    while ahead:
        file = ahead.pop()
        if file in followed:
            continue
        followed.add(file)
        reached[_name(file)] = file
        reached.update({_name(template): template for template in _templates(file.parent)})
        for imported in _imports(file):
            reached.update({_name(parent): parent for parent in _parents(imported.parent)})
            ahead.append(imported)
    return reached


@cache
def digest_behind(start: Path) -> str:
    """SHA-256 over the sorted (name, content) of all source files reached from the module file `start`."""
    # Kept for the life of the process: the code that runs is the code that was imported.
    return _digest_of(sources_reached(start))


def _digest_of(files: Mapping[str, Path]) -> str:
    digest = hashlib.sha256()
    for name, file in sorted(files.items()):
        content = file.read_bytes()
        digest.update(f"{name}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.hexdigest()


@cache
def _templates(folder: Path) -> tuple[Path, ...]:
    """The template files of one of our packages."""
    if folder.is_relative_to(ROOT) and folder.relative_to(ROOT).parts[:1] in {(name,) for name in PACKAGES}:
        return tuple(path for path in folder.joinpath(TEMPLATES).rglob("*") if path.is_file())
    return ()


# A file is named once by each module that imports it, for each stage.
@cache
def _name(file: Path) -> str:
    return file.relative_to(ROOT).as_posix() if file.is_relative_to(ROOT) else file.name


@cache
def _parents(folder: Path) -> tuple[Path, ...]:
    """The ``__init__.py`` files that run before a module of this folder is imported."""
    if folder == ROOT or not folder.is_relative_to(ROOT):
        return ()
    own = folder / "__init__.py"
    return (*((own,) if own.is_file() else ()), *_parents(folder.parent))


@cache
def _imports(file: Path) -> tuple[Path, ...]:
    """Files of ours that the import statements of `file` name; each file is parsed once in a process."""
    return tuple(_named_by_statements(file))


def _named_by_statements(file: Path) -> Iterator[Path]:
    text = file.read_bytes()
    tree = ast.parse(text, filename=str(file))
    # A call can stand in any expression, and to look at all of them takes as long as the parser does.
    anywhere = any(call.encode() in text for call in IMPORT_CALLS)
    for node in ast.walk(tree) if anywhere else _statements(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield from _module(alias.name)
        elif isinstance(node, ast.ImportFrom):
            package = _absolute(file, node)
            for alias in node.names:
                yield from _module(f"{package}.{alias.name}") or _module(package)
        elif isinstance(node, ast.Call) and _is_import_call(node):
            yield from _dynamic(node)


def _statements(tree: ast.Module) -> Iterator[ast.AST]:
    """The statements of a module, those within others included."""
    ahead: list[ast.AST] = [tree]
    while ahead:
        node = ahead.pop()
        yield node
        for part in ("body", "orelse", "finalbody", "handlers", "cases"):
            ahead.extend(getattr(node, part, ()))


@cache
def _module(name: str) -> tuple[Path, ...]:
    """The file of the module `name`, empty if it is not one of ours."""
    if name.split(".", 1)[0] not in PACKAGES:
        return ()
    path = ROOT.joinpath(*name.split("."))
    for file in (path.with_suffix(".py"), path / "__init__.py"):
        if file.is_file():
            return (file,)
    return ()


def _absolute(file: Path, node: ast.ImportFrom) -> str:
    """The absolute name of the package or module an import takes names from."""
    if node.level == 0:
        return node.module or ""
    if not file.is_relative_to(ROOT):
        return ""
    package = file.relative_to(ROOT).parts[: -node.level]
    return ".".join((*package, node.module) if node.module else package)


def _is_import_call(node: ast.Call) -> bool:
    called = node.func
    name = called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")
    return name in IMPORT_CALLS


def _dynamic(node: ast.Call) -> Iterator[Path]:
    """Files behind ``import_module(...)``: the one named, or all of ours if the name is computed."""
    name = node.args[0] if node.args else None
    if isinstance(name, ast.Constant) and isinstance(name.value, str):
        yield from _module(name.value)
        return
    for package in PACKAGES:
        yield from sorted((ROOT / package).rglob("*.py"))
