"""Symmetry group of the regular n-gon: its elements, their products, and how they turn vectors and order limbs."""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Elements = NDArray[np.intp]


def is_mirror(elements: ArrayLike) -> NDArray[np.bool_]:
    """Whether each element mirrors, shape (...)."""
    return np.asarray(elements) % 2 == 1


def inverse(elements: ArrayLike, n_limbs: int) -> Elements:
    """Elements, shape (...), that undo these; a mirror undoes itself."""
    elements = np.asarray(elements)
    return np.where(is_mirror(elements), elements, -elements % (2 * n_limbs))


def compose(second: ArrayLike, first: ArrayLike, n_limbs: int) -> Elements:
    """Elements, shape (...), of doing `first` and then `second`."""
    second, first = np.asarray(second), np.asarray(first)
    k_first, k_second = (first + 1) // 2, (second + 1) // 2
    k = k_first + np.where(is_mirror(first), -k_second, k_second)
    return (2 * k - (first + second) % 2) % (2 * n_limbs)


@cache
def turns(n_limbs: int) -> NDArray[np.complex128]:
    """Factors exp(-2 pi i k/n) by which elements turn a vector x + iy, shape (2 n_limbs,); exactly 1 for element 0."""
    k = (np.arange(2 * n_limbs) + 1) // 2 % n_limbs
    return read_only(np.exp(-2j * np.pi / n_limbs * k))


@cache
def limb_order(n_limbs: int) -> NDArray[np.intp]:
    """Order of limbs, shape (2 n_limbs, n_limbs): limb j of a robot carried by element g was limb order[g, j]."""
    elements, limbs = np.arange(2 * n_limbs)[:, None], np.arange(n_limbs)
    return read_only(((elements + 1) // 2 + np.where(is_mirror(elements), -limbs, limbs)) % n_limbs)


def read_only(table: NDArray[Any]) -> NDArray[Any]:
    """Table that can be cached and shared, because nobody can write to it."""
    table.setflags(write=False)
    return table
