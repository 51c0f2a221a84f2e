"""The numbers that README and docs print are what the studies counted, and what a run gives.

docs/numbers.json is written by `make gallery`, together with the pictures and tables.
"""

import json
import re

import numpy as np
import pytest

import robotball as rb
from robotball.qualitative.straight_motions import stability_limit
from tests.random_robots import random_scene as random_robot
from tests.validation.test_readme import DOCS, README, ROWS
from validation import compare
from validation.bench.gallery import NUMBERS, OUTCOMES, outcomes_table
from validation.studies.extreme_maps import MAPS, cells_of
from validation.studies.random_runs import random_scene as random_ball
from validation.studies.tradeoff import configurations

STUDIES = json.loads(NUMBERS.read_text(encoding="utf-8"))
EXTREMES, TRADEOFF = STUDIES["extremes"], STUDIES["tradeoff"]
PAGES = {name: " ".join(text.split()) for name, text in {**DOCS, "README.md": README}.items()}
TIMES = f"{TRADEOFF['times_at_target']:,.0f}".replace(",", " ")
MISPRINTS = len(re.findall(r"^\| .* \|$", DOCS["errata.md"].partition("## Proofs")[0], re.M)) - 1
SAID = [
    ("README.md", f"would take {TIMES} times the processor time of RK4"),
    (
        "README.md",
        f"Of {EXTREMES['wrong']} runs that were wrong or broken MuJoCo itself reports a third",
    ),
    ("README.md", f"The paper has {MISPRINTS} misprints"),
    ("extremes.md", f"{len(MAPS)} maps, both rolling models"),
    ("extremes.md", f"{EXTREMES['runs']} runs of the recipe"),
    ("extremes.md", f"{EXTREMES['wrong']} runs are off by more than a tenth or broke off"),
    ("extremes.md", f"MuJoCo itself says so in {EXTREMES['reported_by_engine']} of them"),
    ("extremes.md", f"the precheck warns of {EXTREMES['foretold']} before the run"),
    ("extremes.md", f"the monitor reports {EXTREMES['noticed']} during it"),
    (
        "extremes.md",
        f"Of the {EXTREMES['accurate']} accurate runs {EXTREMES['alarms']} are warned of",
    ),
    ("extremes.md", f"of which {STUDIES['random']['failed']} failed, none was missed"),
    (
        "tradeoff.md",
        f"in {TRADEOFF['servos_off_their_rates']} of {TRADEOFF['servos']} configurations hinges",
    ),
    (
        "tradeoff.md",
        f"the best of the others is at {TRADEOFF['best_servo']:.0e}".replace("e-0", "e-"),
    ),
    ("tradeoff.md", f"reach {TRADEOFF['best_of_first_order']:.0e} at 0.2 ms".replace("e-0", "e-")),
    ("findings.md", f"the best of {TRADEOFF['servos']} configurations is at 3e-3"),
    ("findings.md", f"would take {TIMES} times the processor time of RK4"),
]


@pytest.mark.parametrize(("page", "words"), SAID)
def test_a_study_s_number_is_the_one_that_is_printed(page: str, words: str) -> None:
    """To the last digit."""
    assert words in PAGES[page]


def test_the_table_of_outcomes_is_the_study_s() -> None:
    """Its numbers add up to all runs."""
    assert outcomes_table(EXTREMES["outcomes"]) in DOCS["extremes.md"]
    assert len(re.findall(OUTCOMES, DOCS["extremes.md"], re.DOTALL)) == 1
    assert sum(sum(each.values()) for each in EXTREMES["outcomes"].values()) == EXTREMES["runs"]


def test_the_studies_are_those_of_today() -> None:
    """As many configurations and cells as the program has; what is said of them in words is so."""
    assert len(configurations()) == TRADEOFF["configurations"]
    assert sum(len(cells_of(each)) for each in MAPS.values()) == EXTREMES["runs"]
    assert EXTREMES["missed"] == 0  # "none is missed by both"
    assert STUDIES["random"]["missed"] == 0  # "none was missed"
    assert STUDIES["random"]["false_alarms"] == 0  # "no alarm was false"
    assert EXTREMES["reported_by_engine"] / EXTREMES["wrong"] == pytest.approx(1 / 3, abs=0.02)
    assert TRADEOFF["times_at_target"] == pytest.approx(20_000, rel=0.2)  # "about 20 000 times"


def test_every_number_of_the_readme_is_held() -> None:
    """By this file, or by the demo's table, of which each number is run again."""
    found = README.partition("## What was found")[2].partition("## Where")[0]
    numbers = re.findall(r"\d[\d ]*(?:[.]\d+)?(?:e-\d+)?", re.sub(r"\(.*?\)", "", found))
    # Slips within 0.1 s, in 10 s half of the path, right to 1e-14, at 1e-6: by the demo's table.
    by_the_table = {"0.1", "10", "1e-14", "1e-6"}
    held = by_the_table | {TIMES, str(EXTREMES["wrong"]), str(MISPRINTS), "4"}
    assert {number.strip() for number in numbers} <= held


def test_words_about_the_demo_are_its_table_s() -> None:
    """README and findings round what the table has."""
    errors = {(scene, preset): float(error) for scene, preset, error in ROWS}
    assert errors["fig12", "naive"] == pytest.approx(0.61, abs=0.005)  # 61 %, more than half
    assert errors["fig12", "balanced"] == pytest.approx(2e-9, rel=0.3)
    assert errors["fig12", "accurate"] == pytest.approx(2e-12, rel=0.3)
    assert errors["fig12", "adaptive"] < 2e-14
    (slipped,) = re.findall(
        r"fig12 \| naive .*slipped .*? at t = ([\d.]+) s; f", DOCS["settings.md"]
    )
    assert float(slipped) < 0.1


@pytest.mark.parametrize("name", ["fast", "balanced", "accurate", "adaptive"])
def test_the_settings_page_has_the_presets_tolerances(name: str) -> None:
    """Beside each preset."""
    (shown,) = re.findall(rf"`--preset {name}`.*?right to ([\de-]+)", DOCS["settings.md"])
    assert float(shown) == rb.PRESETS[name].error_tolerance


@pytest.mark.parametrize(
    "name",
    [
        "fast",
        "balanced",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("accurate", "adaptive")),
    ],
)
def test_the_settings_page_has_the_presets_worst_errors(name: str) -> None:
    """Ball 14 and robot 74 have them: 3.7e-6 and 6.3e-3 with *fast*, RK4's; within a factor of 3.

    That is room for the last bits, which a sensitive robot magnifies.
    """
    (row,) = re.findall(rf"^\| {name} \| (.*) of \d+ \|$", DOCS["settings.md"], re.M)
    _, balanced, _, unbalanced, _ = row.split(" | ")
    scenes = (random_ball(14), balanced), (random_robot(np.random.default_rng(74)), unbalanced)
    for scene, shown in scenes:
        error = compare(scene, name, rb.sample_times(10.0)).path_error
        assert error is not None
        assert float(shown) / 3 < error < 3 * float(shown)


@pytest.mark.parametrize("name", ["fig05b", "fig12", "classical_chaotic"])
def test_the_reference_is_as_good_as_the_method_says(name: str) -> None:
    """By its own estimate: 1.7e-14, 1.2e-15 and 1.1e-14, the last 3.2e-14 with Python 3.14."""
    assert "at most 4e-14 of the path over 10 s" in PAGES["method.md"]
    motion = rb.integrate(rb.load_scene(name), rb.sample_times(10.0))
    assert motion.reference_error < 4e-14


def test_fig_10_is_stable_below_what_is_printed() -> None:
    """M² below 2.08 in the findings, 2.0806 in the errata."""
    limit = stability_limit(rb.load_scene("fig10").parameters)
    assert f"M² below {limit:.2f}" in PAGES["findings.md"]
    assert f"f < {limit:.4f}" in PAGES["errata.md"]


def test_the_page_of_errata_has_a_proof_of_each() -> None:
    """By its number: E20 is a letter, with nothing to compute; E23 and E26 are no misprints."""
    proved = {int(number) for number in re.findall(r"^\| E(\d+),", DOCS["errata.md"], re.M)}
    misprints = set(range(1, 27)) - {23, 26}
    assert len(misprints) == MISPRINTS
    assert misprints - proved == {20}
