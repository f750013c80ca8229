"""A policy that sees little learns from one that sees all: imitation with a privileged teacher.

Robots swim by the student's actions, and the teacher, who sees their true state, says what it would have done. The
student learns the teacher's probabilities of actions by supervised learning on all that was swum, so that it meets its
own mistakes (DAgger: Ross, Gordon and Bagnell 2011; with a privileged teacher: Lee et al. 2020). A run makes a policy
for a camera so, whose teacher is the run's policy.
"""

import math
import shlex
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from tqdm import tqdm

from agents.comparison import compare
from agents.options import Options, config_of
from agents.ppo import Hyperparameters, actor, describe, make_training_batch
from agents.run import held, resume_command, robot_of, versions_and_machine
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.controllers.learned import LearnedPolicy, load, save
from seastar_gym.envs.group import inverse
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.sight import Camera, read_camera, told
from seastar_gym.envs.symmetry import Symmetry, VectorFrameStack
from seastar_gym.evaluation.report import Remarks
from seastar_gym.scene.checks import require_count, require_kind

PAST = 8
"""Past observations that a policy with memory sees."""
ENOUGH = 98_304
"""Length of an imitation [decisions], after which more gain nothing."""
ROUND = 32
"""Decisions of every robot between two fits."""
PASSES, BATCH = 4, 1024
"""Passes over the data of a fit, and decisions of a minibatch."""
LEARNING_RATE = 1e-3
"""Learning rate of Adam at the beginning, which falls linearly to a hundredth."""


def advice(
    teacher: LearnedPolicy, student: Symmetry, state: NDArray[np.float32], elements: NDArray[np.intp]
) -> NDArray[np.float32]:
    """Logits of a student's actions, shape (n, *distributions), by a teacher that sees the true state of its robots.

    teacher: Policy without memory, by the same actions. student: Symmetry of who learns.
    state: Privileged observations, shape (n, size). elements: Those by which the student sees its robots turned.
    """
    own, turned = teacher.reduction, np.zeros(len(state), np.intp)
    if own is not None:
        state, turned = own.reduce(state)
    flat = teacher.logits(state).reshape(len(state), -1)
    if own is not None:
        flat = own.carry_masks(flat, inverse(turned, own.group))
    return student.carry_masks(flat, elements).reshape(-1, *teacher.description.distributions)


def distil(
    teacher: LearnedPolicy,
    batch: VectorFrameStack,
    decisions: int,
    seed: int,
    hidden: tuple[int, ...] = (128, 128),
    on_decisions: Callable[[int], object] = lambda decisions: None,
) -> LearnedPolicy:
    """Policy that has learned from a teacher in a batch in autoreset mode SAME_STEP, which is closed then.

    decisions: Length of the training, all robots together. seed: Of the network, the exploration and the episodes.
    hidden: Widths of the hidden layers. on_decisions: Called with the number of decisions that have been learned from.
    """
    require_kind("batch", batch, VectorFrameStack, "a VectorFrameStack")
    require_count("decisions", decisions, 1, 10**8)
    require_kind("policy", teacher, LearnedPolicy, "a LearnedPolicy")
    inner, about, student = batch.unwrapped, teacher.description, batch.frame_stack.symmetry
    if about.past or about.actions != student.actions:
        raise ValueError(f'A teacher is a policy without memory, and with actions="{student.actions}".')
    if about.layout != Layout.of(inner.scene):  # type: ignore[attr-defined]
        raise ValueError("The teacher does not see what this batch's robots would show without a Sight.")
    rng = np.random.default_rng(seed)
    torch.manual_seed(seed)
    network = _network((batch.frame_stack.size, *hidden, math.prod(about.distributions)))
    adam = torch.optim.Adam(network.parameters())
    rounds = max(1, decisions // (ROUND * batch.num_envs))
    seen, told = list[torch.Tensor](), list[torch.Tensor]()
    observations, _ = batch.reset(seed=seed)
    for number in range(rounds):
        for _ in range(ROUND):
            state = inner.privileged_observations()  # type: ignore[attr-defined]
            wanted = advice(teacher, student, state, batch.elements)
            seen.append(torch.from_numpy(observations))
            told.append(torch.softmax(torch.from_numpy(wanted), dim=-1))
            logits = wanted if number == 0 else network(seen[-1]).detach().numpy().reshape(wanted.shape)
            explored = logits + number % 2 * rng.gumbel(size=logits.shape)  # every other round draws its actions
            actions = np.argmax(explored, axis=-1)
            observations, *_ = batch.step(actions if about.actions == "limbs" else actions[:, 0])
        for group in adam.param_groups:
            group["lr"] = LEARNING_RATE * (1.0 - 0.99 * number / rounds)
        _fit(network, adam, torch.cat(seen), torch.cat(told))
        on_decisions(len(seen) * batch.num_envs)
    learned = describe(BatchVecEnv(batch), hidden)
    batch.close()
    names = {f"mlp_extractor.policy_net.{name}": value for name, value in network[:-1].state_dict().items()}
    last = {f"action_net.{name}": value for name, value in network[-1].state_dict().items()}
    return LearnedPolicy(learned, actor({**names, **last}))


def _network(widths: tuple[int, ...]) -> torch.nn.Sequential:
    """Linear layers with tanh between them."""
    layers = list[torch.nn.Module]()
    for inputs, outputs in pairwise(widths):
        layers += [torch.nn.Linear(inputs, outputs), torch.nn.Tanh()]
    return torch.nn.Sequential(*layers[:-1])


def _fit(network: torch.nn.Module, adam: torch.optim.Adam, seen: torch.Tensor, told: torch.Tensor) -> None:
    """Bring the network's probabilities nearer to those that it was told, shape (n, distributions, choices)."""
    for _ in range(PASSES):
        for rows in torch.randperm(len(seen)).split(BATCH):
            wanted = told[rows].flatten(0, 1)
            loss = torch.nn.functional.cross_entropy(network(seen[rows]).reshape(wanted.shape), wanted)
            adam.zero_grad()
            loss.backward()
            adam.step()


# A policy for a camera from a run

TAKEN = ("checkpoints", "evaluation", "tensorboard")
"""Folders that a run has in its own."""


def policy_for_camera(options: Options, arguments: Sequence[str]) -> int:
    """Make a policy for the camera that the options name, in a folder of the run named as its file; the exit code.

    arguments: Of the command.
    """
    torch.set_num_threads(1)
    file, folder = options.for_camera, options.resume
    assert file is not None and folder is not None
    camera = read_camera(file)
    if camera.sight.sees == "nodes":
        raise ValueError(
            f"{file} sees all nodes, as the run's policy does: have it see the pose, or 1, 3 or 9 markers."
        )
    if file.stem in TAKEN:
        raise ValueError(f"The run has a folder {file.stem} already: give {file} another name.")
    place = folder / file.stem
    if (place / "policy.safetensors").exists():
        raise ValueError(f"{place} has a policy already: give {file} another name, or remove that folder.")
    with held(folder, new=False):
        teacher, command = finished_policy(options, folder), shlex.join(["python", "train.py", *arguments])
        policy = imitation(teacher, options, camera, folder)
        training = {**versions_and_machine(), "seed": options.seed, "strokes": length(options)}
        training["commands"] = [*config_of(folder)["commands"], command]
        save(policy, place / "policy.safetensors", **training)
        policy = load(place / "policy.safetensors")
        agents = {"camera": policy, "full sight": teacher}
        compare(agents, options, robot_of(options, folder), remarks_on(policy, options, place), place)
    print(f"Drive:   {drive_command(place)}")
    return 0


def length(options: Options) -> int:
    """Length of the imitation [decisions]."""
    return ENOUGH // 3 if options.quick else ENOUGH


def finished_policy(options: Options, folder: Path) -> LearnedPolicy:
    """Policy of the run with these options in a folder. ValueError for a run that is not at its end."""
    file = folder / "policy.safetensors"
    policy = load(file) if file.exists() else None
    done = 0 if policy is None else policy.training.get("strokes", 0)
    if policy is None or done < options.length:
        end = f", or end it with that and --strokes {done}" if done else ""
        raise ValueError(
            f"The run in {folder} is not finished, after {done} of {options.length} decisions: continue it with "
            f"{resume_command(folder)}{end}."
        )
    return policy


def imitation(teacher: LearnedPolicy, options: Options, camera: Camera, folder: Path) -> LearnedPolicy:
    """Policy that sees through a camera, and has learned from the policy of the run with these options in a folder."""
    robot = robot_of(options, folder)
    batch = make_training_batch(
        options.ppo, options.path, options.random_heading, fidelity=robot.fidelity(options),
        threads=options.num_threads, num_envs=Hyperparameters().num_envs, scene=robot.scene, randomization=robot.draws,
        **camera._asdict(),
    )  # fmt: skip
    decisions = length(options)
    print(f"A policy for {told(camera.sight)} learns from the run's, {decisions} decisions.", flush=True)
    with tqdm(total=decisions, unit=" decisions", unit_scale=True, disable=None) as bar:
        return distil(
            teacher, VectorFrameStack(batch, PAST, options.ppo.symmetry), decisions, options.seed, options.ppo.hidden,
            lambda done: bar.update(done - bar.n),
        )  # fmt: skip


def remarks_on(policy: LearnedPolicy, options: Options, place: Path) -> Remarks:
    """Remarks of the report on a policy for a camera, in its folder."""
    about = policy.description
    assert about.sight is not None
    return Remarks(
        title="Learned for a camera, and with full sight, round the pentagon",
        sentences=[
            f"The policy for {told(about.sight)} is an imitation of the other one, after {length(options)} decisions, "
            f"seed {options.seed}.",
            f"{about.sight}, action_delay={about.action_delay}.",
        ],
        commands=[*policy.training["commands"], drive_command(place)],
    )


def drive_command(place: Path) -> str:
    """Command that drives a plant by the policy in a folder."""
    return shlex.join(["seastar", "drive", str(place / "policy.safetensors"), "--plant", "sim"])
