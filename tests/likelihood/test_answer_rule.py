from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from noisy_cells import random_database
from sentences import refused

from semsig_gis.core.errors import InputError
from semsig_gis.likelihood.answer_rule import AnswerRule, calibrate, open_rule, save_rule
from semsig_gis.likelihood.posterior import posterior

if TYPE_CHECKING:
    from pathlib import Path


def queries(seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return chances and outcomes of a model that is too sure of itself."""
    rng = np.random.default_rng(seed)
    masses = np.where(rng.random(count) < 0.5, rng.beta(1, 5, count), rng.beta(20, 1, count))
    return masses, rng.random(count) < masses**1.3


def test_the_promise_is_kept() -> None:
    masses, correct = queries(99, 200_000)
    broken = 0
    for seed in range(150):
        rule = calibrate(*queries(seed, 1500), precision=0.95)
        answered = masses >= rule.threshold
        broken += bool(answered.any() and correct[answered].mean() < 0.95)
    assert broken / 150 <= 0.05 + 0.03
    assert rule.coverage > 0.2


def test_counts_are_those_of_the_threshold() -> None:
    masses, correct = queries(0, 2000)
    rule = calibrate(masses, correct, precision=0.9, radius=25.0)
    answered = masses >= rule.threshold
    counts = (2000, answered.sum(), (~correct[answered]).sum())
    assert (rule.queries, rule.answered, rule.wrong) == counts
    assert (rule.radius, rule.coverage) == (25.0, answered.mean())


def test_too_few_queries_prove_nothing() -> None:
    rule = calibrate(np.ones(100), np.ones(100, bool))
    assert rule.threshold == math.inf
    assert rule.answered == 0
    assert not rule.answers(1.0)
    assert calibrate(np.ones(217), np.ones(217, bool)).threshold == 1.0
    assert calibrate([], []).threshold == math.inf
    assert calibrate(np.ones(500), np.zeros(500, bool)).threshold == math.inf
    # Equal chances are answered together.
    assert calibrate(np.full(1000, 0.9), np.arange(1000) < 600).threshold == math.inf


def test_a_posterior_is_decided_on() -> None:
    database = random_database(0)
    loglik = np.full(len(database), -50.0)
    loglik[7] = 0.0
    answer = AnswerRule(threshold=0.9).decide(posterior(database, loglik))
    assert answer.given
    assert answer.cell == 7
    assert [answer.x, answer.y] == database.xy[7].tolist()
    assert answer.mass == pytest.approx(1.0)
    assert not AnswerRule(threshold=1.1).decide(posterior(database, loglik)).given


@pytest.mark.parametrize("threshold", [0.75, math.inf])
def test_a_rule_is_saved_and_opened(tmp_path: Path, threshold: float) -> None:
    rule = AnswerRule(threshold=threshold, queries=10, answered=5, wrong=1)
    save_rule(rule, tmp_path / "rule.json")
    assert open_rule(tmp_path / "rule.json") == rule
    assert math.isnan(AnswerRule(threshold=0.5).coverage)


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"threshold": "a"}', '{"threshold": 1, "more": 2}']
)
def test_damaged_rules(tmp_path: Path, text: str) -> None:
    (tmp_path / "rule.json").write_text(text)
    with refused(InputError, "rule.json", "save_rule"):
        open_rule(tmp_path / "rule.json")
    with refused(InputError, "none.json", "No such file"):
        open_rule(tmp_path / "none.json")
