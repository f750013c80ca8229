"""`DeviceBatch`: a batch of robots in the memory of a device with a thread for each of them, such as a GPU."""

from types import ModuleType
from typing import Any

import numpy as np
from numba.core import config
from numpy.typing import NDArray

from seastar_gym.lanes import cuda, device, scalar
from seastar_gym.lanes.device import Memory, Program, leaves
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.rods.bundles import make_work
from seastar_gym.rods.interval import cover_intervals
from seastar_gym.rods.step import SCHEMES
from seastar_gym.scene import Scene
from seastar_gym.simulator.batch import MOVED, Batch

Floats = NDArray[np.float64]

DEVICES: dict[str, ModuleType] = {"cuda": cuda, "scalar": scalar}
"""Devices beside the processor's SIMD lanes ("cpu"): NVIDIA GPUs, and their twin on the processor, for tests."""
OF_INTERVAL = {"status": "failed", "report": "report", "effort": "effort"}
"""Arrays of a batch that an interval changes and the host reads, and their names in the kernel."""
SHARE = device.N_LANES // N_LANES
"""Lane groups of the processor in one of a device."""


class DeviceBatch(Batch):
    """A batch whose robots are advanced by a device, to the bits of the processor's.

    Positions and velocities stay on the device from one interval to the next. Whoever asks for `q` or `v` gets a copy
    in the processor's layout. It travels back with the next interval, because it may have been changed.

    name: Of the device, see DEVICES.
    """

    def __init__(self, scene: Scene, n_robots: int, name: str, effort: bool):
        if config.DISABLE_JIT:
            raise ValueError('With NUMBA_DISABLE_JIT=1 nothing is compiled, and devices have no code: use "cpu".')
        if scene.terms:
            raise ValueError('Own terms (Scene.terms) are compiled for the processor alone: use device="cpu".')
        self._device = DEVICES[name]
        self._arrays = self._device.arrays()
        self._on_host: dict[str, Floats] = {}
        self._on_device: set[str] = set()  # those of q and v whose host's copy is old
        super().__init__(scene, n_robots, 1, effort)
        self._n_groups = -(-n_robots // device.N_LANES)
        self._coefficients: Any = None  # those that are on the device, and how often they had been changed
        self._codes: dict[int, Any] = {}

    @property
    def q(self) -> Floats:
        return self._fetched("q")

    @q.setter
    def q(self, rows: Floats) -> None:
        self._on_host["q"] = rows

    @property
    def v(self) -> Floats:
        return self._fetched("v")

    @v.setter
    def v(self, rows: Floats) -> None:
        self._on_host["v"] = rows

    @property
    def arrays(self) -> ModuleType:
        return self._arrays

    def _fetched(self, name: str) -> Floats:
        """Rows of q or v on the host, where they may be changed until the next interval."""
        if name in self._on_device:
            self._on_host[name][:] = self._read_device(self._rows(name))
            self._on_device.discard(name)
        return self._on_host[name]

    def hub_position(self) -> Floats:
        if "q" in self._on_device:
            return self.read(self._read_device(self._rows("q")[:, :2]))
        return super().hub_position()

    def nodes_on_device(self, name: str) -> Any:
        """Node positions [m] ("q") or velocities [m/s] ("v") on the device, shape (n_robots, n_nodes, 2), a copy."""
        self._put_all()
        rows = self._rows(name)[:, : self.n_node_rows]
        return rows.transpose(0, 2, 1).reshape(-1, self.n_node_rows // 2, 2)[: self.n_robots]

    def filled(self, kernel: Any, numbers: dict[str, Any], n_rows: int) -> Any:
        """Rows that a kernel fills from q and v of every robot, shape (n_groups, n_rows, 32), on the device.

        kernel: Gets q, v, the rows to fill and `numbers`, in this order, of one lane group. numbers: Named tuples and
        arrays of shape (k,) that all robots share, plain numbers, and arrays (.., k, N_LANES) of all lane groups.
        """
        self._put_all()
        program = self.filling(kernel, numbers, n_rows)
        rows, values = program.memory.rows, [leaf for name in numbers for leaf in leaves(numbers[name], name)]
        own, shared = self._memory_with(program.memory, values)
        for name in ("q", "v"):
            own[:, rows[name]] = self._rows(name)
        code, unused = self._device.load(program), self._arrays.zeros(1)
        self._device.run(code, own, shared, unused, unused, self.n_robots)
        return own[:, rows["rows"]]

    def filling(self, kernel: Any, numbers: dict[str, Any], n_rows: int) -> Program:
        """The code of `filled`."""
        of_one = {name: rows[0] if getattr(rows, "ndim", 0) > 1 else rows for name, rows in numbers.items()}
        rows = {"q": self._on_host["q"][0], "v": self._on_host["v"][0], "rows": np.zeros((n_rows, N_LANES))}
        return Program(kernel, rows | of_one, ())

    def save(self) -> dict[str, Any]:
        rows = {name: self._rows(name).copy() for name in self._on_device}
        return {name: getattr(self, name).copy() for name in MOVED if name not in rows} | {"on device": rows}

    def restore(self, moved: dict[str, Any]) -> None:
        rows = moved["on device"]
        super().restore({name: values for name, values in moved.items() if name != "on device"})
        for name, values in rows.items():
            self._rows(name)[:] = values
        self._on_device |= set(rows)

    def advance(self, begin: int, end: int) -> None:
        self._put_all()
        self._on_device = {"q", "v"}
        shape, n_turning = self._shape_of(slice(0, len(self.peaks)), begin, end)
        for name, kernel_name in {"peaks": "peaks", **OF_INTERVAL}.items():
            self._rows(kernel_name)[:] = self._to_device(getattr(self, name))
        if begin == 0:
            self._rows("a")[:] = 0.0
        times = self._arrays.asarray(self.times[begin : end + 1])
        rotations = self._to_device(shape) if n_turning else self._arrays.asarray(shape)
        if n_turning not in self._codes:
            self._codes[n_turning] = self._device.load(self.program(n_turning))
        self._device.run(self._codes[n_turning], self._own, self._shared, times, rotations, self.n_robots)
        for name, kernel_name in OF_INTERVAL.items():
            getattr(self, name)[:] = self._read_device(self._rows(kernel_name))

    def program(self, n_turning: int) -> Program:
        """The code for robots of which 0, 1 or all limbs have a shape of their own."""
        rods, (_, actuation) = self.coefficients.rods(0), self.memory[0]
        work = make_work(rods, self._scheme.n_stages, width=device.FORM.width)
        shape = np.zeros((1, 1) if n_turning else 1)
        bundles = {
            "rods": rods, "work": work, "scheme": self._scheme, "fallback": SCHEMES["implicit-euler"],
            "actuation": actuation, "q": self._on_host["q"][0], "v": self._on_host["v"][0], "a": self.a[0],
            "peaks": self.peaks[0], "times": np.zeros(1), "n_intervals": 0, "shape": shape, "n_turning": n_turning,
            "failed": self.status[0], "report": self.report[0], "limits": self.coefficients.limits(0),
            "effort": self.effort[0], "asked": self.effort.size > 0,
        }  # fmt: skip
        return Program(cover_intervals, bundles, ("work", "actuation"))

    def _put_all(self) -> None:
        """Bring to the device what it has not, or what has changed on the host."""
        if self._coefficients != (self.coefficients, self.coefficients.n_changes):
            self._put_coefficients()
        for name in {"q", "v"} - self._on_device:
            self._rows(name)[:] = self._to_device(self._on_host[name])

    def _put_coefficients(self) -> None:
        """Make the device's memory, with the coefficients of all robots in it."""
        for name in ("q", "v"):
            self._fetched(name)
        memory = self.program(0).memory
        numbers = leaves(self._scheme, "scheme") + leaves(SCHEMES["implicit-euler"], "fallback")
        groups = range(1 if self.coefficients.are_shared else len(self.peaks))
        of_groups = [
            leaves(self.coefficients.rods(k), "rods") + leaves(self.coefficients.limits(k), "limits") for k in groups
        ]
        for same in zip(*of_groups, strict=True):
            name, first = same[0]
            numbers.append((name, np.stack([rows for _, rows in same]) if name in memory.rows else first))
        own, shared = self._memory_with(memory, numbers)
        self._memory, self._own, self._shared, self._codes = memory, own, shared, {}
        self._coefficients = self.coefficients, self.coefficients.n_changes

    def _memory_with(self, memory: Memory, numbers: list[tuple[str, Floats]]) -> tuple[Any, Any]:
        """The robots' own memory on the device and the shared one, with numbers in them by name.

        numbers: Of shape (n_groups, k, N_LANES), or (k,) if robots share them.
        """
        own = self._arrays.zeros((self._n_groups, memory.n_rows, device.N_LANES))
        shared = np.zeros(max(memory.n_shared, 1))
        for name, values in numbers:
            if name in memory.rows:
                own[:, memory.rows[name]] = self._to_device(values)
            else:
                shared[memory.shared[name]] = values
        return own, self._arrays.asarray(shared)

    def _rows(self, name: str) -> Any:
        """Rows on the device by the name of the kernel's argument, shape (n_groups, k, 32), not a copy."""
        return self._own[:, self._memory.rows[name]]

    def _to_device(self, rows: Floats) -> Any:
        """Rows (n_groups, k, N_LANES) of the host as the device has them."""
        here, n_rows = self._arrays.asarray(rows), rows.shape[1]
        padded = self._arrays.zeros((self._n_groups * SHARE, n_rows, N_LANES))
        padded[: len(rows)] = here
        beside = padded.reshape(self._n_groups, SHARE, n_rows, N_LANES).transpose(0, 2, 1, 3)
        return beside.reshape(self._n_groups, n_rows, device.N_LANES)

    def _read_device(self, rows: Any) -> Floats:
        """Rows of the device as the host has them, (n_groups, k, N_LANES), a copy."""
        n_rows = rows.shape[1]
        apart = rows.reshape(self._n_groups, n_rows, SHARE, N_LANES).transpose(0, 2, 1, 3)
        here = apart.reshape(self._n_groups * SHARE, n_rows, N_LANES)[: len(self.peaks)]
        return here.get() if hasattr(here, "get") else np.array(here)
