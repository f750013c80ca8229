"""A policy for a camera from a run: an imitation of the run's policy, which sees everything, and their comparison."""

import shlex
from collections.abc import Sequence
from pathlib import Path

import torch
from tqdm import tqdm

from agents.distillation import ENOUGH, PAST, distil
from agents.ppo import Hyperparameters, make_training_batch
from agents.training.options import Options, config_of
from agents.training.run import held, resume_command, robot_of, versions_and_machine
from seastar_gym.controllers.learned import LearnedPolicy, load, save
from seastar_gym.envs.sight import Camera, read_camera, told
from seastar_gym.envs.symmetry import VectorFrameStack
from seastar_gym.evaluation.comparison import evaluate
from seastar_gym.evaluation.report.page import Remarks

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
    with held(folder, new=False):
        teacher, command = finished_policy(options, folder), shlex.join(["python", "train.py", *arguments])
        policy = imitation(teacher, options, camera, folder)
        training = {**versions_and_machine(), "seed": options.seed, "strokes": length(options)}
        training["commands"] = [*config_of(folder)["commands"], command]
        save(policy, place / "policy.safetensors", **training)
        compare(load(place / "policy.safetensors"), teacher, options, place)
    print(f"Report:  {place / 'evaluation' / 'report.html'}\nPolicy:  {place / 'policy.safetensors'}")
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
        options.ppo, options.path, options.random_heading, robot.fidelity(options), options.num_threads,
        num_envs=Hyperparameters().num_envs, scene=robot.scene, randomization=robot.draws, sight=camera.sight,
        action_delay=camera.action_delay,
    )  # fmt: skip
    decisions = length(options)
    print(f"A policy for {told(camera.sight)} learns from the run's, {decisions} decisions.", flush=True)
    with tqdm(total=decisions, unit=" decisions", unit_scale=True, disable=None) as bar:
        return distil(
            teacher, VectorFrameStack(batch, PAST), decisions, options.seed, options.ppo.hidden,
            lambda done: bar.update(done - bar.n),
        )  # fmt: skip


def compare(policy: LearnedPolicy, teacher: LearnedPolicy, options: Options, place: Path) -> None:
    """Compare the policy for a camera with that of its run round the pentagon: table, CSV, picture, videos, report."""
    robot, period = robot_of(options, place.parent), options.ppo.decision_period
    about = policy.description
    assert about.sight is not None
    remarks = Remarks(
        title="Learned for a camera, and with full sight, round the pentagon",
        sentences=[
            f"The policy for {told(about.sight)} is an imitation of the other one, after {length(options)} decisions, "
            f"seed {options.seed}.",
            f"{about.sight}, action_delay={about.action_delay}.",
        ],
        commands=[*policy.training["commands"], drive_command(place)],
    )
    evaluate(
        {"camera": policy, "full sight": teacher},
        "pentagon",
        max_strokes=options.limit(robot.scene),
        decision_period=period,
        scene=robot.scene,
        fidelity=robot.fidelity(options),
        video=options.video,
        report=remarks,
        out=place / "evaluation",
    )


def drive_command(place: Path) -> str:
    """Command that drives a plant by the policy in a folder."""
    return shlex.join(["seastar", "drive", str(place / "policy.safetensors"), "--plant", "sim"])
