"""Promises of the stored table hold for commands that the study has never seen, and nothing else is promised."""

import json
from collections.abc import Iterable
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym import (
    Certificate,
    Contact,
    Limb,
    Numerics,
    Scene,
    Seastar,
    SmaPulse,
    SmaWires,
    Strip,
    Water,
    scene_for,
)
from seastar_gym.accuracy import Setting, chapters_certificate, timed_certificate
from seastar_gym.accuracy.chapters import FOLDER, IN_TIME
from seastar_gym.accuracy.measure import Swims, draw_classes, energy_growth, errors, path_lengths, swim_all
from seastar_gym.accuracy.measure import swim as swim_commands
from seastar_gym.scene.numerics import PRESETS, Fidelity
from seastar_gym.scene.robot import SILICONE
from studies.accuracy import (
    Cases,
    Plan,
    gaits,
    joined,
    measured_over,
    pentagon,
    random_gaits,
    random_sequences,
    slow_sequences,
    swims,
)

NAMES = get_args(Fidelity)
TABLE = chapters_certificate()
UNSEEN = random_sequences(24, np.random.default_rng(20_261_121))
"""Random commands that the study did not use: it draws from the seeds 0 and 1."""


def known(scene: str | Scene) -> Setting:
    """Errors of a preset or a scene."""
    found = TABLE.of(Scene.preset(scene) if isinstance(scene, str) else scene)
    assert found is not None
    return found


def path_error(scene: str | Scene) -> float:
    return known(scene).errors["random"]


def swim(cases: Cases, scene: Scene) -> Swims:
    return swim_all([scene], cases.commands)[0]


def path_errors(swum: Swims, exact: Swims) -> np.ndarray:
    return errors(swum, exact, path_lengths(FAST, exact.hub)).path


# The table


def test_table_comes_with_the_package_and_is_complete():
    """If presets are not those of the table, they were changed without `python -m studies.accuracy --store`. A path
    error is the sum of those of space and time, although they cancel in some swims."""
    assert [each.resolution for each in TABLE.settings[: len(NAMES)]] == [PRESETS[name] for name in NAMES]
    assert len({each.resolution for each in TABLE.settings}) == len(TABLE.settings) > 100
    assert TABLE.machine != "" and TABLE.scene.is_chapters
    for row in TABLE.settings:
        assert 0.0 < row.errors["random"] < 0.6 and 0.0 < row.errors["straight"] < 0.6
        assert min(row.errors["repeated"], row.errors["small"], row.time_error) > 0.0
        assert min(row.end_error, row.heading_error) > 0.0 and row.speed > 5.0
        assert row.errors["random"] == pytest.approx(row.space_error + row.time_error, rel=1e-5)
        assert max(row.end_error, row.errors["straight"]) <= 1.1 * row.errors["random"]  # all are rounded upwards
    for name in NAMES:
        assert known(name).typical and TABLE.at(known(name)) == Scene.preset(name)


@pytest.mark.parametrize("file", sorted(FOLDER.iterdir()), ids=lambda file: file.stem)
def test_what_comes_with_the_package_is_a_certificate_file_as_any_other(file, tmp_path):
    Certificate.load(file).save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == file.read_bytes()


def test_the_table_says_over_which_commands_it_was_measured_and_with_which_confidence():
    stored = TABLE.measured_over
    assert stored == json.loads(json.dumps(measured_over(Plan())))
    assert "0.93 confidence" in stored["confidence"] and stored["path_error"]["random, ternary and continuous"] == 51
    assert TABLE.samples == 51 and TABLE.confidence() == pytest.approx(0.93, abs=5e-3)


def test_a_certificate_fits_a_screen_and_names_the_fastest_settings(golden):
    chapters = replace(TABLE, settings=(known("chapter"),))  # its error is beyond all levels
    golden("certificate_shown.txt", "\n".join([repr(TABLE), TABLE._repr_html_(), repr(chapters)]))


def test_presets_keep_what_their_names_say():
    """The chapter's ten nodes are far off the continuum, and no step mends that."""
    promises = {"fast": 0.03, "balanced": 0.012, "accurate": 0.004, "reference": 0.0015}
    assert all(path_error(name) <= promise for name, promise in promises.items()) and path_error("chapter") > 0.2
    speeds = [known(name).speed for name in promises]
    assert speeds == sorted(speeds, reverse=True) and known("fast").speed > known("chapter").speed
    ten = [row for row in TABLE.settings if row.nodes_per_limb == 10]
    assert min(row.space_error for row in ten if row.discretisation == "chapter") > 0.2
    assert max(row.space_error for row in ten if row.discretisation == "continuum") < 0.01


@pytest.mark.parametrize("kind", ["chapter", "continuum"])
def test_space_errors_fall_with_the_nodes(kind):
    by_nodes = {row.nodes_per_limb: row.space_error for row in TABLE.settings if row.discretisation == kind}
    falling = [by_nodes[n] for n in sorted(by_nodes)]
    assert falling == sorted(falling, reverse=True) and len(falling) >= 3


def test_no_stored_setting_is_worse_than_another_of_its_mesh_in_everything():
    """Those without numerical damping are stored for scenes that name them, such as those of bundled policies."""

    figures = [np.array([-row.speed, row.errors["random"], row.errors["repeated"]]) for row in TABLE.settings]
    mesh = [(*row.resolution[:2], row.damping) for row in TABLE.settings]
    for k, row in enumerate(TABLE.settings[len(NAMES) :], start=len(NAMES)):  # presets need not be on the front
        alike = [j for j in range(len(mesh)) if mesh[j] == mesh[k]]
        better = [TABLE.settings[j] for j in alike if (figures[j] < figures[k]).all()]
        assert not better, f"{better[0]} beats {row}"


FAST = Scene.preset("fast")
OTHERS = [
    replace(FAST, robot=replace(FAST.robot, youngs_modulus=2e6)),
    replace(FAST, robot=replace(FAST.robot, n_limbs=4)),
    replace(FAST, fluid=None),
    replace(FAST, fluid=Water(drag_coefficient=1.1)),
    replace(FAST, actuator=SmaPulse(0.3)),
    replace(FAST, limb_strengths=(1.0, 1.0, 1.0, 1.0, 0.5)),
    replace(FAST, gravity=(0.0, -1.0)),
    replace(FAST, robot=replace(FAST.robot, limbs=(Limb(section=Strip(2e-3, 8e-3)),) * 5)),
    Scene(Seastar(discretisation="chapter"), contact=Contact(), numerics=Numerics.preset("chapter")),
]


UNMEASURED = [
    replace(FAST, numerics=Numerics("sdirk3", 7.77e-3)),
    replace(FAST, robot=replace(FAST.robot, nodes_per_limb=9)),
    replace(FAST, robot=replace(FAST.robot, discretisation="chapter")),
]


@pytest.mark.parametrize("scene", [*OTHERS, *UNMEASURED])
def test_another_robot_fluid_or_setting_is_promised_nothing_and_the_sentence_names_a_way(scene):
    assert TABLE.of(scene) is None
    if scene in UNMEASURED:
        TABLE.require_valid(scene)
    else:
        with assert_refused("The certificate is of the chapter's robot in the chapter's water", "certify"):
            TABLE.require_valid(scene)
    # No error depends on the limit of iterations.
    assert TABLE.of(replace(FAST, numerics=replace(FAST.numerics, max_iterations=50))) == known("fast")


# Choice by error

WANTED = [0.2, 0.1, 0.05, 0.03, 0.02, 0.01, 0.005]


@pytest.mark.parametrize("any_gait", [False, True])
@pytest.mark.parametrize("error", WANTED)
def test_for_error_picks_the_fastest_setting_that_keeps_the_error(error, any_gait):
    scene = scene_for(error, any_gait)
    chosen, classes = known(scene), ("random", "repeated")[: 1 + any_gait]
    assert scene.is_chapters and scene.numerics.named
    assert chosen.error(classes) <= error
    for row in TABLE.settings:
        if row.speed > chosen.speed:
            assert row.error(classes) > error


TEN, NINE = (Seastar(nodes_per_limb=n, discretisation=kind) for n, kind in ((10, "chapter"), (9, "continuum")))


@pytest.mark.parametrize(
    "error, robot, sentence",
    [
        (0.01, TEN, "No measured setting keeps the path error below 1 %"),  # with none of their steps
        (0.01, NINE, r"Errors were measured with 6, 7, .* not with 9\.$"),
        (0.01, Seastar(youngs_modulus=2e6), "The certificate is of the chapter's"),
        (0.01, Seastar(n_limbs=3), "The certificate is of the chapter's"),
        (0.9, Seastar(discretisation="chapter", hub_hinge="turning"), '.*hub_hinge="opening"'),
    ],
)
def test_for_error_refuses_another_robot_and_what_was_not_measured(error, robot, sentence):
    with pytest.raises(ValueError, match=rf"^{sentence}") as refusal:
        scene_for(error, robot=robot)
    assert str(refusal.value).endswith(".")


@pytest.mark.parametrize("any_gait", [False, True])
def test_for_error_refuses_what_the_table_cannot_promise_and_names_the_best(any_gait):
    best = min(row.error(("random", "repeated")[: 1 + any_gait]) for row in TABLE.settings)
    with pytest.raises(ValueError, match=r"^No measured setting keeps .*: the best, .* keeps .* %\.$") as refusal:
        scene_for(0.9 * best, any_gait)
    assert f"{100 * best:g} %" in str(refusal.value)
    assert scene_for(best, any_gait)


# The promise, kept


@pytest.fixture(scope="module")
def reference():
    """Swims at fidelity "reference": unseen random commands with the pairs, and the pentagon."""
    batches = [joined(swims(), UNSEEN), pentagon(2, 1)]
    return batches, [swim(batch, Scene.preset("reference")) for batch in batches]


@pytest.mark.parametrize("name", ["fast", "balanced", "accurate", "chapter"])
def test_runs_at_a_fidelity_and_at_reference_differ_by_no_more_than_promised(name, reference):
    """Whole and continuous commands alike; the reference's own promise is part of the difference."""
    batches, exact = reference
    for batch, reference_swim in zip(batches, exact, strict=True):
        off = path_errors(swim(batch, Scene.preset(name)), reference_swim)
        allowed = path_error(name) + path_error("reference")
        assert off.max() <= allowed
        # The worst is not far below, or the promise would be worth little. At "balanced", errors of space and of time
        # cancel, and the promise is their sum.
        if batch is batches[0]:
            assert off.max() > allowed / (8.0 if name == "balanced" else 4.0)


@pytest.mark.parametrize("error", [0.05, 0.01])
def test_for_error_keeps_the_error_on_unseen_commands(error, reference):
    batches, exact = reference
    found = swim(batches[0], scene_for(error))
    assert path_errors(found, exact[0]).max() <= error + path_error("reference")


def promised_errors(row: Setting, kinds: Iterable[str]) -> np.ndarray:
    """Error that is promised of every sequence."""
    return np.array([row.errors[{"gait": "repeated", "slow": "small"}.get(kind, "random")] for kind in kinds])


@pytest.fixture(scope="module")
def unseen():
    """200 sequences that the study did not use, and their swims at fidelity "reference".

    88 are random, 64 gaits, 24 classes of gaits, and 24 slow.
    """
    rng = np.random.default_rng(99)
    some = random_gaits(32, rng)
    moving = [k for k, kind in enumerate(some.kinds) if kind == "gait"]
    alone = Cases(tuple(some.names[k] for k in moving), ("gait",) * len(moving), some.commands[:, moving])
    cases = joined(random_sequences(88, rng), alone, gaits(), slow_sequences(24, rng))
    return cases, swim(cases, Scene.preset("reference"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fast", "balanced", "accurate", "chapter", 0.02, 0.01, 0.005])
def test_promises_hold_on_200_sequences_that_the_study_did_not_use(name, unseen):
    cases, exact = unseen
    assert len(cases) == 200
    scene = Scene.preset(name) if isinstance(name, str) else scene_for(name)
    off = path_errors(swim(cases, scene), exact)
    allowed = promised_errors(known(scene), cases.kinds) + promised_errors(known("reference"), cases.kinds)
    broken = [(cases.names[k], off[k], allowed[k]) for k in np.flatnonzero(off > allowed)]
    assert not broken


@pytest.mark.slow
@pytest.mark.parametrize("error", [0.1, 0.03])
def test_for_error_of_any_gait_keeps_it_whatever_command_is_repeated(error):
    exact = swim(gaits(), Scene.preset("reference"))
    found = swim(gaits(), scene_for(error, any_gait=True))
    assert path_errors(found, exact).max() <= error + known("reference").errors["repeated"]


@pytest.mark.parametrize("name", ["fast", "balanced"])
def test_newtons_tolerance_does_not_drown_slow_swims(name):
    """Its displacements are absolute, and a tenth of the amplitude swims a hundredth of the way."""
    scene, commands = Scene.preset(name), draw_classes(8, 5, 77)
    slow = np.concatenate([commands[:, -8:], 0.1 * commands[:, 24:32], 0.1 * np.tile(np.eye(5), (10, 1, 1))], axis=1)
    exact = swim_commands(replace(scene, numerics=replace(scene.numerics, newton_tolerance=1e-10)), slow)
    errors_of_tolerance = path_errors(swim_commands(scene, slow), exact)
    assert 1e-4 < errors_of_tolerance.max() < 0.05 < known(name).errors["small"] / 4.0


# Long swims

SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in ("accurate", "reference")]


@pytest.mark.parametrize("name", ["fast", "balanced", "chapter", *SLOW])
def test_presets_gather_no_energy_over_long_swims(name):
    assert energy_growth(Scene.preset(name)) < 1.5


def test_nineteen_nodes_gather_energy_with_steps_of_5_ms_but_not_of_half():
    """The midpoint rule damps nothing: some meshes resonate with some steps, long after a promise ends."""
    scene = Scene.preset("balanced")
    undamped = replace(scene.numerics, damping=0.0)
    nineteen = replace(scene, robot=replace(scene.robot, nodes_per_limb=19), numerics=undamped)
    assert energy_growth(nineteen) > 10.0
    assert energy_growth(replace(nineteen, numerics=replace(undamped, step=2.5e-3))) < 1.5


@pytest.mark.parametrize("stiffness", [0.1, 1.0, 10.0])
def test_with_the_damping_of_the_fidelities_no_mesh_of_other_robots_gathers_energy(stiffness):
    numerics = Numerics.preset("balanced")
    for nodes in (7, 19):
        robot = Seastar(nodes_per_limb=nodes, youngs_modulus=stiffness * 1e6)
        assert energy_growth(Scene(robot, numerics=numerics)) < 1.5


def test_errors_in_time_are_the_worst_of_all_measured_times_and_of_one_robot_each():
    silicone = replace(Scene.preset("fast"), robot=replace(Scene.preset("fast").robot, relaxation_time=SILICONE))
    for robot, file in zip((silicone.robot, Scene.preset("fast").robot), IN_TIME, strict=True):
        scene, stored = replace(silicone, robot=robot, actuator=SmaWires()), Certificate.load(file)
        for period in (0.1, 0.13, 0.2, 0.5):
            found = timed_certificate(period, scene)
            assert found.settings == stored.settings and found.decision_period == period
        of_periods = stored.measured_over["largest and median by period"].values()
        for name, largest in stored.settings[0].errors.items():
            assert largest == max(each["fast"][0][name] for each in of_periods)
    assert timed_certificate(0.0999) is timed_certificate(0.501) is timed_certificate(0.2, Scene()) is None
    with assert_refused("decision_period"):
        timed_certificate(0.0)
