"""Asks the search of the built guide what readers ask: `python .ci/search.py site`, in an environment with Sphinx.

Finds what the search of the site finds, from its index, by the rules of Sphinx's searchtools.js: all words of a
question are in a page, whose score is that of its best word or of a heading that has the whole question. As
docs/_static/scorer.js has it, words in a title count, and pages that few ask for come last. Objects of the reference
are left out. Exits with 1 and names the questions whose page is not among the first.
"""

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

FIRST = 3
"""Number of results that a reader looks at."""
QUESTIONS = {
    "change the drag": ("own_robot", "Water(density=1000.0, drag_coefficient=0.8)"),
    "own reward": ("own_reward", "class Thrifty(gym.Wrapper)"),
    "train on my own reward": ("own_reward", 'PPO("MlpPolicy", BatchVecEnv(ThriftyBatch(batch))'),
    "eight limbs observation": ("own_robot", "Scene(robot=Seastar(n_limbs=8))"),
    "water current": ("own_robot", "UniformCurrent(u_x=0.001, u_y=0.0)"),
    "SAC SeastarSwimContinuous-v0 BatchVecEnv": ("training", 'SAC("MlpPolicy", BatchVecEnv(batch)'),
    "VecNormalize": ("training", "VecNormalize(BatchVecEnv(batch)"),
    "how long will mine take": ("training", "decisions per second"),
    "what does info contain": ("environments", "| `energy_per_metre` "),
    "units": ("environments", "**Units** are SI"),
    "cite": ("index", "CITATION.cff"),
    "deploy on a real robot": ("plant", "seastar drive policy.safetensors --plant serial:"),
    "record a video": ("faq", "from seastar_gym.evaluation.films import film"),
    "use something else": ("index", "https://www.cosseratrods.org"),
    "which fidelity": ("accuracy", '`fidelity="fast"`'),
}
"""Questions, the page that answers each, and what stands there."""
LESS = re.compile(r"/\^\((.*?)\)\$/")
"""Pages in docs/_static/scorer.js that come last."""


def index_of(site: Path) -> Any:
    """Index of a site."""
    text = (site / "searchindex.js").read_text(encoding="utf-8")
    return json.loads(text.removeprefix("Search.setIndex(").removesuffix(")"))


def stemmed(question: str) -> set[str]:
    """Words of a question as the index has them, without those that it leaves out."""
    from sphinx.search.en import SearchEnglish

    english = SearchEnglish({})
    words = [word.lower() for word in re.findall(r"\w+", question)]
    return {english.stem(word) for word in words if word not in english.stopwords and not word.isdigit()}


def by_words(index: Any, words: set[str]) -> Iterator[tuple[int, float]]:
    """Pages that have all words, with the score of the best."""
    scores: dict[int, dict[str, float]] = {}
    for word in words:
        found = [(index["terms"].get(word), 5.0), (index["titleterms"].get(word), 15.0)]
        for kind, score in (("terms", 2.0), ("titleterms", 7.0)):
            if len(word) > 2 and word not in index[kind]:
                found += [(pages, score) for term, pages in index[kind].items() if word in term]
        if all(pages is None for pages, _ in found):
            continue
        for pages, score in found:
            for page in pages if isinstance(pages, list) else [] if pages is None else [pages]:
                scores.setdefault(page, {})[word] = score
    needed = len(words), sum(len(word) > 2 for word in words)
    return ((page, max(each.values())) for page, each in scores.items() if len(each) in needed)


def by_titles(index: Any, question: str) -> Iterator[tuple[int, float]]:
    """Pages with a heading that has the whole question and is at most twice as long."""
    asked = question.lower().strip()
    for title, places in index["alltitles"].items():
        if asked in title.lower() and len(asked) >= len(title) / 2:
            for page, _ in places:
                yield page, round(15 * len(asked) / len(title)) + (index["titles"][page] == title)


def results(index: Any, question: str, less: str) -> list[str]:
    """Names of pages, best first."""
    found = [*by_titles(index, question), *by_words(index, stemmed(question))]
    asked, titles = re.findall(r"\w{3,}", question.lower()), [title.lower() for title in index["titles"]]
    scored = []
    for page, score in found:
        in_title = sum(word in titles[page] for word in asked)
        scored.append((score + in_title - 20 * bool(re.fullmatch(less, index["docnames"][page])), page))
    scored.sort(key=lambda one: (-one[0], titles[one[1]]))
    return list(dict.fromkeys(index["docnames"][page] for _, page in scored))


def main(site: Path) -> int:
    """Ask all questions; returns the exit code."""
    scorer = Path(__file__).parents[1] / "docs" / "_static" / "scorer.js"
    index, pattern = index_of(site), LESS.search(scorer.read_text(encoding="utf-8"))
    assert pattern is not None
    first = {question: results(index, question, pattern[1])[:FIRST] for question in QUESTIONS}
    missing = {question: found for question, found in first.items() if QUESTIONS[question][0] not in found}
    for question, found in missing.items():
        print(f"{question!r} finds {', '.join(found) or 'nothing'}, not {QUESTIONS[question][0]}.")
    print(f"{len(QUESTIONS) - len(missing)} of {len(QUESTIONS)} questions find their page.")
    return int(bool(missing))


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
