"""How much memory there is, and the refusal of what would not fit, before any of it is taken."""

import os

from taichi_cloth.ground.errors import InputError

__all__ = ["memory_limit", "require_memory"]


def memory_limit() -> int:
    """Bytes a build may take here: nine tenths of what is free now, or TAICHI_CLOTH_MEMORY_GB if that is set.

    Raises InputError when the variable is not a positive number.
    """
    stated = os.environ.get("TAICHI_CLOTH_MEMORY_GB")
    if stated is not None:
        try:
            gigabytes = float(stated)
        except ValueError:
            gigabytes = -1.0
        if not 0 < gigabytes < float("inf"):
            raise InputError(f"TAICHI_CLOTH_MEMORY_GB: {stated!r}; allowed: a number of gigabytes above 0")
        return int(gigabytes * 1e9)
    free = _available_bytes()
    return int(0.9 * free)


def _available_bytes() -> int:
    try:
        with open("/proc/meminfo", encoding="ascii") as lines:
            for line in lines:
                if line.startswith("MemAvailable:"):
                    return int(line.split()[1]) * 1024
    except OSError:
        pass
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2
    except (ValueError, OSError, AttributeError):
        return 4 * 10**9


def require_memory(what: str, needed: int, remedy: str) -> None:
    """Refuse with InputError when `needed` bytes are more than `memory_limit`: the estimate, the limit, what to do."""
    limit = memory_limit()
    if needed > limit:
        raise InputError(
            f"{what}: needs about {needed / 1e9:,.1f} GB; the limit here is {limit / 1e9:,.1f} GB "
            f"(nine tenths of free memory, or TAICHI_CLOTH_MEMORY_GB); {remedy}"
        )
