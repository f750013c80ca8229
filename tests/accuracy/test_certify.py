"""Certificates of scenes: what they measure, promise and refuse, and when they lapse."""

import json
import warnings
from dataclasses import fields, replace
from functools import partial

import gymnasium as gym
import numpy as np
import pytest

import seastar_gym
from drawn import drawn
from odd_values import taken
from refusals import assert_refused, assert_told
from seastar_gym import Certificate, Contact, Numerics, Scene, Seastar, SmaPulse, SmaWires, scene_for
from seastar_gym.accuracy import command, commands, measure, timed_certificate
from seastar_gym.accuracy.certificate import _digest, resolved
from seastar_gym.envs.attributes import RobotsEnv
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.scene.scene import load_scene

SMALL_ROBOT = Seastar(limb_length=0.08)
SCENE = Scene(SMALL_ROBOT)
WIRED = make_scene(None, "fast", 0.2)
REPEATED = tuple(f"{how} {what}" for how in ("repeated", "alternating") for what in ("ternary", "continuous"))
"""Classes of a certificate's commands that `gait_error` is of."""
SAMPLES = 2
BOTH = partial(gym.make, "SeastarSwim-v0"), partial(SeastarSwimVectorEnv, 2)


@pytest.fixture(scope="module")
def certificate(few_settings):
    return seastar_gym.certify(SCENE, SAMPLES)


MADE = {
    "speed": 1234.5, "energy_growth": 1.0, "space_error": 0.02, "time_error": 0.003,
    "errors": {"a": 0.021, "b": 0.05, "small": 0.3}, "typical": {"a": 0.01, "b": 0.004, "small": 0.2},
}  # fmt: skip


@pytest.fixture
def made(certificate):
    """Certificate of two settings and three classes, with numbers that are easy to read."""
    coarse, _, fine, _ = (replace(each, **MADE) for each in certificate.settings)
    slow = replace(fine, speed=99.4, energy_growth=2.0, space_error=0.001)
    return replace(certificate, settings=(slow, coarse), promised=("a", "b"), limit_error=0.0005)


@pytest.fixture
def file(certificate, tmp_path):
    certificate.save(tmp_path / "mine.json")
    return tmp_path / "mine.json"


# What is measured


def test_errors_of_every_class_bound_those_of_its_sequences_and_fall_with_the_nodes(certificate):
    assert [each.nodes_per_limb for each in certificate.settings] == [5, 5, 9, 9]
    drawn = commands.draw_batch(SAMPLES, 5, 0).joined
    limit = measure.swim(resolved(SCENE, 33, measure.SHORT), drawn)
    lengths = measure.path_lengths(SCENE, limit.hub)
    for each in certificate.settings:
        assert set(each.errors) == set(commands.CLASSES)
        assert 0.0 < each.time_error < each.error(certificate.promised) <= each.space_error + each.time_error + 1e-2
        assert all(0.0 < each.typical[name] <= each.errors[name] for name in commands.CLASSES)
        assert each.typical_error(certificate.promised) == max(each.typical[name] for name in certificate.promised)
        errors = measure.errors(measure.swim(certificate.at(each), drawn), limit, lengths).path
        for name, found in zip(commands.CLASSES, errors.reshape(-1, SAMPLES), strict=True):
            assert found.max() <= each.errors[name] * 1.05, (str(each), name)
    coarse, fine = certificate.settings[0], certificate.settings[2]
    assert 0.0 < certificate.limit_error < fine.space_error < 0.6 * coarse.space_error


def test_a_certificate_of_decisions_is_told_in_the_environment_of_that_period(few_settings, tmp_path):
    scene = replace(SCENE, actuator=SmaWires())
    certificate = seastar_gym.certify(scene, SAMPLES, decision_period=0.25)
    assert set(certificate.settings[0].errors) == set(commands.DECISIONS) and certificate.decision_period == 0.25
    assert all(0.0 < each.promise(certificate.promised) < np.inf for each in certificate.settings)
    assert isinstance(certificate.measured_over["resonances"], list)
    certificate.save(tmp_path / "mine.json")
    chosen = scene_for(0.99, certificate=tmp_path / "mine.json")
    timed = {"scene": chosen, "certificate": tmp_path / "mine.json"}
    info = gym.make("SeastarSwim-v0", decision_period=0.25, **timed).reset(seed=0)[1]
    assert info["gait_error"] == certificate.of(chosen).promise(certificate.repeated(certificate.promised))
    with assert_refused("errors of decisions every 0.25 s, none of decisions every 0.2 s"):
        gym.make("SeastarSwim-v0", decision_period=0.2, **timed)
    for wrong, period in ((SCENE, 0.25), (scene, 1e-3), (scene, 1.5)):
        with assert_refused("need wires"):
            seastar_gym.certify(wrong, decision_period=period)


@pytest.mark.parametrize(
    "scene, words",
    [
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


# What is chosen


def test_for_error_is_the_fastest_setting_that_keeps_it_and_gathers_no_energy(certificate, file):
    assert all(each.energy_growth < 1.5 for each in certificate.settings)
    errors = {each.promise(certificate.promised): each for each in certificate.settings}
    fastest, best = max(certificate.settings, key=lambda each: each.speed), errors[min(errors)]

    def chosen(certificate, error):
        scene = certificate.for_error(error)
        return scene.robot.limb_length, scene.robot.nodes_per_limb, scene.numerics

    assert chosen(certificate, max(errors)) == (0.08, fastest.nodes_per_limb, fastest.numerics)
    assert chosen(certificate, min(errors)) == (0.08, best.nodes_per_limb, best.numerics)
    growing = [replace(each, energy_growth=60.0) if each is fastest else each for each in certificate.settings]
    stable = replace(certificate, settings=tuple(growing))
    assert chosen(stable, max(errors))[1:] != chosen(certificate, max(errors))[1:]
    for given in (certificate, file, str(file)):
        assert scene_for(max(errors), certificate=given) == certificate.for_error(max(errors))
    kept = scene_for(0.9, robot=Seastar(limb_length=0.08, nodes_per_limb=9), certificate=certificate)
    assert kept.robot.nodes_per_limb == 9 and kept.robot.limb_length == 0.08


def other_robot(**numbers):
    return lambda mine: scene_for(0.9, robot=Seastar(**numbers), certificate=mine)


def lapsed(**entries):
    return lambda mine: replace(mine, **entries).for_error(0.9)


NOT_CHOSEN = [
    (lambda mine: mine.for_error(1e-9), "No measured setting keeps"),
    (lambda mine: mine.for_error(0.1, ("of yesterday",)), "Classes of commands are"),
    (lambda mine: replace(mine, settings=(replace(mine.settings[0], energy_growth=60.0),)).for_error(0.9),
     "Every measured setting of this scene gathers energy"),
    (lapsed(version="0.0.1"), "certify the scene again"),
    (lapsed(classes=7), "certify the scene again"),
    (other_robot(limb_length=0.08, nodes_per_limb=10), "measured with 5, 9 nodes per limb"),
    (other_robot(limb_length=0.07, nodes_per_limb=9), "of another scene"),
    (lambda mine: scene_for(0.9, robot=SMALL_ROBOT, certificate=replace(mine, version="0.0.1")), "0.0.1"),
    (lambda mine: scene_for(0.9, certificate="not there.json"), "cannot be read"),
]  # fmt: skip


@pytest.mark.parametrize("choose, words", NOT_CHOSEN)
def test_what_a_certificate_cannot_promise_is_refused(choose, words, certificate):
    with assert_refused(words):
        choose(certificate)


# The file


def changed(file, change, sign=True):
    """File of a certificate whose content was changed, with the digest of the new content."""
    data = json.loads(file.read_text(encoding="utf-8"))
    change(data)
    if sign:
        data["digest"] = _digest({name: part for name, part in data.items() if name != "digest"})
    file.write_text(json.dumps(data), encoding="utf-8")
    return file


def test_a_certificate_is_read_back_as_it_was_written(certificate, file):
    assert Certificate.load(file) == certificate
    assert Certificate.load(changed(file, lambda data: data.update(dict(reversed(data.items()))), False)) == certificate


DAMAGES = {
    "setting": lambda data: data.pop("settings"),
    "form is 7": lambda data: data.update(format=7),
    "version": lambda data: data.update(scene={}),
    "errors must be numbers by class": lambda data: data["settings"][0].update(errors=[0.1]),
}
CHANGES = [
    lambda data: data["scene"]["robot"].update(youngs_modulus=2e6),
    lambda data: data["settings"][0]["errors"].update(small=1e-9),
    lambda data: data.update(digest="0"),
]
DEEP = '{"format": 3, "digest": ' + '{"a": ' * 900 + "1" + "}" * 901


@pytest.mark.parametrize(
    "damage, words",
    [
        *((partial(changed, change=change), words) for words, change in DAMAGES.items()),
        *((partial(changed, change=change, sign=False), "changed since it was measured") for change in CHANGES),
        *((lambda file, text=text: file.write_text(text), "") for text in ("[" * 100_000, DEEP, "[]", "3")),
    ],
)
def test_a_damaged_file_is_no_certificate(file, damage, words):
    damage(file)
    with assert_refused("is no certificate", words):
        Certificate.load(file)
    with assert_refused("cannot be read"):
        Certificate.load("no\0file.json")


def test_odd_entries_are_refused(certificate, golden):
    first, *others = certificate.settings
    for name, part in {"certificate.txt": certificate, "setting.txt": first}.items():
        kept = {field.name: getattr(part, field.name) for field in fields(part)}
        entries = {name: value for name, value in kept.items() if name not in ("errors", "typical")}
        golden(f"odd_{name}", "\n".join(taken(partial(replace, part), entries)))
    own, negative = {"own": 0.1}, first.errors | {"small": -0.1}
    for change in ({"typical": own}, {"errors": own, "typical": own}, {"errors": negative}, {"typical": negative}):
        with assert_refused("errors" if "errors" in change else "typical"):
            replace(certificate, settings=(replace(first, **change), *others))


# The environment


def test_the_environment_tells_the_errors_of_a_certified_scene(certificate, file):
    setting = certificate.settings[2]
    for given in (certificate, file, str(file)):
        env = gym.make("SeastarSwim-v0", scene=certificate.at(setting), certificate=given)
        info = env.reset(seed=0)[1]
        assert max(info["path_error"], info["gait_error"]) == setting.promise(certificate.promised)
        assert info["gait_error"] == setting.promise(REPEATED)
        assert info["typical_gait_error"] == setting.typical_error(REPEATED)
        assert info["typical_error"] == setting.typical_error(tuple({*certificate.promised} - {*REPEATED}))
        assert (info["space_error"], info["time_error"]) == (setting.space_error, setting.time_error)
        assert info["batch_real_time_factor"] == setting.speed
    envs = gym.make_vec("SeastarSwim-v0", 3, vectorization_mode="vector_entry_point",
                        scene=certificate.at(setting), certificate=certificate)  # fmt: skip
    assert (envs.reset(seed=0)[1]["path_error"] == info["path_error"]).all()
    assert isinstance(env.unwrapped, RobotsEnv)
    assert json.loads(env.spec.to_json())["kwargs"]["certificate"] == str(file)


@pytest.mark.parametrize(
    "arguments, words",
    [
        *((lambda mine, scene=scene: {"scene": scene, "certificate": mine}, ("of another scene",))
          for scene in (Scene(), replace(SCENE, contact=Contact()), replace(SCENE, actuator=SmaPulse(0.5)))),
        (lambda mine: {"scene": SCENE, "certificate": replace(mine, version="0.0.1")}, ("of version 0.0.1",)),
        (lambda mine: {"certificate": "not there.json"}, ("cannot be read",)),
        (lambda mine: {"scene": WIRED, "certificate": timed_certificate(0.2)},
         ("errors of decisions every 0.2 s, none of strokes of 1 s",)),
        (lambda mine: {"scene": replace(SCENE, actuator=SmaWires()), "decision_period": 0.5,
                       "certificate": replace(mine, scene=replace(mine.scene, actuator=SmaWires()))},
         ("strokes of 1 s", "every 0.5 s", "error_bars=True")),
    ],
)  # fmt: skip
def test_a_certificate_lapses_for_another_scene_period_or_version_and_is_one(certificate, arguments, words):
    for made in BOTH:
        with assert_refused(*words):
            made(**arguments(certificate))


def test_where_nothing_is_promised_a_warning_says_what_to_do(certificate):
    uncertified = replace(certificate.at(certificate.settings[2]), numerics=Numerics())
    for made in BOTH:
        with pytest.warns(UserWarning, match=r"no errors of 9 nodes per limb.*for_error"):
            env = made(scene=uncertified, certificate=certificate)
        assert np.isnan(env.reset(seed=0)[1]["path_error"]).all()
    with pytest.warns(UserWarning, match=r"errors in info are NaN.* certify") as told:
        SeastarSwimEnv(scene=SCENE, fidelity="fast")
    assert told[0].filename == __file__  # where the environment is made
    with pytest.warns(UserWarning, match=r"Station draws .* none of the certificate's errors: error_bars=True") as told:
        SeastarSwimEnv(scene=SCENE, certificate=certificate, task="station", actions="joint")
    assert told[0].filename == __file__
    timed = {"fidelity": "fast", "decision_period": 0.2}
    with pytest.warns(UserWarning, match=r"errors in info are NaN: error_bars=True"):
        gym.make("SeastarSwim-v0", scene=replace(SCENE, actuator=SmaWires()), **timed)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gym.make("SeastarSwim-v0", fidelity="fast")
        gym.make("SeastarSwim-v0", scene=WIRED, **timed)


# The command


def test_the_command_writes_certificate_picture_and_the_chosen_scene(few_settings, tmp_path, capsys):
    (tmp_path / "mine.py").write_text("import seastar_gym as s\nscene = s.Scene(s.Seastar(limb_length=0.08))\n")
    out, chosen = tmp_path / "certificate.json", tmp_path / "chosen.json"
    arguments = [str(tmp_path / "mine.py"), "--samples", "2", "--error", "0.9", "--out", str(out)]
    assert command.main([*arguments, "--chosen", str(chosen)]) == 0
    assert Certificate.load(out).scene.robot.limb_length == 0.08
    assert out.with_suffix(".png").stat().st_size > 10_000
    assert "90 %: nodes_per_limb=5" in capsys.readouterr().out
    assert load_scene(chosen) == Certificate.load(out).for_error(0.9) and load_scene(None) == Scene()


def test_a_scene_that_was_chosen_before_is_moved_away_where_none_is_chosen(made, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(command, "certify", lambda *arguments: made)
    out, chosen = tmp_path / "certificate.json", tmp_path / "chosen.json"
    chosen.write_text("of another robot")
    assert command.main(["--error", "0.01", "--out", str(out), "--chosen", str(chosen)]) == 2
    assert not chosen.exists() and (tmp_path / "chosen.json.old").read_text() == "of another robot"
    told = capsys.readouterr()
    assert "Moved: " in told.out and "so ask for 0.075 or more." in told.err and "json is not written." in told.err
    assert command.main(["--error", "0.075", "--out", str(out), "--chosen", str(chosen)]) == 0
    assert load_scene(chosen) == made.for_error(0.075)


OWN = "from seastar_gym import Scene, SmaPulse\nclass Own(SmaPulse):\n    pass\nscene = Scene(actuator=Own())\n"
FILES = {"three.py": "scene = 3\n", "own.py": OWN, "open.py": "scene = Scene(\n", "open.json": "{"}


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["three.py"], "must define `scene`"),
        (["own.py"], "register_part"),
        (["open.py"], "open.py, line 1, is not Python: "),
        (["open.json"], "open.json is no scene: "),
        (["folder"], "is no file."),
        (["--error", "0"], "positive, finite share"),
        (["--out", "mine.png"], "where the picture goes"),
        (["--chosen", "chosen.json"], "give both"),
    ],
)
def test_what_cannot_be_certified_is_refused_before_it_is_measured(arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command, "certify", None)
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "folder").mkdir()
    assert command.main(arguments) == 2
    assert_told(capsys, words)
    for place in (["--out", "folder"], ["--error", "0.1", "--chosen", "folder"]):
        with pytest.raises(FileExistsError, match="folder is no file that can be written over"):
            command.main(place)


def test_the_table_and_the_picture_of_a_certificate(made, golden, monkeypatch):
    """Fastest first, and a line for every number of nodes."""
    golden("certificate.txt", command.as_text(made))
    slower = replace(made.settings[1], scheme="sdirk2", speed=10.0, errors=MADE["errors"] | {"b": 0.004})
    three = replace(made, settings=(*made.settings, slower))
    picture = drawn(monkeypatch, command, partial(command.draw, three))
    golden("certificate_picture.txt", f"{picture}\n{three.settings[2]}")
