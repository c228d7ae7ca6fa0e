"""Checkpoints give back the options of their run."""

from math import inf

import torch

from loco_drake.common.run_folder import (
    CHECKPOINT,
    open_run,
    options_of,
    read_checkpoint,
    with_options,
)
from loco_drake.tracking.config import TrainingConfig


def test_all_options_come_back(tmp_path):
    """Infinity too, which JSON does not have: it never ends an episode."""
    config = TrainingConfig(steps=7)
    config.environment.termination.position = inf
    config.environment.randomization.friction = (0.5, 1.0)
    config.ppo.hidden = [16]
    run = open_run(
        tmp_path, "tracker", "w", {}, steps=7, resume=False, options=options_of(config)
    )
    with run as folder:
        folder.save({"module/a": torch.zeros(1)}, {"steps": 1})
    saved = read_checkpoint(tmp_path / CHECKPOINT, "tracker")
    assert with_options(TrainingConfig(), saved.options) == config


def test_options_that_a_run_lacks_keep_their_value():
    config = TrainingConfig(seed=3)
    options = {"steps": 9, "ppo": {"epochs": 2}, "gone": 1}
    resumed = with_options(config, options)
    assert (resumed.seed, resumed.steps, resumed.ppo.epochs) == (3, 9, 2)
    assert resumed.ppo.batch == config.ppo.batch
