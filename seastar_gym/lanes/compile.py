"""How kernels are compiled and cached.

`kernel`, `inlined_kernel` and `rare_kernel` compile building blocks; `entry_point` compiles a function that Python
calls, releases the GIL and keeps the machine code on disk. Numba's own cache looks at the file of the cached function
only, so an edit in a called file would silently run the old code. Ours lives in a folder named after a digest of every
file of the package that defines kernels, the versions of numba, llvmlite and numpy and the lane width: whatever
changes, the old code cannot be found. Every file begins with a digest of the rest: what was cut off or written over is
not there, and is compiled and written anew. What cannot be written is compiled in every process, and so is all where
others than the user could have written it: numba keeps pickles. Processes that want the same code at once wait for the
first of them, which compiles it, and load it then.
"""

import contextlib
import functools
import hashlib
import logging
import os
import pickle
import secrets
import stat
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FunctionType

import llvmlite
import numba
import numpy as np
from numba.core import types
from numba.core.caching import FunctionCache, IndexDataCacheFile, UserWideCacheLocator
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher
from numba.core.runtime import rtsys

from seastar_gym.lanes.pipeline import EntryCompiler, KernelCompiler, compiler_of
from seastar_gym.lanes.registers import N_LANES, PLAIN, Form
from seastar_gym.process import held_back, let_through

PACKAGE = Path(__file__).resolve().parent.parent
DIGEST_SIZE = hashlib.sha256().digest_size  # bytes
PATIENCE = 300.0  # s; a process that compiles one kind for longer was stopped, and the others compile for themselves

# error_model="numpy": divisions follow IEEE instead of raising; failure is a status, not an exception.
STRICT = {"error_model": "numpy", "nogil": True, "pipeline_class": EntryCompiler}
# Without wrappers for Python, which would be a third of the compilation, and without counts of references.
BLOCK = {
    **STRICT, "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "_nrt": False, "pipeline_class": KernelCompiler,
}  # fmt: skip


class Kernel(CPUDispatcher):
    """A building block of compiled code, without the wrapper that a call from Python would need."""

    def compile(self, sig):
        """Compile for these types of arguments, unless it was: numba's own method would have every kernel timed.

        A literal 0 is any integer: what it decides goes when the caller is optimised.
        """
        sig = tuple(map(types.unliteral, sig))
        with global_compiler_lock:
            if sig not in self.overloads:
                with self._compiling_counter:
                    self.add_overload(self._compiler.compile(sig, None))

    def __call__(self, *args, **kwargs):
        return self.py_func(*args, **kwargs)


def kernel(function, **options):
    """Compile `function` as a building block. Called in Python it is that, on the lanes of plain.py."""
    compiled = numba.njit(**BLOCK, **options)(function)
    if isinstance(compiled, CPUDispatcher):  # nothing is with NUMBA_DISABLE_JIT=1
        compiled.__class__ = Kernel  # numba offers no other way to say how its dispatchers are called
    return compiled


# Where calls are many, and each would pass the fifty pointers of rods and work: together a tenth of a stroke.
inlined_kernel = functools.partial(kernel, forceinline=True)


def rare_kernel(function):
    """Compile what hardly any step calls, and leave it out of its caller, whose common way is slower with it."""
    function.is_rare = True
    return kernel(function)


def kernel_sources(package: Path = PACKAGE) -> list[Path]:
    """The files that machine code may come from: those of `rods` and `lanes`, and any other that names this module."""
    rooms = {package / "rods", package / "lanes"}
    return [
        path
        for path in sorted(package.rglob("*.py"))
        if rooms & set(path.parents) or "lanes.compile" in path.read_text(encoding="utf-8")
    ]


def source_digest(package: Path = PACKAGE, numpy_version: str = "") -> str:
    """Hexadecimal digest of everything that the machine code depends on. numpy_version: That of this process if ""."""
    numpy_version = numpy_version or np.__version__
    versions = f"numba {numba.__version__} llvmlite {llvmlite.__version__} numpy {numpy_version} lanes {N_LANES}"
    digest = hashlib.sha256(versions.encode())
    for source in kernel_sources(package):
        digest.update(str(source.relative_to(package)).encode() + b"\0" + source.read_bytes())
    return digest.hexdigest()[:32]


digest_of_this_process = functools.cache(source_digest)


# Only this user, or root, may have put code there that runs. A folder must belong to one of the two, and neither group
# nor others may write in it; nor in a folder above it, through which it could be replaced, but for sticky ones such as
# /tmp. Windows has no such bits, and is not asked.
WRITABLE = stat.S_IWGRP | stat.S_IWOTH
FOLDER, FILE = 0o755, 0o644
"""Rights of what is made here, whatever the umask adds."""


class ForeignFolderError(Exception):
    """A folder whose files others may have written; says why, to end a sentence with."""


def own_folder(folder: Path) -> Path:
    """The folder without links, made if it is not there. ForeignFolderError, or OSError where it cannot be made."""
    folder = folder.resolve()
    missing = [place for place in (folder, *folder.parents) if not place.exists()]
    require_own(folder)
    for place in reversed(missing):
        place.mkdir(FOLDER, exist_ok=True)
    require_own(folder)  # another may have been faster in a sticky folder
    return folder


def require_own(folder: Path) -> None:
    """ForeignFolderError unless only this user, or root, can write into a folder without links, as far as it exists."""
    for place in filter(Path.exists, (folder, *folder.parents)):
        found, is_above = place.stat(), place != folder
        of_system = is_above and found.st_uid == Path(place.anchor).stat().st_uid  # in some containers root is nobody
        if _is_foreign(found) and not of_system:
            raise ForeignFolderError(f"{place} belongs to another user")
        if _is_writable(found) and not (is_above and found.st_mode & stat.S_ISVTX):
            raise ForeignFolderError(f"others than its owner may write in {place}")


def is_own(found: os.stat_result) -> bool:
    """Whether only this user, or root, can have written a file."""
    return not (_is_foreign(found) or _is_writable(found))


def _is_foreign(found: os.stat_result) -> bool:
    return hasattr(os, "geteuid") and found.st_uid not in (0, os.geteuid())


def _is_writable(found: os.stat_result) -> bool:
    return hasattr(os, "geteuid") and bool(found.st_mode & WRITABLE)


def opened_by_owner(file: str, flags: int) -> int:
    """Opener of a new file into which no other user can write."""
    return os.open(file, flags, FILE)


class _DigestLocator(UserWideCacheLocator):
    """Numba's user-wide cache folder, with our digest as the folder's name and as the source stamp."""

    def __init__(self, py_func, py_file):
        super().__init__(py_func, py_file)
        root = Path(numba.config.CACHE_DIR) if numba.config.CACHE_DIR else Path(self._cache_path).parent
        self._cache_path = str(root / f"seastar_gym-{digest_of_this_process()}")

    def ensure_cache_path(self):
        self._cache_path = str(own_folder(Path(self._cache_path)))
        super().ensure_cache_path()

    def get_source_stamp(self):
        # An entry point may stand outside the package.
        return digest_of_this_process(), hashlib.sha256(Path(self._py_file).read_bytes()).hexdigest()


class _SoundFile(IndexDataCacheFile):
    """Numba's index and data files, each behind a digest of its content: damaged ones count as missing.

    Data are kept with their key: an index made anew may have given their file to another signature meanwhile.
    """

    def load(self, key):
        found, data = super().load(key) or (None, None)
        return data if found == key else None

    def save(self, key, data):
        super().save(key, (key, data))

    def _load_index(self):
        stamp, overloads = self._load(self._index_path) or (None, {})
        return overloads if stamp == self._source_stamp else {}

    def _save_index(self, overloads):
        self._save(self._index_path, (self._source_stamp, overloads))

    def _load_data(self, name):
        return self._load(self._data_path(name))

    def _save_data(self, name, data):
        self._save(self._data_path(name), data)

    def _load(self, path):
        content = self._sound(Path(path))
        try:
            return None if content is None else pickle.loads(content)
        except ImportError:  # another signature's code may name modules that are not here
            return None

    def _save(self, path, value):
        _leave(Path(path), self._dump(value))

    def _sound(self, path):
        return _sound(path)


# Code that a wheel may bring, for a level of x86-64 instead of a processor; cli/shipped.py compiles it. What a
# processor of a level can do is in LLVM's words, the highest level first.
SHIPPED = PACKAGE / "compiled"
_V2 = "cmov crc32 cx16 cx8 fxsr mmx popcnt sahf sse sse2 sse3 sse4.1 sse4.2 ssse3"
_V3 = f"{_V2} avx avx2 bmi bmi2 f16c fma lzcnt movbe xsave"
LEVELS = {
    "x86-64-v4": frozenset(f"{_V3} avx512bw avx512cd avx512dq avx512f avx512vl".split()),
    "x86-64-v3": frozenset(_V3.split()),
}


def levels_of(codegen) -> list[tuple[str, str]]:
    """Triple and levels whose code runs where that of `codegen` does; none where numba is told to compile otherwise."""
    triple, _, features = codegen.magic_tuple()
    config = numba.config
    otherwise = config.BOUNDSCHECK or config.DEBUGINFO_DEFAULT or config.ENABLE_PROFILING or config.OPT != 3
    able = {each[1:] for each in features.split(",") if each.startswith("+")}
    return [] if otherwise else [(triple, level) for level, needed in LEVELS.items() if needed <= able]


@functools.cache
def shipped_digest() -> str:
    """Name of the folder of shipped code: as `source_digest`, but arrays are the same in all of numpy 2."""
    return source_digest(numpy_version=np.__version__.split(".")[0])


class ShippedFile(_SoundFile):
    """Code of one entry point that came with the package, and is only read. It is as safe as the sources beside it."""

    def __init__(self, py_func, filename_base):
        source = hashlib.sha256(Path(py_func.__code__.co_filename).read_bytes()).hexdigest()
        super().__init__(str(SHIPPED / shipped_digest()), filename_base, (shipped_digest(), source))

    def _sound(self, path):
        return _sound(path, is_shipped=True)


def shipped_key(sig, index_key, target):
    """Key of shipped code: numba's, with triple and level in the place of a processor and its features."""
    return sig, target, index_key[2]


@contextlib.contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Hold a lock file, for one process at a time; whoever ends, even by a kill, lets go. Without where none can be."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError, ImportError):  # Windows has no fcntl
            import fcntl

            file = stack.enter_context(open(path, "ab", opener=opened_by_owner))
            stack.callback(fcntl.flock, file, fcntl.LOCK_UN)  # a forked child has the file open, too
            until = time.monotonic() + PATIENCE
            while time.monotonic() < until:
                with contextlib.suppress(BlockingIOError):
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                with let_through():
                    time.sleep(0.05)
        yield


class _DigestCache(FunctionCache):
    class _impl_class(FunctionCache._impl_class):  # noqa: N801 - numba's own name
        _locator_classes = (_DigestLocator,)

        def reduce(self, cres):
            """Without the environments of kernels, for which numba would import the modules of their files, also a
            user's: kernels need none, and modules may not be there or be another user's of that name."""
            *parts, environments = super().reduce(cres)
            return *parts, tuple(each for each in environments if each is cres.environment)

    def __init__(self, py_func):
        super().__init__(py_func)
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = _SoundFile(self._cache_path, self._impl.filename_base, stamp)
        self._turn = contextlib.ExitStack()

        self.is_of_package = PACKAGE in Path(py_func.__code__.co_filename).resolve().parents

    def kind(self, sig):
        """Name of the code for arguments of these types."""
        return f"{self._impl.filename_base}.{hashlib.sha256(str(sig).encode()).hexdigest()[:16]}"

    def _lock(self, name):
        return _alone(Path(self._cache_path) / f"{name}.lock")

    def load_overload(self, sig, target_context):
        found = self._kept(sig, target_context)
        if found is None:
            self._turn.enter_context(self._lock(self.kind(sig)))
            found = self._kept(sig, target_context)  # another process may have left it meanwhile
        return found or _say_that_it_compiles("once: later runs find the code")

    def _kept(self, sig, target_context):
        """Code on the disk. numba's own method registers what only compiling needs first, for a quarter of a second."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context) or self._shipped(sig, target_context)

    def _shipped(self, sig, target_context):
        """Code that came with the package for the best level that this processor has; None without."""
        if not self._enabled or not SHIPPED.is_dir():
            return None
        codegen = target_context.codegen()
        file, index_key = ShippedFile(self._py_func, self._impl.filename_base), self._index_key(sig, codegen)
        found = (file.load(shipped_key(sig, index_key, target)) for target in levels_of(codegen))
        data = next(filter(None, found), None)
        return None if data is None else self._impl.rebuild(target_context, data)

    def save_overload(self, sig, data):
        # The disk is full, or the folder is gone or no longer ours.
        with contextlib.suppress(OSError, ForeignFolderError), self._lock(self._impl.filename_base):  # of the index
            super().save_overload(sig, data)

    def end_turn(self):
        """Let other processes look for what this one wanted."""
        self._turn.close()


class _Nowhere(_DigestLocator):
    def ensure_cache_path(self):
        """Nothing is written."""


class _NoCache(_DigestCache):
    """Where no folder can be written: code that came with the package, or what every process compiles for itself."""

    class _impl_class(_DigestCache._impl_class):  # noqa: N801 - numba's own name
        _locator_classes = (_Nowhere,)

    def __init__(self, py_func, reason):
        super().__init__(py_func)
        self._reason = reason

    def load_overload(self, sig, target_context):
        rtsys.initialize(target_context)
        return self._shipped(sig, target_context) or _say_that_it_compiles(self._reason)

    def save_overload(self, sig, data):
        pass


UNWRITTEN = "in every process, as no folder for the code can be written: set NUMBA_CACHE_DIR"


def _foreign(refused: ForeignFolderError) -> str:
    return (
        f"in every process, as {refused}, who could put code there that would run: take that right away (chmod go-w), "
        "or set NUMBA_CACHE_DIR to a folder that is yours alone"
    )


class EntryPoint(CPUDispatcher):
    """A function that Python calls, each kind of which one process compiles while others wait for it."""

    def at(self, form: Form):
        """This entry point as it is compiled for arrays that are rows of a form."""
        return self if form == PLAIN else _at(self, form)

    def compile(self, sig):
        try:
            with held_back():
                return super().compile(sig)
        finally:
            if isinstance(self._cache, _DigestCache):
                self._cache.end_turn()


def kept_code(name: str, make: Callable[[], bytes]) -> bytes:
    """Code by name from the disk, beside that of entry points; else what `make` returns, which is left there."""
    try:
        path = own_folder(Path(_DigestLocator(kept_code, __file__).get_cache_path())) / name
    except ForeignFolderError as refused:
        _say_that_it_compiles(_foreign(refused))
        return make()
    except (OSError, RuntimeError):  # Python 3.11 tells of a circle of links so
        _say_that_it_compiles(UNWRITTEN)
        return make()
    code = _sound(path)
    if code is None:
        with _alone(path.with_name(f"{name}.lock")):
            code = _sound(path)  # another process may have left it meanwhile
            if code is None:
                _say_that_it_compiles("once: later runs find the code")
                with held_back():
                    code = make()
                _leave(path, code)
    return code


def _sound(path: Path, is_shipped: bool = False) -> bytes | None:
    """Content of a file that begins with its digest; None if it is damaged, not there, or may be another user's.

    is_shipped: Whether it came with the package, so that its owner is asked as little as that of the sources.
    """
    try:
        with open(path, "rb") as file:
            if not is_shipped and not is_own(os.fstat(file.fileno())):
                return _say_that_some_are_foreign(path.parent)
            kept = file.read()
    except OSError:
        return None
    digest, code = kept[:DIGEST_SIZE], kept[DIGEST_SIZE:]
    return code if digest == hashlib.sha256(code).digest() else None


def _leave(path: Path, code: bytes) -> None:
    """Write a file whole, behind its digest; nothing where none can be written."""
    with contextlib.suppress(OSError):
        part = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}")
        try:
            with open(part, "xb", opener=opened_by_owner) as file:
                file.write(hashlib.sha256(code).digest() + code)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


@functools.cache
def _say_that_it_compiles(how_often):
    """One sentence per process, at a terminal as in a notebook or a log: nothing else happens meanwhile."""
    logging.getLogger("seastar_gym").warning(
        "seastar_gym compiles the simulator for this kind of scene, 10 to 30 s of one core, %s.", how_often
    )


@functools.cache
def _say_that_some_are_foreign(folder):
    logging.getLogger("seastar_gym").warning(
        "Files in %s that belong to another user, or that others may write, are compiled anew and never run.", folder
    )


def entry_point(function):
    """Compile `function` for calls from Python, with the GIL released and the machine code kept on disk.

    Its `at(form)` is the same on rows of another form.
    """
    if numba.config.DISABLE_JIT:
        quiet = np.errstate(all="ignore")(function)
        quiet.at = lambda form: quiet
        return quiet
    return _entry_point(function, PLAIN)


@global_compiler_lock
@functools.cache
def _at(entry, form):
    function = entry.py_func
    # Code is known by its function's name, in a process as on disk.
    name = f"{function.__name__}_{form.name}_{form.width}_{form.stride}"
    named = FunctionType(function.__code__, function.__globals__, name, function.__defaults__, function.__closure__)
    named.__qualname__, named.__module__ = name, function.__module__
    return _entry_point(named, form)


def _entry_point(function, form):
    compiled = numba.njit(**{**STRICT, "pipeline_class": compiler_of(form)})(function)
    compiled.__class__ = EntryPoint
    try:
        compiled._cache = _DigestCache(function)
    except ForeignFolderError as refused:
        compiled._cache = _NoCache(function, _foreign(refused))
    except RuntimeError:  # no folder can be written (a read-only home)
        compiled._cache = _NoCache(function, UNWRITTEN)
    return compiled
