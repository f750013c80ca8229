"""Peak rate of the processor on fused products."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from seastar_gym.simd.compilation import entry_point
from seastar_gym.simd.lanes import N_LANES, add_product, borrow, load, store
from studies.speed.strokes import repeat


@entry_point
def fused_products(values, n):
    """Compute n fused products in each of eight independent chains; values: Start and factors, shape (18, N_LANES)."""
    rows = borrow(values)
    c, d = load(rows, 16), load(rows, 17)
    x0, x1, x2, x3 = load(rows, 0), load(rows, 1), load(rows, 2), load(rows, 3)
    x4, x5, x6, x7 = load(rows, 4), load(rows, 5), load(rows, 6), load(rows, 7)
    for _ in range(n):
        x0, x1, x2, x3 = add_product(c, x0, d), add_product(c, x1, d), add_product(c, x2, d), add_product(c, x3, d)
        x4, x5, x6, x7 = add_product(c, x4, d), add_product(c, x5, d), add_product(c, x6, d), add_product(c, x7, d)
    store(rows, 0, x0 + x1 + x2 + x3 + x4 + x5 + x6 + x7)


def peak_gigaflops(seconds: float) -> list[float]:
    """Rates of one core on fused products alone [Gflop/s]."""
    values = np.full((18, N_LANES), 0.5)
    n = 200_000
    return [8 * 2 * N_LANES * n / d / 1e9 for d in repeat(lambda: fused_products(values, n), seconds)]


def peak_speedup(seconds: float) -> list[float]:
    """Speedups of fused products alone by a second core, measured in turn: an upper bound for batches."""
    chains, n = [np.full((18, N_LANES), 0.5) for _ in range(2)], 2_000_000
    ratios = []
    with ThreadPoolExecutor(2) as pool:
        for _ in range(max(5, int(seconds * 4))):
            one = repeat(lambda: [fused_products(chain, n) for chain in chains], 0.0, 1)[0]
            two = repeat(lambda: list(pool.map(fused_products, chains, [n, n])), 0.0, 1)[0]
            ratios.append(one / two)
    return ratios
