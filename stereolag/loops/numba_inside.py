"""All uses of Numba's undocumented internals: vector registers, and storing and loading machine code.

Instructions for vector registers are written with Numba's code generator. Stored machine code is loaded without Numba,
whose import takes longer than most measurements: it only needs LLVM's loader and the C modules of Numba that it calls.
If anything differs from the state at compilation, nothing is loaded, and Numba compiles again.
"""

from __future__ import annotations

import builtins
import ctypes
import gc
import hashlib
import pickle
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from llvmlite import ir
    from numba.core import cgutils, types

__all__ = [
    "LANES",
    "MachineCode",
    "cgutils",
    "compile_loop",
    "ir",
    "load",
    "numba",
    "processor",
    "runtime",
    "types",
    "version",
]

LANES = 16
"""Numbers in one value of vector registers."""

MODULES = {"ir": "llvmlite.ir", "cgutils": "numba.core.cgutils", "types": "numba.core.types"}
"""Modules that instructions are written with, loaded when a loop is first compiled."""

RUNTIME = ("numba._dynfunc", "numba._helperlib", "numba.core.runtime._nrt_python")
"""Numba's C modules that machine code calls: functions as Python objects, conversions, memory of arrays."""


class MachineCode(NamedTuple):
    """The compiled code of a loop for arguments of certain types."""

    code: bytes
    """An object file of the machine that compiled it."""
    entry: str
    """The symbol of the function that takes Python's arguments."""
    environments: tuple[tuple[str, list[Any]], ...]
    """Symbols and constants of the Python objects that the code uses; the loop's own come first."""
    calls: tuple[str, ...]
    """Symbols that the process must provide."""

    def packed(self) -> bytes:
        """Return it as bytes for a file, with their checksum."""
        content = pickle.dumps(tuple(self))
        return hashlib.sha256(content).digest() + content

    @classmethod
    def unpacked(cls, data: bytes) -> MachineCode | None:
        """Return what :meth:`packed` made; None for anything else."""
        checksum, content = data[:32], data[32:]
        return cls(*pickle.loads(content)) if hashlib.sha256(content).digest() == checksum else None


def __getattr__(name: str) -> ModuleType:
    """Return one of the modules that instructions are written with."""
    if name not in MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(MODULES[name])


@cache
def version() -> bytes:
    """Return the versions of Numba and llvmlite, without loading them; raises ImportError."""
    return b"".join(_folder(name).joinpath("_version.py").read_bytes() for name in ("numba", "llvmlite"))


def _folder(name: str) -> Path:
    spec = find_spec(name)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    return Path(spec.origin).parent


@cache
def processor() -> str:
    """Return the name and features of the processor for which machine code is made."""
    from llvmlite import binding

    return f"{binding.get_host_cpu_name()} {binding.get_host_cpu_features().flatten()}"


@cache
def numba(deferred: type) -> ModuleType:
    """Load Numba, and let it replace objects of type `deferred` in loops by the results of their method ``made``."""
    context = import_module("numba.core.registry").cpu_target.typing_context
    extending = import_module("numba.extending")
    extending.typeof_impl.register(deferred)(lambda value, _: context.resolve_value_type(value.made()))
    return import_module("numba")


def compile_loop(dispatcher: Any, arguments: tuple[Any, ...]) -> tuple[Callable[..., Any], MachineCode | None]:
    """Compile a loop for arguments of these types.

    Parameters
    ----------
    dispatcher
        The function, as Numba compiles it.
    arguments
        Arguments of a call.

    Returns
    -------
    tuple
        The function to call, and its machine code; None if it cannot be used by another process.
    """
    from numba import typeof

    signature = tuple(map(typeof, arguments))
    collects = gc.isenabled()
    gc.disable()  # a collection takes a tenth of a compilation and finds little
    try:
        function = dispatcher.compile(signature)
    finally:
        if collects:
            gc.enable()
    result = dispatcher.overloads[signature]
    if result.lifted or result.reload_init or result.library.has_dynamic_globals:
        return function, None
    code, _ = result.library.serialize_using_object_code()[2]
    used = (result.environment, *result._find_referenced_environments())
    environments = {environment.env_name: environment.consts for environment in used}
    module = result.library._final_module
    declared = [symbol.name for symbol in (*module.functions, *module.global_variables) if symbol.is_declaration]
    calls = tuple(name for name in declared if not name.startswith("llvm."))
    return function, MachineCode(code, result.fndesc.llvm_cpython_wrapper_name, tuple(environments.items()), calls)


def load(kept: MachineCode, function: FunctionType) -> Callable[..., Any] | None:
    """Load machine code into this process.

    Parameters
    ----------
    kept
        The machine code.
    function
        The function that was compiled.

    Returns
    -------
    callable or None
        The function to call; None if the process lacks a symbol that the code calls (LLVM would end the process).
    """
    binding, make_function, environment = runtime()
    machine = binding.Target.from_default_triple().create_target_machine()
    engine = binding.create_mcjit_compiler(binding.parse_assembly(""), machine)
    if any(binding.address_of_symbol(name) is None for name in kept.calls):
        return None
    engine.add_object_file(binding.ObjectFileRef.from_data(kept.code))
    engine.finalize_object()
    environments = []
    for name, constants in kept.environments:
        environments.append(environment(function.__globals__))
        environments[-1].consts[:] = constants
        if address := engine.get_global_value_address(name):
            ctypes.c_void_p.from_address(address).value = id(environments[-1])
    return make_function(  # type: ignore[no-any-return]
        sys.modules.get(function.__module__),
        function.__name__,
        function.__doc__ or "",
        engine.get_function_address(kept.entry),
        environments[0],
        (engine, *environments),  # they must live as long as the function
    )


@cache
def runtime() -> tuple[Any, Callable[..., Any], type[Any]]:
    """Load everything that machine code calls.

    Returns LLVM's loader, and Numba's constructors of functions and of environments. Numba later finds its C modules
    loaded, and gives their symbols the same addresses again.
    """
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    functions, helpers, memory = map(_c_module, RUNTIME)
    kinds = [kind for kind in vars(builtins).values() if isinstance(kind, type) and issubclass(kind, BaseException)]
    symbols = {f"PyExc_{kind.__name__}": id(kind) for kind in kinds} | {"_Py_NoneStruct": id(None)}
    for prefix, module in (("numba_", functions), ("numba_", helpers), ("NRT_", memory)):
        symbols |= {
            name if name[0] == "_" and module is memory else prefix + name: at for name, at in module.c_helpers.items()
        }
    for name, address in symbols.items():
        binding.add_symbol(name, address)
    _restore_without_numba(helpers.c_helpers["unpickle"])
    return binding, functions.make_function, functions.Environment


def _restore_without_numba(address: int) -> None:
    """Let the C function at `address` unpickle the objects of machine code, such as the class of an array it returns.

    On its first call, it takes the function that does so from a module of Numba and keeps it. Here, that module is a
    stand-in with a function that does not need Numba.
    """
    if "numba" in sys.modules:
        return
    name = "numba.core.serialize"
    module = ModuleType(name)
    module._numba_unpickle = cache(lambda _place, pickled, _checksum: pickle.loads(pickled))  # type: ignore[attr-defined]
    sys.modules |= {"numba": ModuleType("numba"), name: module}
    try:
        restore = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p)(address)
        pickled = pickle.dumps(None)
        restore(pickled, len(pickled), bytes(20))
    finally:
        del sys.modules["numba"], sys.modules[name]


def _c_module(name: str) -> Any:
    """Return a C module of Numba, without importing the packages that it is in."""
    if name not in sys.modules:
        file = _folder("numba").joinpath(*name.split(".")[1:])
        (path,) = (path for suffix in EXTENSION_SUFFIXES if (path := file.with_name(file.name + suffix)).exists())
        spec = spec_from_file_location(name, path)
        assert spec is not None and spec.loader is not None
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
        sys.modules[name] = module
    return sys.modules[name]
