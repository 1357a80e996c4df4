"""Small changes to a module that its tests ought to notice: one at a time, the same ones for the same seed."""

from __future__ import annotations

import ast
import random
from collections.abc import Callable, Iterator
from typing import NamedTuple

OPERATORS = {ast.Add: ast.Sub, ast.Mult: ast.Div, ast.Lt: ast.LtE, ast.Gt: ast.GtE, ast.Eq: ast.NotEq, ast.And: ast.Or}
OPERATORS |= {new: old for old, new in OPERATORS.items()}
NAMES = {"min": "max", "fmin": "fmax", "minimum": "maximum", "any": "all", "floor": "ceil"}
NAMES |= {new: old for old, new in NAMES.items()}
NUMBERS: tuple[Callable[[float], float], ...] = (
    lambda value: value * (1 + 1e-3) if isinstance(value, float) else value + 1,
    lambda value: 0 * value,
)


class Mutant(NamedTuple):
    """A changed module: its tree, and what the change is, to read."""

    tree: ast.Module
    line: int
    change: str


class _Change(NamedTuple):
    shown: ast.AST  # the expression in which the change can be read
    apply: Callable[[], None]


def _set(node: ast.AST, field: str, value: object) -> Callable[[], None]:
    return lambda: setattr(node, field, value)


def _replace(parent: ast.AST, old: ast.AST, new: ast.AST) -> Callable[[], None]:
    def apply() -> None:
        for field, value in ast.iter_fields(parent):
            if value is old:
                setattr(parent, field, new)
            elif isinstance(value, list):
                value[:] = [new if part is old else part for part in value]

    return apply


def _of_node(node: ast.AST, parent: ast.AST) -> Iterator[_Change]:
    match node:
        case ast.BinOp(op=op) | ast.AugAssign(op=op) | ast.BoolOp(op=op) if type(op) in OPERATORS:
            yield _Change(node, _set(node, "op", OPERATORS[type(op)]()))
        case ast.Compare(ops=[op, *others]) if type(op) in OPERATORS:
            yield _Change(node, _set(node, "ops", [OPERATORS[type(op)](), *others]))
        case ast.UnaryOp(op=ast.Not() | ast.USub() | ast.Invert()):
            yield _Change(parent, _replace(parent, node, node.operand))
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            for changed in {repr(change(value)): change(value) for change in NUMBERS}.values():
                if changed != value:
                    yield _Change(parent, _set(node, "value", changed))
        case ast.Name(id=name) if name in NAMES:
            yield _Change(parent, _set(node, "id", NAMES[name]))
        case ast.Attribute(attr=name) if name in NAMES:
            yield _Change(parent, _set(node, "attr", NAMES[name]))
        case ast.FunctionDef(body=[*body]):
            yield _Change(node.args, _set(node, "body", [ast.Return(None), *body]))


def _changes(node: ast.AST) -> Iterator[_Change]:
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns"):  # nobody evaluates them
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _of_node(child, node)
                yield from _changes(child)


def count(source: str) -> int:
    """Return how many mutants a module has."""
    return sum(1 for _ in _changes(ast.parse(source)))


def mutant(source: str, index: int) -> Mutant:
    """Return one of the mutants of a module, 0 <= index < count(source)."""
    tree = ast.parse(source)
    shown, apply = list(_changes(tree))[index]
    line = next(node.lineno for node in ast.walk(shown) if hasattr(node, "lineno")) if _lines(shown) else 0
    before = _text(shown)
    apply()
    after = _text(shown)
    if before == after:  # of a function only the arguments are shown
        before, after = f"def …({before})", "returns at once"
    return Mutant(ast.fix_missing_locations(tree), line, f"{before}  →  {after}")


def _lines(node: ast.AST) -> bool:
    return any(hasattr(part, "lineno") for part in ast.walk(node))


def _text(node: ast.AST) -> str:
    return ast.unparse(node).partition("\n")[0][:160]


def chosen(source: str, most: int, seed: int) -> list[int]:
    """Return the indices of `most` mutants, drawn without regard to where they are; all if there are no more."""
    total = count(source)
    return sorted(random.Random(seed).sample(range(total), min(most, total)))
