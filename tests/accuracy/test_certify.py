"""Certificates of scenes: what they measure, promise and refuse, and when they lapse."""

import json
import math
import sys
import warnings
from dataclasses import replace
from functools import partial

import gymnasium as gym
import numpy as np
import pytest

import seastar_gym
from refusals import assert_refused
from seastar_gym import Body, Certificate, Contact, Numerics, Scene, Seastar, SmaPulse, SmaWires
from seastar_gym.accuracy import command, commands, measure, timed_certificate
from seastar_gym.accuracy.certificate import _digest
from seastar_gym.accuracy.setting import resolved
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.spec import PlainSpec
from seastar_gym.envs.vector import SeastarSwimVectorEnv

SMALL_ROBOT = Seastar(limb_length=0.08)
SCENE = Scene(SMALL_ROBOT)
REPEATED = ("repeated ternary", "alternating ternary")
"""Classes of a certificate's commands that `gait_error` is of."""
SAMPLES = 2


@pytest.fixture(scope="module")
def certificate(few_settings):
    return seastar_gym.certify(SCENE, SAMPLES)


def test_every_setting_has_the_errors_of_every_class_and_more_nodes_leave_less_error_of_space(certificate):
    assert [each.nodes_per_limb for each in certificate.settings] == [5, 5, 9, 9]
    for each in certificate.settings:
        assert set(each.errors) == set(commands.CLASSES)
        assert 0.0 < each.time_error < each.error(certificate.promised) <= each.space_error + each.time_error + 1e-2
    coarse, fine = certificate.settings[0], certificate.settings[2]
    assert fine.space_error < 0.6 * coarse.space_error
    assert 0.0 < certificate.limit_error < fine.space_error


def test_a_typical_error_is_the_median_of_a_class(certificate):
    errors = np.zeros((len(commands.CLASSES), 5))
    errors[1] = [0.05, 0.011, 0.9, 0.012, 0.04]
    assert measure.by_class(errors.ravel(), 5)["random continuous"] == 0.9
    assert measure.by_class(errors.ravel(), 5, np.median)["random continuous"] == 0.04
    for each in certificate.settings:
        assert all(0.0 < each.typical[name] <= each.errors[name] for name in commands.CLASSES)
        assert each.typical_error(certificate.promised) == max(each.typical[name] for name in certificate.promised)
    first = certificate.settings[0]
    bound, typical = first.error(certificate.promised), first.typical_error(certificate.promised)
    assert f"{100 * bound:.2g} % ({100 * typical:.2g} %)" in command.as_text(certificate)


def test_errors_bound_those_of_the_sequences_they_were_measured_on(certificate):
    drawn = commands.draw_classes(SAMPLES, 5, 0)
    limit = measure.swim(resolved(SCENE, 33, measure.SHORT), drawn)
    lengths = measure.path_lengths(SCENE, limit.hub)
    for each in certificate.settings:
        errors = measure.errors(measure.swim(certificate.at(each), drawn), limit, lengths).path
        for name, found in zip(commands.CLASSES, errors.reshape(-1, SAMPLES), strict=True):
            assert found.max() <= each.errors[name] * 1.05, (str(each), name)


@pytest.mark.slow
def test_a_robot_with_a_body_has_a_certificate_of_its_own(few_settings, tmp_path):
    robot = replace(SMALL_ROBOT, body=Body(radius=0.02, mass=0.02))
    certificate = seastar_gym.certify(Scene(robot), SAMPLES)
    coarse, fine = certificate.settings[0], certificate.settings[2]
    assert 0.0 < fine.space_error < 0.6 * coarse.space_error and all(each.speed > 0.0 for each in certificate.settings)
    certificate.save(tmp_path / "mine.json")
    read = Certificate.load(tmp_path / "mine.json")
    best = read.for_error(max(each.error(certificate.promised) for each in certificate.settings))
    assert best.robot.body == robot.body and read.of(best) is not None
    read.require_valid(best)
    with assert_refused("another scene"):
        read.require_valid(replace(best, robot=replace(best.robot, body=Body(radius=0.02, mass=0.03))))


def test_for_error_is_the_fastest_setting_that_keeps_it(certificate):
    errors = {each.error(certificate.promised): each for each in certificate.settings}
    fastest = max(certificate.settings, key=lambda each: each.speed)
    assert certificate.for_error(max(errors)).numerics == fastest.numerics
    best = certificate.for_error(min(errors))
    assert (best.robot.nodes_per_limb, best.numerics) == (
        errors[min(errors)].nodes_per_limb, errors[min(errors)].numerics,
    )  # fmt: skip
    assert best.robot.limb_length == 0.08
    with assert_refused("No measured setting keeps"):
        certificate.for_error(1e-9)
    with assert_refused("positive, finite"):
        certificate.for_error(-1.0)
    with assert_refused("Classes of commands are"):
        certificate.for_error(0.1, ("of yesterday",))


def test_settings_that_gather_energy_over_long_swims_are_not_chosen(certificate):
    assert all(each.energy_growth < 1.5 for each in certificate.settings)
    largest = max(each.error(certificate.promised) for each in certificate.settings)
    fastest = max(certificate.settings, key=lambda each: each.speed)

    def growing(*some):
        settings = (replace(each, energy_growth=60.0) if each in some else each for each in certificate.settings)
        return replace(certificate, settings=tuple(settings))

    chosen = growing(fastest).for_error(largest)
    assert (chosen.robot.nodes_per_limb, chosen.numerics) != (fastest.nodes_per_limb, fastest.numerics)
    assert "gathers energy" in command.as_text(growing(fastest))
    with assert_refused("Every measured setting of this scene gathers energy"):
        growing(*certificate.settings).for_error(largest)


def test_a_scene_for_an_error_is_that_of_its_certificate(certificate, tmp_path):
    certificate.save(tmp_path / "mine.json")
    largest = max(each.error(certificate.promised) for each in certificate.settings)
    for given in (certificate, tmp_path / "mine.json", str(tmp_path / "mine.json")):
        assert Scene.for_error(largest, certificate=given) == certificate.for_error(largest)
    kept = Scene.for_error(0.9, robot=Seastar(limb_length=0.08, nodes_per_limb=9), certificate=certificate)
    assert kept.robot.nodes_per_limb == 9 and kept.robot.limb_length == 0.08
    with assert_refused("measured with 5, 9 nodes per limb"):
        Scene.for_error(0.9, robot=Seastar(limb_length=0.08, nodes_per_limb=10), certificate=certificate)
    with assert_refused("No measured setting keeps"):
        Scene.for_error(1e-9, certificate=certificate)


def test_a_scene_for_an_error_is_refused_where_the_certificate_has_lapsed(certificate):
    with assert_refused("of another scene"):
        Scene.for_error(0.9, robot=Seastar(limb_length=0.07, nodes_per_limb=9), certificate=certificate)
    for robot in (None, SMALL_ROBOT):
        with assert_refused("of version 0.0.1"):
            Scene.for_error(0.9, robot=robot, certificate=replace(certificate, version="0.0.1"))
    for lapsed in ({"version": "0.0.1"}, {"classes": 7}):
        with assert_refused("certify the scene again"):
            replace(certificate, **lapsed).for_error(0.9)
    with assert_refused("certificate must be a Certificate"):
        Scene.for_error(0.9, certificate=3)
    with assert_refused("cannot be read"):
        Scene.for_error(0.9, certificate="not there.json")


def test_a_certificate_is_read_back_as_it_was_written(certificate, tmp_path):
    certificate.save(tmp_path / "mine.json")
    assert Certificate.load(tmp_path / "mine.json") == certificate


def test_a_file_without_the_entries_that_were_added_is_read_as_it_was(certificate, tmp_path):
    def older(data):
        del data["decision_period"], data["measured_over"]
        for each in data["settings"]:
            del each["path_tolerance"], each["discretisation"], each["damping"]
            assert len(each) == 10

    assert Certificate.load(changed(certificate, tmp_path, older)) == certificate


def changed(certificate, folder, change, sign=True):
    """File of a certificate whose content was changed, with the digest of the new content."""
    file = folder / "mine.json"
    certificate.save(file)
    data = json.loads(file.read_text(encoding="utf-8"))
    change(data)
    if sign:
        data["digest"] = _digest({name: part for name, part in data.items() if name != "digest"})
    file.write_text(json.dumps(data), encoding="utf-8")
    return file


DAMAGES = {
    "setting": lambda data: data.pop("settings"),
    "form is 7": lambda data: data.update(format=7),
    "form is 2": lambda data: data.update(format=2),
    "speed": lambda data: data["settings"][0].update(speed="fast"),
    "settings must": lambda data: data.update(settings=[]),
    "version": lambda data: data.update(scene={}),
    "errors must be a finite number, not negative": lambda data: data["settings"][0]["errors"].update(small=-0.1),
    "typical must be a finite number": lambda data: data["settings"][0]["typical"].update(small=float("nan")),
    "same classes": lambda data: data["settings"][0]["errors"].pop("small"),
    "errors must be numbers by class": lambda data: data["settings"][0].update(errors=[0.1]),
    "space_error must be": lambda data: data["settings"][0].update(space_error=-0.1),
    "time_error must be": lambda data: data["settings"][0].update(time_error=True),
    "energy_growth must be": lambda data: data["settings"][0].update(energy_growth=-1.0),
    "nodes_per_limb must be": lambda data: data["settings"][0].update(nodes_per_limb=-7),
    "samples must be": lambda data: data.update(samples=-5),
    "limit_error must be": lambda data: data.update(limit_error=-1e-3),
    "promised must be": lambda data: data.update(promised=["of yesterday"]),
    "actions must be": lambda data: data.update(actions=[]),
    "classes must be a whole number": lambda data: data.update(classes="one"),
}


@pytest.mark.parametrize("words", DAMAGES)
def test_a_damaged_certificate_is_refused(certificate, tmp_path, words):
    with assert_refused("is no certificate", words):
        Certificate.load(changed(certificate, tmp_path, DAMAGES[words]))


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data["scene"]["robot"].update(youngs_modulus=2e6),
        lambda data: data["settings"][0]["errors"].update(small=1e-9),
        lambda data: data.update(samples=10_000),
        lambda data: data.update(digest="0"),
    ],
)
def test_the_errors_of_a_file_are_those_of_its_scene(certificate, tmp_path, change):
    with assert_refused("is no certificate", "content was changed since it was measured"):
        Certificate.load(changed(certificate, tmp_path, change, sign=False))
    changed(certificate, tmp_path, lambda data: data.update(dict(reversed(data.items()))), sign=False)
    assert Certificate.load(tmp_path / "mine.json") == certificate


DEEP = '{"format": 3, "digest": ' + '{"a": ' * 900 + "1" + "}" * 901


@pytest.mark.parametrize("text", ["[" * 100_000, DEEP, "[]", "3"])
def test_a_file_of_anything_else_is_no_certificate(tmp_path, text):
    (tmp_path / "mine.json").write_text(text, encoding="utf-8")
    with assert_refused("is no certificate"):
        Certificate.load(tmp_path / "mine.json")
    with assert_refused("cannot be read"):
        Certificate.load("no\0file.json")


def test_the_environment_tells_the_errors_of_a_certified_scene(certificate, tmp_path):
    setting = certificate.settings[2]
    certificate.save(tmp_path / "mine.json")
    for given in (certificate, tmp_path / "mine.json", str(tmp_path / "mine.json")):
        env = gym.make("SeastarSwim-v0", scene=certificate.at(setting), certificate=given)
        info = env.reset(seed=0)[1]
        assert max(info["path_error"], info["gait_error"]) == setting.error(certificate.actions)
        assert info["gait_error"] == setting.error(REPEATED)
        assert info["typical_gait_error"] == setting.typical_error(REPEATED)
        assert info["typical_error"] == setting.typical_error(tuple({*certificate.actions} - {*REPEATED}))
        assert (info["space_error"], info["time_error"]) == (setting.space_error, setting.time_error)
        assert info["batch_real_time_factor"] == setting.speed
    envs = gym.make_vec("SeastarSwim-v0", 3, vectorization_mode="vector_entry_point",
                        scene=certificate.at(setting), certificate=certificate)  # fmt: skip
    assert (envs.reset(seed=0)[1]["path_error"] == info["path_error"]).all()
    assert isinstance(env.unwrapped, PlainSpec)
    assert json.loads(env.spec.to_json())["kwargs"]["certificate"] == str(tmp_path / "mine.json")


def test_a_setting_that_a_certificate_has_not_is_promised_nothing_and_a_warning_says_so(certificate):
    scene = replace(certificate.at(certificate.settings[2]), numerics=Numerics())
    for made in (partial(gym.make, "SeastarSwim-v0"), partial(SeastarSwimVectorEnv, 2)):
        with pytest.warns(UserWarning, match=r"no errors of 9 nodes per limb.*for_error"):
            env = made(scene=scene, certificate=certificate)
        assert np.isnan(env.reset(seed=0)[1]["path_error"]).all()


@pytest.mark.parametrize("other", [Scene(), replace(SCENE, contact=Contact()), replace(SCENE, actuator=SmaPulse(0.5))])
def test_a_certificate_lapses_for_another_scene_and_with_the_version_and_is_one(certificate, other):
    for scene, given, words in (
        (other, certificate, "of another scene"),
        (SCENE, replace(certificate, version="0.0.1"), "of version 0.0.1"),
        (None, 3, "certificate must be a Certificate"),
        (None, "not there.json", "cannot be read"),
    ):
        with assert_refused(words):
            gym.make("SeastarSwim-v0", scene=scene, certificate=given)


def test_a_fidelity_for_an_uncertified_scene_warns_with_the_command_that_measures_it():
    with pytest.warns(UserWarning, match="seastar certify measures them"):
        gym.make("SeastarSwim-v0", scene=SCENE, fidelity="fast")
    with pytest.warns(UserWarning, match=r"errors in info are NaN") as told:
        SeastarSwimEnv(scene=SCENE, fidelity="fast")
    assert told[0].filename == __file__  # where the environment is made
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gym.make("SeastarSwim-v0", fidelity="fast")


def test_a_certificate_is_of_strokes(certificate):
    wired = replace(certificate, scene=replace(certificate.scene, actuator=SmaWires()))
    scene = wired.at(wired.settings[0])
    for made in (partial(gym.make, "SeastarSwim-v0"), partial(SeastarSwimVectorEnv, 2)):
        with assert_refused("strokes of 1 s", "every 0.5 s", "error_bars=True"):
            made(scene=scene, certificate=wired, decision_period=0.5)
        with assert_refused("decision_period must be"):
            made(scene=scene, certificate=wired, decision_period="0.5")
        for period in (None, 1.0):
            info = made(scene=scene, certificate=wired, decision_period=period).reset(seed=0)[1]
            assert np.all(info["gait_error"] == wired.settings[0].error(REPEATED))


def test_a_certificate_of_decisions_is_of_no_strokes():
    scene, timed = replace(Scene.preset("fast"), actuator=SmaWires()), timed_certificate(0.2)
    with assert_refused("errors of decisions every 0.2 s, none of strokes of 1 s"):
        gym.make("SeastarSwim-v0", scene=scene, certificate=timed)
    info = gym.make("SeastarSwim-v0", scene=scene, certificate=timed, decision_period=0.2).reset(seed=0)[1]
    assert info["gait_error"] == timed.of(scene).errors["repeated"] and "batch_real_time_factor" not in info


def test_wires_of_the_chapters_robot_need_no_certificate_in_time_and_others_are_told_of_error_bars():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = replace(Scene.preset("fast"), actuator=SmaWires())
        gym.make("SeastarSwim-v0", scene=scene, fidelity="fast", decision_period=0.2)
    with pytest.warns(UserWarning, match=r"info has no errors: error_bars=True"):
        gym.make("SeastarSwim-v0", scene=replace(SCENE, actuator=SmaWires()), fidelity="fast", decision_period=0.2)


def test_the_command_writes_certificate_and_picture(few_settings, tmp_path, monkeypatch, capsys):
    (tmp_path / "mine.py").write_text(
        "from seastar_gym import Scene, Seastar\nscene = Scene(Seastar(limb_length=0.08))\n", encoding="utf-8"
    )
    out = tmp_path / "certificate.json"
    arguments = [str(tmp_path / "mine.py"), "--samples", "2", "--error", "0.9", "--out", str(out)]
    arguments += ["--chosen", str(tmp_path / "chosen.json")]
    monkeypatch.setattr(sys, "argv", ["certify", *arguments])
    assert command.main() == 0
    assert Certificate.load(out).scene.robot.limb_length == 0.08
    assert out.with_suffix(".png").stat().st_size > 10_000
    assert "90 %: nodes_per_limb=5" in capsys.readouterr().out
    assert command.load_scene(tmp_path / "chosen.json") == Certificate.load(out).for_error(0.9)
    (tmp_path / "mine.py").write_text("scene = 3\n", encoding="utf-8")
    assert command.main() == 2
    assert "must define `scene`" in capsys.readouterr().err
    monkeypatch.setattr(command, "certify", None)  # what follows is refused before anything is measured
    for more, words in (
        (["--error", "0"], "positive, finite share"),
        (["--out", str(tmp_path)], "is a folder"),
        (["--out", str(tmp_path / "mine.png")], "where the picture goes"),
        (["--error", "0.1", "--chosen", str(tmp_path)], "is a folder"),
        (["--chosen", "chosen.json"], "give both"),
    ):
        assert command.main(more) == 2
        assert words in capsys.readouterr().err
    own = "from seastar_gym import Scene, SmaPulse\nclass Own(SmaPulse):\n    pass\nscene = Scene(actuator=Own())\n"
    (tmp_path / "own.py").write_text(own, encoding="utf-8")
    assert command.main([str(tmp_path / "own.py")]) == 2
    assert "register_part" in capsys.readouterr().err
    file_of_scene = tmp_path / "mine.json"
    file_of_scene.write_text(json.dumps(SCENE.to_dict()), encoding="utf-8")
    assert command.load_scene(file_of_scene) == SCENE
    assert command.load_scene(None) == Scene()
    with pytest.raises(ValueError, match=r"is no file\.$"):
        command.load_scene(tmp_path)
    (tmp_path / "own.py").write_text("scene = Scene(\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"own\.py, line 1, is not Python: .* never closed\.$"):
        command.load_scene(tmp_path / "own.py")
    file_of_scene.write_text("{", encoding="utf-8")
    with pytest.raises(ValueError, match=r"mine\.json is no scene: .*Expecting"):
        command.load_scene(file_of_scene)


@pytest.mark.parametrize(
    "change, words",
    [
        ({"scene": 3}, "scene must be a Scene"),
        ({"settings": ()}, "settings must be some Settings"),
        ({"settings": (3,)}, "settings must be some Settings"),
        ({"promised": ()}, "promised must be some of"),
        ({"actions": ("of yesterday",)}, "actions must be some of"),
        ({"samples": 1}, "samples must be a whole number from 2 to 100000"),
        ({"samples": 100_001}, "samples must be a whole number from 2 to 100000"),
        ({"limit_error": -1e-9}, "limit_error"),
        ({"decision_period": 0.0}, "decision_period"),
        ({"classes": 1.0}, "classes must be a whole number"),
        ({"version": 3}, "version and machine must be words"),
        ({"machine": None}, "version and machine must be words"),
    ],
)
def test_what_no_certificate_can_hold_is_refused(certificate, change, words):
    with assert_refused(words):
        replace(certificate, **change)
    first, *others = certificate.settings
    with assert_refused("settings must have errors of the same classes"):
        fewer = {name: getattr(first, name) | {"own": 0.1} for name in ("errors", "typical")}
        replace(certificate, settings=(replace(first, **fewer), *others))
    for samples in (2, 100_000):
        assert replace(certificate, samples=samples, limit_error=0.0, decision_period=0.1).samples == samples


@pytest.mark.parametrize(
    "change, words",
    [
        ({"discretisation": "finite"}, "discretisation must be one of"),
        ({"nodes_per_limb": 1}, "nodes_per_limb must be a whole number from 2 to 10000"),
        ({"nodes_per_limb": 10_001}, "nodes_per_limb must be a whole number from 2 to 10000"),
        ({"speed": 0.0}, "speed"),
        ({"errors": {}}, "errors must be numbers by class"),
        ({"errors": {"own": -0.1}}, "errors"),
        ({"typical": {"own": 0.1}}, "errors and typical must have the same classes"),
        ({"typical": [0.1]}, "typical must be numbers by class"),
        ({"space_error": math.nan}, "space_error"),
        ({"time_error": -0.1}, "time_error"),
        *(({name: -0.1}, name) for name in ("energy_growth", "heading_error", "end_error")),
    ],
)
def test_what_no_setting_can_have_is_refused(certificate, change, words):
    setting = certificate.settings[0]
    with assert_refused(words):
        replace(setting, **change)
    failed = replace(setting, space_error=math.inf, energy_growth=math.inf, speed=math.nan, typical={})
    assert math.isnan(failed.typical_error(setting.errors)) and math.isnan(failed.error(()))
    assert math.isnan(failed.error(("of yesterday",))) and not failed.is_energy_stable
    adapted = replace(setting, scheme="implicit-midpoint", step=0.02, path_tolerance=0.01, nodes_per_limb=5)
    assert str(adapted) == '"implicit-midpoint" at 20 ms adapted to 1 % with 5 nodes per limb'


@pytest.mark.parametrize(
    "scene, words",
    [
        (3, "certify needs a Scene, not 3."),
        (Scene(Seastar(limb_length=np.array([0.1, 0.2]))), "certify scene.of_robot(0), say."),
        (Scene(held_nodes=(0,)), "belong to one mesh"),
        (Scene(loads=((1, 0.0, 1.0),)), "belong to one mesh"),
        (Scene(actuator=SmaPulse(0.0)), "Nothing moves this robot"),
        (Scene(limb_strengths=(0.0,) * 5), "Nothing moves this robot"),
    ],
)
def test_a_scene_that_has_no_certificate_is_refused(scene, words):
    with assert_refused(words):
        seastar_gym.certify(scene)
    with assert_refused("samples"):
        seastar_gym.certify(Scene(), samples=1)


def test_the_confidence_is_that_of_so_many_sequences(certificate):
    assert replace(certificate, samples=60).confidence() == pytest.approx(1.0 - 0.95**60)
    assert replace(certificate, samples=2).confidence(0.5) == 0.75


MADE = {
    "speed": 1234.5, "energy_growth": 1.0, "space_error": 0.02, "time_error": 0.003,
    "errors": {"a": 0.021, "b": 0.05, "small": 0.3}, "typical": {"a": 0.01, "b": 0.004, "small": 0.2},
}  # fmt: skip


def made(certificate):
    """Certificate of two settings and three classes, with numbers that are easy to read."""
    coarse, _, fine, _ = (replace(each, **MADE) for each in certificate.settings)
    slow = replace(fine, speed=99.4, energy_growth=2.0, space_error=0.001)
    return replace(certificate, settings=(slow, coarse), promised=("a", "b"), actions=("a",), limit_error=0.0005)


def test_the_table_of_a_certificate_is_in_columns_fastest_first(certificate):
    assert command.as_text(made(certificate)).splitlines() == [
        "setting                                         space     time     sum (typical) actions (typical)"
        "   small (typical)  x real time",
        '"sdirk2" at 20 ms with 5 nodes per limb           2 %    0.3 %      5 % (1 %)       2.1 % (1 %)'
        "        30 % (20 %)          1,234",
        '"sdirk2" at 20 ms with 9 nodes per limb         0.1 %    0.3 %      5 % (1 %)       2.1 % (1 %)'
        "        30 % (20 %)             99  gathers energy over long swims, not chosen",
        "With 10 % confidence, at most 5 % of the sequences of a class exceed its error (2 of each were measured); "
        "half of them exceed the typical one. The limit errs by 0.05 %.",
    ]


def test_the_picture_of_a_certificate_has_a_line_for_every_number_of_nodes(certificate, tmp_path, monkeypatch):
    figures = []
    monkeypatch.setattr(command, "save_figure", lambda figure, file, **options: figures.append((figure, options)))
    slower = replace(made(certificate).settings[1], speed=10.0, errors=MADE["errors"] | {"b": 0.004})
    command.draw(replace(made(certificate), settings=(*made(certificate).settings, slower)), tmp_path / "mine.png")
    ((figure, options),) = figures
    (axes,) = figure.axes
    lines = {line.get_label(): line.get_xydata().tolist() for line in axes.lines}
    assert lines == {"5 nodes per limb": [[10.0, 2.1], [1234.5, 5.0]], "9 nodes per limb": [[99.4, 5.0]]}
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log") and axes.xaxis.get_gridlines()[0].get_visible()
    assert figure.get_size_inches().tolist() == [6.4, 4.4] and options == {"dpi": 130}
    assert not axes.get_legend().get_frame_on()
