"""Model cards say what the bundled policies are and how they swim, and are those of the weights beside them."""

import hashlib
import re
import shutil
from types import SimpleNamespace

import pytest

from later import Later
from seastar_gym import Scene, Seastar
from seastar_gym.controllers.learned import BUNDLED, load

cards = Later("agents.cards")
POLICIES = sorted(BUNDLED.parent.glob("*.safetensors"))


def row(text, fidelity):
    """Cells of a card's row."""
    (found,) = re.findall(rf"^\| `{fidelity}` \|(.*)\|$", text, re.MULTILINE)
    return [cell.strip() for cell in found.split("|")]


@pytest.mark.parametrize("file", POLICIES, ids=lambda file: file.stem)
def test_every_policy_in_the_box_has_its_card(file):
    text = file.with_suffix(".md").read_text(encoding="utf-8")
    assert hashlib.sha256(file.read_bytes()).hexdigest() in text
    assert [*cards.scenes_of(load(file))] == [*cards.FIDELITIES]  # or the next card would be of a robot of one's own
    training = load(file).training
    assert all(f"`{command}`" in text for command in training["commands"])
    assert f"{training['strokes']:,}" in text and f"seed: {training['seed']}" in text
    assert "MIT" in text and "no real robot has swum by it" in text
    for fidelity in cards.FIDELITIES:
        pentagon, _, _, arrived = row(text, fidelity)
        assert re.match(r"[\d.]+ s, \d+ (strokes|decisions)$", pentagon)
        assert arrived == (f"{cards.HELD_OUT_PATHS} of {cards.HELD_OUT_PATHS}" if fidelity in cards.CHEAP else "")


def test_a_card_tells_what_is_measured_now(monkeypatch):
    """The shipped card of the policy for strokes, at the cheapest fidelity."""
    monkeypatch.setattr("agents.cards.FIDELITIES", ("fast",))
    policy, text = load(), BUNDLED.with_suffix(".md").read_text(encoding="utf-8")
    now = cards.card(policy, BUNDLED, "", cards.measure(policy, threads=1))
    assert row(now, "fast") == row(text, "fast")


def test_the_command_writes_cards_and_says_what_is_wrong(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("agents.cards.FIDELITIES", ("fast",))
    monkeypatch.setattr("agents.cards.HELD_OUT_PATHS", 1)
    for suffix in (".safetensors", ".json"):
        shutil.copy(BUNDLED.with_suffix(suffix), tmp_path / f"mine{suffix}")
    file = tmp_path / "mine.safetensors"
    assert cards.main(["--policies", str(file)]) == 0
    text = file.with_suffix(".md").read_text(encoding="utf-8")
    assert text.startswith("# Model card: mine\n") and row(text, "fast")[3] == "1 of 1"
    scene = Scene(Seastar(3, 7), numerics=load().scene.numerics)
    stranger = SimpleNamespace(scene=scene, description=load().description)
    assert [*cards.scenes_of(stranger)] == [cards.OWN]  # and nobody else's
    assert cards.main(["--policies", str(tmp_path / "other.safetensors")]) == 2
    assert "There is no trained policy at" in capsys.readouterr().err
