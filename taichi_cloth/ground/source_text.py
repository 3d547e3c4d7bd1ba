"""The source of what kernels are made of, read once.

Taichi 1.7 copies a `ti.func` to each place that it is called from, and finds its source each time: it goes through the
file for where the function ends, wraps its lines and parses them. A kernel of many parts calls thousands, in each
process anew: for its hash, whether it comes from the cache or not.
"""

import ast
import textwrap
from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

from taichi.lang import kernel_impl

__all__ = ["read_once"]


class _Source:
    """lines: of a function as Taichi wants them. first: number of the first. free: it as trees, of those that are not
    being gone through, each with all of its nodes."""

    def __init__(self, function: Callable[..., Any]) -> None:
        lines, self.first = _lines(function)
        self.lines = [textwrap.fill(line, tabsize=4, width=9999) for line in lines]
        self.free: list[tuple[ast.Module, list[ast.AST]]] = []

    def parsed(self) -> ast.Module:
        tree = ast.parse(textwrap.dedent("\n".join(self.lines)))
        tree.body[0].decorator_list = []  # pyright: ignore[reportAttributeAccessIssue]
        return tree

    def take(self) -> tuple[ast.Module, list[ast.AST]]:
        """A tree that nobody goes through: what does leaves its findings at its nodes, so a function that is copied
        into itself needs two."""
        if self.free:
            return self.free.pop()
        tree = self.parsed()
        return tree, list(ast.walk(tree))


_sources: WeakKeyDictionary[Callable[..., Any], _Source] = WeakKeyDictionary()


def _tree_and_context(
    self: Any,
    excluded_parameters: tuple[int, ...] = (),
    is_kernel: bool = True,
    arg_features: Any = None,
    args: Any = None,
    ast_builder: Any = None,
    is_real_function: bool = False,
) -> tuple[ast.Module, Any]:
    """As Taichi's own. Kernels and routines are gone through once, and lose their arguments by it."""
    source = _sources.get(self.func)
    if source is None:
        source = _sources[self.func] = _Source(self.func)
    once = is_kernel or is_real_function
    names = kernel_impl._get_global_vars(self.func)
    if once:
        names |= {self.arguments[i].name: args[i] for i in self.template_slot_locations}
    context: Any = kernel_impl.ASTTransformerContext(
        excluded_parameters=excluded_parameters,
        is_kernel=is_kernel,
        func=self,
        arg_features=arg_features,
        global_vars=names,
        argument_data=args,
        src=source.lines,
        start_lineno=source.first,
        file=self.func.__code__.co_filename,
        ast_builder=ast_builder,
        is_real_function=is_real_function,
    )
    if once:
        return source.parsed(), context
    tree, context.nodes = source.take()
    context.source = source
    return tree, context


def _transform(tree: ast.Module, context: Any) -> Any:
    out = _theirs_transform(tree, context)
    source = getattr(context, "source", None)
    if source is not None:
        for node in context.nodes:  # it holds fields, and what is an expression here may be none the next time
            node.__dict__.pop("ptr", None)
            node.__dict__.pop("caller", None)
        source.free.append((tree, context.nodes))
    return out


_lines, _theirs_transform = kernel_impl.getsourcelines, kernel_impl.transform_tree


def read_once() -> None:
    """From now on, of all kernels."""
    kernel_impl._get_tree_and_ctx = _tree_and_context  # pyright: ignore[reportAttributeAccessIssue]
    kernel_impl.transform_tree = _transform  # pyright: ignore[reportAttributeAccessIssue]
