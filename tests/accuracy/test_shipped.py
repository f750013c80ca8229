"""Promises of the stored table hold for commands that the study has never seen, and nothing else is promised."""

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
from seastar_gym.accuracy.certificate import MARGIN
from seastar_gym.accuracy.chapters import FOLDER, IN_TIME
from seastar_gym.accuracy.commands import CLASSES, SMALL_COMMANDS
from seastar_gym.accuracy.measure import Swims, energy_growth, errors, path_lengths, swim_all
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.scene.robot import SILICONE
from studies import accuracy as study

NAMES = get_args(Fidelity)
TABLE = chapters_certificate()
FAST = Scene.preset("fast")
REPEATED = TABLE.repeated(TABLE.promised)
RANDOM = tuple(name for name in TABLE.promised if name not in REPEATED)
SEED = 20_261_121
"""Of commands that the study did not use: it draws from 0."""


def known(scene: str | Scene) -> Setting:
    """Errors of a preset or a scene."""
    found = TABLE.of(Scene.preset(scene) if isinstance(scene, str) else scene)
    assert found is not None
    return found


def swim(commands: np.ndarray, scene: Scene) -> Swims:
    return swim_all([scene], commands)[0]


def path_errors(swum: Swims, exact: Swims) -> np.ndarray:
    return errors(swum, exact, path_lengths(FAST, exact.hub)).path


# The table


def test_table_comes_with_the_package_and_is_complete():
    """If presets are not those of the table, they were changed without `python -m studies.accuracy --store`."""
    assert [each.resolution for each in TABLE.settings] == study.TABLES["strokes"].settings()
    assert len({each.resolution for each in TABLE.settings}) == len(TABLE.settings) > 50
    assert TABLE.machine != "" and TABLE.scene.is_chapters
    for row in TABLE.settings:
        assert set(row.errors) == {*CLASSES, "chapter's"} and min(row.errors.values()) > 0.0
        assert all(0.0 < row.typical[name] <= largest for name, largest in row.errors.items())
        assert max(row.space_error, row.time_error) <= row.error(TABLE.promised) * 1.1  # all are rounded upwards
        assert row.error(TABLE.promised) <= (row.space_error + row.time_error) * 1.1
        assert row.promise(TABLE.promised) == pytest.approx(MARGIN * row.error(TABLE.promised), rel=5e-3)
        assert min(row.end_error, row.heading_error) > 0.0 and row.speed > 5.0
    for name in NAMES:
        assert TABLE.at(known(name)) == Scene.preset(name)


@pytest.mark.parametrize("file", sorted(FOLDER.iterdir()), ids=lambda file: file.stem)
def test_what_comes_with_the_package_is_a_certificate_file_as_any_other(file, tmp_path):
    Certificate.load(file).save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == file.read_bytes()


def test_a_certificate_fits_a_screen_and_names_the_fastest_settings(golden):
    chapters = replace(TABLE, settings=(known("chapter"),))  # its error is beyond all levels
    golden("certificate_shown.txt", "\n".join([repr(TABLE), TABLE._repr_html_(), repr(chapters)]))


def test_presets_keep_what_their_names_say():
    """The chapter's ten nodes are far off the continuum, and no step mends that."""
    promises = {"rapid": 0.02, "fast": 0.015, "balanced": 0.006, "accurate": 0.0015, "reference": 0.0005}
    assert all(known(name).promise(RANDOM) <= promise for name, promise in promises.items())
    assert known("chapter").error(TABLE.promised) > 0.2 and known("chapter").space_error > 0.2
    speeds = [known(name).speed for name in promises]
    assert speeds == sorted(speeds, reverse=True) and known("fast").speed > known("chapter").speed
    assert max(row.space_error for row in TABLE.settings if row.nodes_per_limb == 10 and row.damping > 0.0) < 0.03


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
    replace(FAST, numerics=Numerics("sdirk2", 7.77e-3)),
    replace(FAST, robot=replace(FAST.robot, nodes_per_limb=15)),
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


@pytest.mark.parametrize("period", [None, 1.0, 0.2, 0.35])
@pytest.mark.parametrize("any_gait", [False, True])
@pytest.mark.parametrize("error", [0.1, 0.05, 0.03, 0.02, 0.01])
def test_for_error_picks_the_fastest_setting_that_keeps_the_error(error, any_gait, period):
    scene = scene_for(error, any_gait, decision_period=period)
    table = TABLE if period in (None, 1.0) else timed_certificate(period)
    chosen, repeated = table.of(scene), table.repeated(table.promised)
    classes = table.promised if any_gait else [name for name in table.promised if name not in repeated]
    assert scene.numerics.named and chosen.promise(classes) <= error
    for row in table.settings:
        if row.speed > chosen.speed and row.is_energy_stable:
            assert row.promise(classes) > error


# The promise, kept


@pytest.fixture(scope="module")
def fresh():
    """Classes of strokes that the study did not use, and their swims at fidelity "reference"."""
    batches = study.of_strokes(4, SEED, (2, 1))
    return batches, [swim(batch.joined, Scene.preset("reference")) for batch in batches]


@pytest.mark.parametrize("scene", ["rapid", "fast", "balanced", "accurate", "chapter", 0.05, 0.01])
def test_swims_of_no_table_differ_from_reference_by_no_more_than_promised(scene, fresh):
    """The reference's own promise is part of it. The worst is not far below, or a promise would be worth little."""
    scene = scene_for(scene) if isinstance(scene, float) else Scene.preset(scene)
    row, exact, over = known(scene), known("reference"), []
    for batch, reference in zip(*fresh, strict=True):
        for name, off in batch.of_classes(path_errors(swim(batch.joined, scene), reference)).items():
            classes = (name,) if name == SMALL_COMMANDS else REPEATED if name in REPEATED else RANDOM
            over.append(off.max() / (row.promise(classes) + exact.promise(classes)))
    assert 0.15 < max(over) <= 1.0


# Long swims


@pytest.mark.parametrize("name", ["rapid", "fast", "balanced", "accurate"])
def test_presets_gather_no_energy_over_long_swims(name):
    """Nor with decisions that are held. The tables have them, and the cheaper ones are swum again."""
    assert all(study.in_table(name, table).energy_growth <= 1.1 for table in study.TABLES)
    if name in ("rapid", "fast"):
        assert energy_growth(Scene.preset(name), samples=4, seed=1) < 1.5


def test_nineteen_nodes_gather_energy_with_steps_of_5_ms_but_not_of_half():
    """The midpoint rule damps nothing: some meshes resonate with some steps, long after a promise ends."""
    scene = Scene.preset("balanced")
    undamped = replace(scene.numerics, damping=0.0)
    nineteen = replace(scene, robot=replace(scene.robot, nodes_per_limb=19), numerics=undamped)
    assert energy_growth(nineteen, samples=3) > 10.0
    assert energy_growth(replace(nineteen, numerics=replace(undamped, step=2.5e-3)), samples=3) < 1.5


@pytest.mark.parametrize("stiffness", [0.1, 1.0, 10.0])
def test_with_the_damping_of_the_fidelities_no_mesh_of_other_robots_gathers_energy(stiffness):
    numerics = Numerics.preset("balanced")
    for nodes in (7, 19):
        robot = Seastar(nodes_per_limb=nodes, youngs_modulus=stiffness * 1e6)
        assert energy_growth(Scene(robot, numerics=numerics), samples=3) < 1.5


def test_errors_in_time_are_the_worst_of_all_measured_times_and_of_one_robot_each():
    silicone = replace(Scene.preset("fast"), robot=replace(Scene.preset("fast").robot, relaxation_time=SILICONE))
    for robot, file in zip((silicone.robot, Scene.preset("fast").robot), IN_TIME, strict=True):
        scene, stored = replace(silicone, robot=robot, actuator=SmaWires()), Certificate.load(file)
        for period in (0.1, 0.13, 0.2, 0.5):
            found = timed_certificate(period, scene)
            assert found.settings == stored.settings and found.decision_period == period
        of_periods = stored.measured_over["largest and median by period"].values()
        for name, largest in stored.settings[0].errors.items():
            assert largest == max(each["rapid"][0][name] for each in of_periods)
    assert timed_certificate(0.0999) is timed_certificate(0.501) is timed_certificate(0.2, Scene()) is None
    with assert_refused("decision_period"):
        timed_certificate(0.0)
