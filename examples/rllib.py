"""PPO of Ray's RLlib on one robot per environment.

    python -m venv .rllib && .rllib/bin/pip install -e . "ray[rllib]>=2.60" torch
    .rllib/bin/python examples/rllib.py --iterations 100 --env-runners 8 --address head:6379

RLlib wants a Gymnasium of its own, hence the environment of its own. Without --address it starts a cluster of this
machine; the nodes of another need this package, too. A lost env runner is started again while the others go on.
"""

import argparse
from pathlib import Path
from typing import Any

import gymnasium as gym
import ray
from ray.rllib.algorithms.ppo import PPO, PPOConfig
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.tune.registry import register_env


def make(config: dict[str, Any]) -> Any:
    """Environment of an env runner."""
    import seastar_gym  # noqa: F401, registers the environments in whatever process this is

    return gym.make("SeastarSwim-v0", actions="pairs", path="random", random_heading=True, fidelity="fast", **config)


def learner_of(env_runners: int, batch: int = 2048, **config: Any) -> PPO:
    """New learner. batch: Strokes between updates. config: Arguments of the environment."""
    register_env("seastar", make)
    settings = (
        PPOConfig()
        .environment("seastar", env_config=config)
        .env_runners(num_env_runners=env_runners, num_envs_per_env_runner=8, sample_timeout_s=600.0)
        .rl_module(model_config=DefaultModelConfig(fcnet_hiddens=[128, 128], vf_share_layers=False))
        .training(
            train_batch_size_per_learner=batch, minibatch_size=batch // 4, num_epochs=6, lr=5e-4, gamma=0.8,
            lambda_=0.9, entropy_coeff=0.01, use_kl_loss=False, vf_clip_param=float("inf"), grad_clip=0.5,
        )
        .fault_tolerance(restart_failed_env_runners=True)
    )  # fmt: skip
    return settings.build_algo()


def main() -> None:
    """Train, and save what is learned with RLlib's own checkpoints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--iterations", type=int, default=48, help="updates, each after 2048 strokes")
    parser.add_argument("--env-runners", type=int, default=2, help="processes that swim")
    parser.add_argument("--address", help="head of a Ray cluster, HOST:6379")
    parser.add_argument("--out", default="runs/rllib", help="folder of the checkpoint")
    options = parser.parse_args()
    ray.init(options.address)
    learner = learner_of(options.env_runners)
    for iteration in range(options.iterations):
        found = learner.train()["env_runners"].get("episode_return_mean", float("nan"))
        print(f"{2048 * (iteration + 1)} strokes: mean return {found:.1f}", flush=True)
    print(f"Saved to {learner.save_to_path(str(Path(options.out).resolve()))}.")
    learner.stop()


if __name__ == "__main__":
    main()
