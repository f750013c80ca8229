"""Gradients of swims in JAX: commands with which the hub ends as far from its start as it can.

    pip install -e ".[learners]"
    python examples/jax_gradients.py

`hub_of` makes swims a function like any other of JAX's, which `jit`, `vmap` and `grad` take.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from seastar_gym import Scene
from seastar_gym.gradients import record

jax.config.update("jax_enable_x64", True)


def hub_of(scene: Scene) -> Callable[[jax.Array], jax.Array]:
    """A function from commands, shape (n, n_limbs), to positions of the hub [m], shape (n + 1, 2)."""

    def swim(commands: np.ndarray) -> np.ndarray:
        return record(scene, np.asarray(commands)).swim.hub

    def pull_back(commands: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        return record(scene, np.asarray(commands)).gradient({"hub": np.asarray(slopes)}, ["commands"])["commands"]

    @jax.custom_vjp
    def hub(commands: jax.Array) -> jax.Array:
        places = jax.ShapeDtypeStruct((len(commands) + 1, 2), jnp.float64)
        return jax.pure_callback(swim, places, commands, vmap_method="sequential")

    def forward(commands: jax.Array) -> tuple[jax.Array, jax.Array]:
        return hub(commands), commands

    def backward(commands: jax.Array, slopes: jax.Array) -> tuple[jax.Array]:
        return (jax.pure_callback(pull_back, commands, commands, slopes, vmap_method="sequential"),)

    hub.defvjp(forward, backward)
    return hub


def swim_far(scene: Scene, strokes: int = 3, steps: int = 20, seed: int = 0) -> list[float]:
    """Distances that are swum [mm], from random small commands to those after the last step along the gradient."""
    hub, distances = hub_of(scene), []

    @jax.jit
    @jax.value_and_grad
    def distance(free: jax.Array) -> jax.Array:
        places = hub(jnp.tanh(free))
        return jnp.linalg.norm(places[-1] - places[0])

    free = 0.3 * jax.random.normal(jax.random.key(seed), (strokes, scene.robot.n_limbs))
    for _ in range(steps):
        value, slope = distance(free)
        free += 0.3 * slope / jnp.linalg.norm(slope)
        distances.append(1e3 * float(value))
    return distances


if __name__ == "__main__":
    print(" ".join(f"{distance:.2f}" for distance in swim_far(Scene())), "mm")
