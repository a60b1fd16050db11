"""Generators: schedules, data sets, and the estimate of their time."""

import subprocess
import sys
from dataclasses import replace

import pytest

from insonify_training.dataset import Quality
from insonify_training.estimate import phases
from insonify_training.generators import GENERATORS, ROLLING, SHIPPED, TABLE


def test_rates_and_weights_follow_their_schedules():
    config = replace(GENERATORS["fast_msa"], steps=100, rate=1.0, decay_from=0.5, gan_weight=1.0, warmup=10, ramp=5)
    assert [config.rate_at(step) for step in (0, 50, 75, 99)] == pytest.approx([1.0, 1.0, 0.5, 0.02])
    weights = [config.gan_weight_at(step) for step in range(20)]
    assert weights[:10] == [0.0] * 10 and weights[10:15] == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0]) and weights[19] == 1.0


def test_phases_cover_all_steps():
    fast, classic = GENERATORS["fast_msa"], GENERATORS["classic_msa"]
    assert phases(fast) == [(fast.steps, 0)]
    assert phases(classic) == [(classic.warmup, 0), (classic.steps - classic.warmup, classic.warmup)]
    assert phases(classic.trial(12)) == [(6, 0), (6, 6)]


def test_generators_are_named_by_their_variant_and_data():
    for name, config in GENERATORS.items():
        _, variant, *data = name.split("_")
        assert variant == config.variant.lower() and [config.data] == (data or ["1x1"]), name
        assert Quality.parse(config.hq) == Quality(32, 3, 1 if config.data == "single" else 9)
    # All that the single-look table compares is trained equally.
    for name in (name for name in TABLE if name.endswith("_single")):
        assert replace(GENERATORS[name], hq="32x3x9") == GENERATORS[name.removesuffix("_single")]


def test_scripts_train_reads_lists_and_data_sets():
    def listed(*words):
        return subprocess.run(
            [sys.executable, "-m", "insonify_training.generators", *words], capture_output=True, text=True, check=False
        )

    assert listed("shipped").stdout.split() == list(SHIPPED) and listed("table").stdout.split() == list(TABLE)
    expected = f"fast_m_rolling rolling {ROLLING} 32x3x9\nfast_m_single single 1x1 32x3x1\n"
    assert listed("fast_m_rolling", "fast_m_single").stdout == expected
    wrong = listed("fast_x")
    assert wrong.returncode == 1 and "no generator is called fast_x" in wrong.stderr


@pytest.mark.parametrize("text", ["32", "32x", "32x3x9x1", "axb"])
def test_wrong_qualities_are_errors(text):
    with pytest.raises(ValueError, match="RAYSxLAYERS"):
        Quality.parse(text)
    assert Quality.parse_list("1x1,2x3x9") == (Quality(1, 1, 1), Quality(2, 3, 9))
    assert str(Quality.parse("32x3x9")) == "32x3 of 9 angles" and str(Quality.parse("1x1")) == "1x1"
