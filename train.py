"""Trains a swimmer with PPO, then compares it with the scripted pentagon gait.

    python train.py                        about half a minute on two cores
    python train.py --seeds 0 1 2          the same for several seeds, one after another
    python train.py --decision-period 0.5  the same for decisions twice a second, by wires
    python train.py --scene my_robot.py    the same for a robot of your own, in that file
    python train.py --quick                a shorter training with everything that follows
    python train.py --resume runs/FOLDER   continues a run that was stopped (by Ctrl-C or killed), or trains it for more
                                           --strokes
    python train.py --resume runs/FOLDER --for-camera camera.json
                                           makes a policy for a camera from that of a finished run, for `seastar drive`

Every run has a folder with the policy, the learner and its checkpoints, the options and the command, TensorBoard logs,
and the comparison with its table, pictures, videos and report.html. With --publish the policy becomes the bundled
one, if it is no worse.

Exit status: 0 done; 1 a file could not be written, or the policy was not published; 2 wrong options; 130 stopped.
"""

import shlex
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

try:
    import tensorboard  # noqa: F401, Stable-Baselines3 asserts that it is there when the training begins
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.logger import configure

    from agents import run as efficiency
    from agents.cards import publish
    from agents.comparison import compare, filmed_beside, rival_of, rivals
    from agents.distillation import policy_for_camera
    from agents.learner_file import resume
    from agents.options import Options, config_of, read_options, require_consent
    from agents.ppo import make_model, make_training_env, require_device
    from agents.run import (
        Robot,
        Watch,
        asked_for,
        export,
        held,
        is_unbegun,
        keep,
        physics,
        recorded,
        resume_command,
        robot_of,
        stoppable,
        write_config,
    )
    from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
    from seastar_gym.command import ended_by_disk
    from seastar_gym.controllers.learned import load as load_policy
    from seastar_gym.evaluation.report import PENTAGON_WAYPOINTS, Curve, Remarks, read_progress
except ModuleNotFoundError as missing:
    sys.exit(f'train.py needs {missing.name}: pip install "seastar-gym[train]".')
except KeyboardInterrupt:
    sys.exit(130)


def training_env(options: Options, robot: Robot) -> BatchVecEnv:
    """Environment of a training. ValueError for a robot that it cannot have."""
    return make_training_env(
        options.ppo,
        options.path,
        options.random_heading,
        fidelity=robot.fidelity(options),
        scene=robot.scene,
        threads=options.num_threads,
        randomization=robot.draws,
    )


def train(options: Options, robot: Robot, folder: Path, stop: Callable[[], bool]) -> tuple[PPO, Watch]:
    """Learner, saved as model.zip, after the strokes that were asked for or when `stop()` was true; and its watch."""
    env = training_env(options, robot)
    new = options.resume is None or is_unbegun(folder)
    if new:
        model = make_model(env, options.ppo, options.seed, options.device)
    else:
        model = learner_in(folder, env, options.device)
    model.set_logger(configure(str(folder / "tensorboard"), ["tensorboard"]))
    watch = Watch(options, robot, folder, model, env, stop)
    if not new and model.num_timesteps not in (strokes for strokes, *_ in recorded(folder)):
        watch.keep()  # a kill came between the two
    left = options.length - model.num_timesteps
    if left > 0:
        model.learn(left, watch, log_interval=1, reset_num_timesteps=new)
        watch.checkpoint()
    env.close()
    return model, watch


def learner_in(folder: Path, env: BatchVecEnv, device: str) -> PPO:
    """Learner of the run in a folder. Where it is damaged or missing, a ValueError says which checkpoint there is."""
    try:
        return resume(folder / "model.zip", env, device)
    except (FileNotFoundError, ValueError) as damaged:
        if (last := max((folder / "checkpoints").glob("*.zip"), default=None)) is None:
            raise
        raise ValueError(f"{damaged} The last checkpoint is {last}: put a copy in its place.") from damaged


def describe(options: Options, robot: Robot, folder: Path, trained: int, watch: Watch) -> Remarks:
    """Remarks of the report on the training. trained: Length of the whole training [strokes]."""
    rival = rival_of(options.ppo.decision_period, robot.scene)
    against = {None: "", "greedy": " against greedy"}.get(rival, " against scripted")
    sentences = [
        f"Swum by the robot of {options.scene}." if robot.scene else f'Swum at fidelity "{options.fidelity}".',
        f"Trained for {trained} decisions, seed {options.seed}. Of these commands, the last three show the logs, "
        "compare again, and train on; those before them trained.",
    ]
    if seconds := sum(watch.seconds.values()):
        shares = ", ".join(f"{name} {share:.0%}" for name, share in watch.shares().items())
        sentences.append(
            f"The last session took {seconds:.0f} s, {watch.strokes / seconds:.0f} decisions per second: {shares}."
        )
    agents = ["--agents", str(folder / "policy.safetensors"), *filter(None, [rival]), *physics(options, folder)]
    return Remarks(
        title=f"Learned{against} round the pentagon",
        sentences=sentences,
        commands=[
            *config_of(folder)["commands"],
            f"tensorboard --logdir {shlex.quote(str(folder))}",
            f"seastar evaluate {shlex.join(agents)} --report --video --out runs/evaluate",
            f"{resume_command(folder)} --strokes {2 * trained}",
        ],
        curves=[Curve.of("learned", read_progress(folder), watch.pentagon.decision_period)],
        tables=[watch.efficiency.table()],
    )


def run_seeds(options: Options, arguments: Sequence[str]) -> int:
    """Run the training of every seed; returns the exit code of the first that fails."""
    folder = options.out or Path("runs") / time.strftime("%Y-%m-%d_%H-%M-%S")
    for place, seed in enumerate(options.seeds):
        code = run(replace(options, seed=seed, seeds=(), out=folder / f"seed_{seed}"), arguments)
        if code != 0:
            if left := shlex.join(map(str, options.seeds[place + 1 :])):
                print(f"and train the others with the same options, --seeds {left} --out {shlex.quote(str(folder))}")
            return code
    print("seed, time round the pentagon [s], decisions and seconds of training until it was 170 s or less")
    for seed in options.seeds:
        its_own = folder / f"seed_{seed}"
        found, (_, decisions, waypoints) = efficiency.read(its_own), recorded(its_own)[-1]
        seconds = decisions * load_policy(its_own / "policy.safetensors").decision_period
        lap = f"{seconds:.4g}" if waypoints == PENTAGON_WAYPOINTS else f"only {waypoints} waypoints"
        print(f"{seed}, {lap}, {found.strokes_to_target or '-'}, {found.seconds_to_target or '-'}")
    return 0


def run(options: Options, arguments: Sequence[str]) -> int:
    """Train, compare, report; returns the exit code."""
    torch.set_num_threads(1)  # two threads are slower on so small a network, and the simulator has the processors
    require_device(options.device)
    require_consent(options)
    folder = options.out or Path("runs") / time.strftime("%Y-%m-%d_%H-%M-%S")
    robot = asked_for(options) if options.resume is None else Robot()
    if robot != Robot():
        training_env(options, robot).close()  # refuses what cannot be trained before there is a folder
    with held(folder, options.resume is None):
        keep(robot, folder, options.scene, options.path)
        write_config(options, arguments, folder)
        print(f"The run is in {folder}.", flush=True)
        robot = robot_of(options, folder)
        with filmed_beside(rival_of(options.ppo.decision_period, robot.scene), options, folder) as film:
            return train_and_compare(options, robot, folder, film)


def train_and_compare(options: Options, robot: Robot, folder: Path, film: Callable[[], Path | None]) -> int:
    """Train, compare, report, in the folder of the run; returns the exit code. film: See `filmed_beside`."""
    with stoppable() as stop:
        model, watch = train(options, robot, folder, stop.is_set)
    export(model, folder)
    if stop.is_set():
        print(
            f"Stopped after {model.num_timesteps} decisions; {folder / 'model.zip'} is the policy so far. Continue with"
        )
        asked = ["--publish"] * options.publish + ["--publish-anyway"] * options.publish_anyway
        print(" ".join(["   ", resume_command(folder), *asked]))
        return 130
    others = rivals(options.ppo.decision_period, robot.scene)
    agents = {"learned": load_policy(folder / "policy.safetensors"), **others}
    remarks = describe(options, robot, folder, model.num_timesteps, watch)
    compare(agents, options, robot, remarks, folder, dict.fromkeys(others, film))
    print(f"Logs:    tensorboard --logdir {shlex.quote(str(folder))}\n{watch.efficiency}")
    return publish(options, folder) if options.publish else 0


@contextmanager
def quiet_writers() -> Iterator[None]:
    """Context in which a thread that cannot write is silent: the next write through it raises the same error."""
    before = threading.excepthook

    def hook(failure: threading.ExceptHookArgs) -> None:
        if not isinstance(failure.exc_value, OSError):
            before(failure)

    threading.excepthook = hook
    try:
        yield
    finally:
        threading.excepthook = before


def main(arguments: Sequence[str]) -> int:
    """The command line; returns the exit code."""
    try:
        with quiet_writers():
            options = read_options(arguments)
            if options.for_camera is not None:
                return policy_for_camera(options, arguments)
            return run_seeds(options, arguments) if options.seeds else run(options, arguments)
    except OSError as failure:
        return ended_by_disk(failure)
    except ValueError as wrong:
        print(wrong, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(
            "Stopped at once: what was written until then is in the run's folder, which --resume continues.",
            file=sys.stderr,
        )
        return 130


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
