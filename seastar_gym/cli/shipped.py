"""Compiles the kinds of code that a wheel may carry, for a level of x86-64. Nothing of it runs on this processor.

    SEASTAR_LANES=8 python -m seastar_gym.cli.shipped x86-64-v4 FOLDER [ID ...]

The build hook calls it (`HATCH_BUILD_HOOK_ENABLE_CUSTOM=true python -m build --wheel`). Kinds are those that all
registered ids ask for, or some, one robot and batches.
"""

import contextlib
import sys
from pathlib import Path
from typing import Any


def lanes_of(level: str) -> int:
    """Lanes that the package takes on processors of a level."""
    from seastar_gym.lanes.compile import LEVELS

    return 8 if "avx512f" in LEVELS[level] else 4


def names_alone(bitcode: bytes) -> bytes:
    """Bitcode that defines what another one does, without its content, which only linking would need."""
    import llvmlite.binding as llvm

    module = llvm.parse_bitcode(bitcode)
    lines = [f'target triple = "{module.triple}"']
    lines += [f'define void @"{each.name}"() {{ ret void }}' for each in module.functions if not each.is_declaration]
    lines += [f'@"{each.name}" = global i8 0' for each in module.global_variables if not each.is_declaration]
    found: bytes = llvm.parse_assembly("\n".join(lines)).as_bitcode()
    return found


def keep(level: str, entry: Any, *args: Any) -> None:
    """Compile an entry point for arguments of these types, and keep its code; nothing if that was done."""
    from seastar_gym.lanes import compile as compiling

    sig = tuple(map(entry.typeof_pyval, args))
    if sig in entry.overloads:
        return
    cache = entry._cache
    cache.disable()
    entry.compile(sig)
    result = entry.overloads[sig]
    (name, kind, (machine_code, bitcode)), *data, _, reload_init, environments = cache._impl.reduce(result)
    codegen = result.codegen
    key = compiling.shipped_key(sig, cache._index_key(sig, codegen), (codegen.magic_tuple()[0], level))
    # The annotation of types has the path of the sources in it, and nobody reads it.
    library = name, kind, (machine_code, names_alone(bitcode))
    file = compiling.ShippedFile(entry.py_func, cache._impl.filename_base)
    file.save(key, (library, *data, "", reload_init, environments))


def main(level: str, folder: str, *ids: str) -> None:
    """Compile all kinds that ids ask for, all registered ones if none are named, for a level into a folder."""
    import gymnasium as gym
    import numba

    import seastar_gym
    from seastar_gym.lanes import compile as compiling
    from seastar_gym.lanes import dispatch
    from seastar_gym.lanes.registers import N_LANES

    if lanes_of(level) != N_LANES:  # chosen as the package is imported
        raise SystemExit(f"Code for {level} is on {lanes_of(level)} lanes: set SEASTAR_LANES={lanes_of(level)}.")
    numba.config.CPU_NAME, numba.config.USING_SVML = level, False
    numba.config.CPU_FEATURES = ",".join(sorted(f"+{each}" for each in compiling.LEVELS[level]))
    compiling.SHIPPED = Path(folder)
    (compiling.SHIPPED / compiling.shipped_digest()).mkdir(parents=True, exist_ok=True)
    dispatch.KnownCode.call = lambda _, kind, entry, *args: keep(level, entry, *args)  # type: ignore[method-assign]
    compiling.EntryPoint.__call__ = lambda entry, *args: keep(level, entry, *args)
    for id in ids or sorted(each for each in gym.registry if each.startswith("Seastar")):
        for env in (gym.make(id), gym.make_vec(id, N_LANES, vectorization_mode="vector_entry_point")):
            robots: Any = env.unwrapped
            with contextlib.suppress(Exception):  # nothing has run, so that anything may be wrong
                robots.reset(seed=0)
                robots.step(env.action_space.sample())
            scene = robots.scene if hasattr(robots, "scene") else robots.simulator.scene
            # Asked for where the energy of an episode may have grown.
            seastar_gym.Simulator(scene).kinetic_energy(relative_to_water=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
