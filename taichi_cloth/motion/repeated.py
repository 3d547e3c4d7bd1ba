"""A kernel that is called many times in a row with the same arrays.

Each call of a Taichi kernel looks up in Python what is compiled for its arguments, and what each of these is: 0.1 ms,
as long as the substeps of a small sheet take from one proof that cloth did not pass through itself to the next. Here
that is done once for a row of calls.
"""

from typing import Any

import numpy as np
import taichi as ti
from taichi.lang import impl

from taichi_cloth.ground import runtime

__all__ = ["Repeated"]


class Repeated:
    """Calls of one kernel with the same arrays, which stay where they are meanwhile. method: a `ti.kernel` of an object
    that returns nothing or a whole number. args: its arguments; of them numbers may change from call to call, which are
    given by name. On devices, and where another Taichi launches otherwise, each call is Taichi's own."""

    def __init__(self, method: Any, *args: Any) -> None:
        self._method, self._args, self._ready = method, list(args), None
        self._own = False
        self._names = {one.name: k for k, one in enumerate(method._primal.arguments[1:])}

    def __call__(self, **numbers: float) -> int:
        if self._ready is None:
            for name, value in numbers.items():
                self._args[self._names[name]] = value
            if self._own or not runtime.on_host():
                return self._method(*self._args)
            try:
                self._ready = self._prepare()
            except (AttributeError, TypeError):  # of a Taichi with other inner calls than 1.7's
                self._own = True
                return self._method(*self._args)
        context, compiled, kernel, at = self._ready
        for name, value in numbers.items():
            place, whole = at[name]
            if whole:
                context.set_arg_int(place, int(value))
            else:
                context.set_arg_float(place, float(value))
        _program().launch_kernel(compiled, context)
        return context.get_struct_ret_int((0,)) if kernel.return_type is not None else 0

    def _prepare(self) -> tuple[Any, Any, Any, dict[str, tuple[tuple[int], bool]]]:
        """What Taichi launches, and the places of its numbers, by name, and whether they are whole: as
        `Kernel.launch_kernel` of Taichi does it for each call."""
        kernel, owner = self._method._primal, self._method._kernel_owner
        made = kernel.compiled_kernels[kernel.ensure_compiled(owner, *self._args)]
        context, places = made.make_launch_context(), {}
        for argument, value in zip(kernel.arguments[1:], self._args, strict=True):
            place = (len(places),)
            if isinstance(argument.annotation, ti.template):
                continue
            if isinstance(value, np.ndarray):
                assert value.flags.c_contiguous, f"{argument.name}: an array that does not lie in one piece"
                context.set_arg_external_array_with_shape(place, value.ctypes.data, value.nbytes, value.shape, 0)
            elif argument.annotation is ti.i32:
                context.set_arg_int(place, int(value))
            else:
                context.set_arg_float(place, float(value))
            places[argument.name] = place, argument.annotation is ti.i32
        program = _program()
        compiled = program.compile_kernel(program.config(), program.get_device_caps(), made)
        return context, compiled, kernel, places


def _program() -> Any:
    return impl.get_runtime().prog
