"""The only place that starts Taichi: which device, how many threads, where compiled kernels are kept.

Every `ti.init` throws away all fields and kernels of the one before it, so nothing here runs at import: the
command line, the tests and a person's own script call `start` once, before the first field is made.
"""

import atexit
import contextlib
import io
import os
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, get_args

import taichi as ti
from taichi.lang.ast.ast_transformer_utils import ASTTransformerContext
from taichi.lang.impl import current_cfg, default_cfg, get_runtime

from taichi_cloth.ground.cache import can_keep
from taichi_cloth.ground.errors import InputError, did_you_mean
from taichi_cloth.ground.source_text import read_once
from taichi_cloth.ground.whole_vectors import kept_as_vectors

__all__ = ["Arch", "Runtime", "close_tree", "generation", "on_host", "plain_code", "resident", "start", "threads"]

Arch = Literal["cpu", "cuda", "vulkan", "metal", "gpu"]


@dataclass(frozen=True)
class Runtime:
    """What was started: the device's name in Taichi ("x64", "cuda", …), the CPU threads it may use, and whether long
    kernels are drafts."""

    arch: str
    threads: int
    draft: bool = False


_started: list[Runtime] = []  # all starts of this process, the last one valid


def generation() -> int:
    """How many times Taichi was started: fields and kernels made under another number are gone."""
    return len(_started)


def threads() -> int:
    """CPU threads that kernels may use; 1 before `start`."""
    return _started[-1].threads if _started else 1


def on_host() -> bool:
    """Whether kernels run on the CPU, where NumPy and Taichi see the same memory."""
    return bool(_started) and _started[-1].arch in ("x64", "arm64")


def resident() -> bool:
    """Whether kernels take arrays where they lie on the device (`copies.DeviceArray`), as CUDA's do. Other devices are
    sent NumPy's arrays at each call."""
    return bool(_started) and _started[-1].arch == "cuda"


def start(
    arch: Arch = "cpu", *, threads: int | None = None, cache: bool = True, pin: bool = False, draft: bool = False
) -> Runtime:
    """Start Taichi on `arch`. Kernels compiled before, in this or an earlier process, come from the cache.

    threads: CPU threads for kernels; None takes the processors this process may run on.
    cache: keep compiled kernels on disk between processes (Taichi's offline cache).
    pin: tie each worker thread to one processor, which steadies timings on virtual machines (Linux only).
    draft: long kernels (`plain_code`) are compiled without Taichi's search for what is reckoned twice, 40 to 75 % of
        compiling; they run half as fast, to the same bytes. For tests, which run them for moments.

    Raises InputError when the name is unknown, the device is not there, or `threads` is below 1.
    """
    if arch not in get_args(Arch):
        raise InputError(
            f"--arch: unknown device {arch!r}; known: {', '.join(get_args(Arch))}{did_you_mean(arch, get_args(Arch))}"
        )
    processors = _processors()
    if threads is not None and not 1 <= threads <= 1024:
        raise InputError(f"--threads: {threads}; allowed: 1 to 1024 (this process may use {processors})")
    workers = threads or processors
    before = _thread_ids()
    ASTTransformerContext.get_pos_info = _line_of  # pyright: ignore[reportAttributeAccessIssue]
    read_once()
    options: dict[str, Any] = {
        "arch": getattr(ti, arch),
        "cpu_max_num_threads": workers,
        "offline_cache": cache,
        "log_level": ti.ERROR,
        "fast_math": False,  # reproducible sums, and faster vector code here (simulation stencil)
        "random_seed": 0,
    }
    if not can_keep(
        _kernel_folder()
    ):  # Taichi would crash at the end: it writes there, whether it keeps kernels or not
        options |= {"offline_cache": False, "offline_cache_file_path": _passing_folder()}
    with contextlib.redirect_stdout(io.StringIO()):  # ti.init prints where it starts, whatever the log level
        ti.init(**options)
    got = str(current_cfg().arch).removeprefix("Arch.")
    wanted = {"cpu": {"x64", "arm64"}, "gpu": {"cuda", "vulkan", "metal", "opengl", "amdgpu"}}.get(arch, {arch})
    if got not in wanted:
        raise InputError(f"--arch {arch}: no such device on this machine (Taichi fell back to {got}); use --arch cpu")
    if pin and workers > 1:
        _pin(sorted(_thread_ids() - before)[-workers:])
    _started.append(Runtime(arch=got, threads=workers, draft=draft))
    return _started[-1]


MANY = 128
"""Fields that may wait for others."""


def close_tree() -> None:
    """The fields made so far become one piece of memory, a tree, if they are many. To be called after each group of
    some hundred that belong together: Taichi makes a tree of all that are made before a kernel runs, which on a CPU and
    with CUDA takes 511 (1,024 nodes, two a field, and the root), and ends in an assertion beyond. Of trees a kernel
    takes some 30, with Vulkan."""
    if len(get_runtime().global_vars) > MANY:
        ti.sync()


@contextlib.contextmanager
def plain_code(*, routines: bool = False, kept: bool = True, whole: bool = False) -> Iterator[None]:
    """Kernels first called within are compiled without Taichi's own analysis of which loads repeat.

    For long kernels with many stores it takes three quarters of the compile time and gains nothing; LLVM does it too.
    routines: they call some (`routine.py`). Then no element of a field is kept in a register for a loop either, which
    Taichi does even where the loop calls a routine that changes it. kept: between processes; not what holds an address
    of this one. whole: on a CPU vectors stay whole (`whole_vectors.py`, which says of which kernels).
    """
    config = current_cfg()
    names = "cfg_optimization", "cache_loop_invariant_global_vars", "offline_cache", "opt_level"
    before = {name: getattr(config, name) for name in names}
    config.cfg_optimization = False
    config.cache_loop_invariant_global_vars = config.cache_loop_invariant_global_vars and not routines
    config.offline_cache = config.offline_cache and kept
    if _started and _started[-1].draft:
        config.opt_level = 0  # with the other off, the search is all that hangs on it
    try:
        with kept_as_vectors() if whole and on_host() else contextlib.nullcontext():
            yield
    finally:
        for name, value in before.items():
            setattr(config, name, value)


def _line_of(context: Any, node: Any) -> str:
    """Where a piece of a kernel stands. Taichi's own draws the line with carets below, of each expression, for an error
    that may come: half of the time that Python takes for a kernel from the cache."""
    return f'File "{context.file}", line {node.lineno + context.lineno_offset}, in {context.func.func.__name__}:\n'


def _kernel_folder() -> Path:
    """Where Taichi keeps compiled kernels."""
    return Path(os.environ.get("TI_OFFLINE_CACHE_FILE_PATH") or default_cfg().offline_cache_file_path)


@lru_cache(maxsize=1)
def _passing_folder() -> str:
    """A folder that goes when this process ends, after Taichi has."""
    folder = tempfile.mkdtemp(prefix="taichi-cloth-")

    def leave() -> None:
        ti.reset()
        shutil.rmtree(folder, ignore_errors=True)

    atexit.register(leave)
    return folder


def _processors() -> int:
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1


def _thread_ids() -> set[int]:
    try:
        return {int(name) for name in os.listdir("/proc/self/task")}
    except OSError:
        return set()


def _pin(thread_ids: list[int]) -> None:
    if not hasattr(os, "sched_setaffinity"):
        return
    processors = sorted(os.sched_getaffinity(0))
    for number, thread_id in enumerate(thread_ids):
        os.sched_setaffinity(thread_id, {processors[number % len(processors)]})
