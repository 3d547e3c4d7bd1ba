"""`taichi-cloth body …`: what the command line says of bodies; the work is imported when it is asked for."""

from pathlib import Path
from typing import Annotated, Any

import typer

__all__ = ["body_app"]

body_app = typer.Typer(no_args_is_help=True, help="The body: its parts, and primitives for contact.")
Source = Annotated[str, typer.Argument(help="A mesh file, or built-in:female, built-in:male, anny:female, anny:male.")]


@body_app.callback()
def body() -> None:
    """The body: its parts, and primitives for contact."""


@body_app.command("fit")
def fit(
    source: Source,
    out: Annotated[Path, typer.Option("--out", help="Where the primitives go.")] = Path("body.json"),
    count: Annotated[int, typer.Option("--count", help="Most primitives.")] = 32,
    error_mm: Annotated[float | None, typer.Option("--error-mm", help="Stop at this mean distance.")] = None,
    compare: Annotated[bool, typer.Option("--compare", help="Time the primitives against the mesh itself.")] = False,
    arch: Annotated[Any, typer.Option("--arch", help="cpu, cuda, vulkan, metal or gpu.")] = "cpu",
) -> None:
    """Divide a body, wrap its parts in primitives, print the error, and draw both beside the JSON file."""
    from .body_fit import fit_body

    fit_body(source, out, count=count, error_mm=error_mm, compare=compare, arch=arch)
