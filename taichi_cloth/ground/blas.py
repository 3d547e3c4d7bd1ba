"""One thread for linear algebra in small pieces: with a second one, handing over takes longer than the work."""

from contextlib import AbstractContextManager
from functools import lru_cache

from threadpoolctl import ThreadpoolController

__all__ = ["one_thread"]


@lru_cache(maxsize=1)
def _libraries() -> ThreadpoolController:
    """The linear algebra that is loaded, SciPy's too; looking takes milliseconds."""
    import scipy.linalg  # noqa: F401  # loads its own

    return ThreadpoolController()


def one_thread() -> AbstractContextManager[object]:
    """BLAS and LAPACK calls within take one thread, and round the same on any number of processors."""
    return _libraries().limit(limits=1, user_api="blas")
