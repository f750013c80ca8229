"""Quadratic drag (13.8): F = -c |v| v with c = 1/2 rho_f C_d D dl_i, from the dissipation potential c |v|^3 / 3."""

from seastar_gym.der.compilation import kernel
from seastar_gym.der.lanes import add_product, select, sqrt


@kernel
def drag_slopes(c, vx, vy):
    """(potential, c |v|, c/|v|): the force is -(c |v|) v, the Hessian in v is (c |v|) 1 + (c/|v|) v v^T."""
    squared = add_product(vx * vx, vy, vy)
    speed = sqrt(squared)
    c_speed = c * speed
    # v v^T/|v| tends to zero with v.
    c_over_speed = select(speed > 0.0, c / speed, 0.0)
    return c_speed * squared * (1.0 / 3.0), c_speed, c_over_speed
