import numpy as np
import pytest
import torch

from loco_drake.common.errors import InputError
from loco_drake.common.weights import save_weights
from loco_drake.evaluation.classifier import (
    ClassifierConfig,
    class_indices,
    embeddings,
    load_classifier,
    predict,
    train_classifier,
)
from loco_drake.evaluation.recognition import TransformerRecognizer, linear_recognizer
from loco_drake.evaluation.samples import make_samples
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import LABELS, parse_label
from tests.varied_motion import varied_motions

GO2 = get_robot("go2")
NAMES = ("dog-pace", "dog-trot")


def samples(seed=0, count=20):
    return make_samples(
        GO2, [m for label in NAMES for m in varied_motions(label, count, seed)]
    )


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    out = tmp_path_factory.mktemp("classifier")
    settings = LoopSettings(out=out, steps=60, learning_rate=1e-3)
    classifier, _ = train_classifier(
        samples(), ClassifierConfig(labels=NAMES), settings
    )
    return classifier, out / "classifier.safetensors"


def test_gaits_that_differ_are_told_apart(trained):
    classifier, _ = trained
    test = samples(seed=1)
    right = class_indices(test.labels, NAMES)[:, None]
    assert (predict(classifier, test.channels) == right).mean() == 1.0


def test_nothing_is_learned_from_shuffled_labels():
    """Both labels half on either gait: on other motions each is as likely as before."""
    train, test = samples(count=40), samples(seed=1, count=40)
    accuracies = []
    for seed in range(8):
        random = np.random.default_rng(seed)
        for gait in np.split(np.arange(len(train)), 2):
            train.labels[random.permutation(gait)] = np.repeat(
                np.unique(test.labels), 20
            )
        recognizer = linear_recognizer(train)
        accuracies.append((recognizer(test) == test.labels[:, None]).mean())
    assert abs(np.mean(accuracies) - 0.5) < 0.15


def test_weights_on_disk_are_the_same_network(trained):
    classifier, path = trained
    again = load_classifier(path)
    assert again.config == classifier.config
    channels = samples(seed=2, count=3).channels
    expected = embeddings(classifier, channels)
    np.testing.assert_array_equal(embeddings(again, channels), expected)
    assert expected.shape == (6, 2, 32)
    assert np.abs(expected).max() <= 1.0


def test_the_same_seed_gives_the_same_network_on_any_number_of_threads(tmp_path):
    found = []
    threads = torch.get_num_threads()
    for number in (1, 2):
        torch.set_num_threads(number)
        recognizer = TransformerRecognizer(samples(count=5), 4, steps=5)
        found.append(embeddings(recognizer.classifier, samples(1, 3).channels))
    torch.set_num_threads(threads)
    np.testing.assert_array_equal(found[0], found[1])
    other = TransformerRecognizer(samples(count=5), 5, steps=5)
    assert not np.allclose(
        embeddings(other.classifier, samples(1, 3).channels), found[0]
    )


def test_class_indices():
    labels = np.array(
        [parse_label(k).index for k in ("dog-trot", "mpc-trot", "dog-pace")]
    )
    np.testing.assert_array_equal(class_indices(labels, NAMES), [1, -1, 0])
    everything = tuple(map(str, LABELS))
    np.testing.assert_array_equal(class_indices(labels, everything), labels)


def test_other_weights_are_refused(tmp_path):
    path = tmp_path / "a.safetensors"
    save_weights(path, "classifier", {"mean": torch.zeros(3)}, {"network": {}})
    with pytest.raises(InputError, match="damaged header: 'labels'"):
        load_classifier(path)
    save_weights(path, "tokenizer", {"mean": torch.zeros(3)}, {})
    with pytest.raises(InputError, match="holds tokenizer weights"):
        load_classifier(path)
